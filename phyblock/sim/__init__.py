"""Geometry, contact, stability and pictures; no engine is loaded before a world is made."""
