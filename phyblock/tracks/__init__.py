"""Tracks, one module each: requests, judgement, baselines, records; the registry lists them."""
