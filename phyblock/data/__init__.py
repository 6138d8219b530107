"""Readers of data: scenes and questions in our own format and in the official layout."""
