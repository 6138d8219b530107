"""What stored records come to: measures, estimates with their intervals, tables as text."""
