"""Whole data sets held against geometry and physics: those made here and those made elsewhere."""
