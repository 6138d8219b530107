"""The network seam: calls with retries, limits, cache and cost; recordings; baselines.

Importing this package imports neither litellm nor aiohttp: the first call through one of them does,
as do the first batch and the first look for a provider.
"""
