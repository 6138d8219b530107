"""Figures of full planning."""
