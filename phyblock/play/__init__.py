"""A person in the place of a model: the same pictures, prompts, records and scores."""
