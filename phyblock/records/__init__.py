"""The lines and files of a run, each declared once for writing and reading."""
