"""Adapters to other frameworks, one module each; none is imported by the rest."""
