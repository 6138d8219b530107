"""The verbs `phyblock scenes ...` and `phyblock vqa ...`, one module each."""
