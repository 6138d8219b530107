"""Frozen dataclasses of the domain and pure functions on them: no files, clock or network."""
