"""Every line and file of a run that is written and read again, each declared once."""
