"""What a person may write in YAML: suites, models files and --set overrides."""
