"""The verbs `phyblock scenes ...` and `phyblock questions ...`, one module each."""
