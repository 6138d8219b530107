"""The network seam: calls with retries, limits, cache and cost; recordings; baselines.

Importing it imports neither litellm nor aiohttp: the first call or lookup of a provider does.
"""
