"""Local servers that speak the providers' protocols, with faults on demand."""
