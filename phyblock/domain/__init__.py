"""The field's nouns as frozen dataclasses and pure functions: no files, clock or network."""
