"""Models of what people write in YAML: suites, models files and --set overrides."""
