"""A run in the formats of other tools: Inspect AI logs, Hugging Face datasets, CSV and Parquet."""
