"""The commands `phyblock scenes ...` and `phyblock questions ...`, one module each."""
