"""Ways to answer questions without understanding them, tried on whole sets."""
