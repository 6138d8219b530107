"""The network seam: calls with retries, limits, cache and cost; recordings; baselines.

Importing this package imports neither litellm nor aiohttp, which are loaded by the first call, the
first batch or the first lookup of a provider.
"""
