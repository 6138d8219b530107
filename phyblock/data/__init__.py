"""Readers of data: scenes and questions in phyblock's own format and in the official layout."""
