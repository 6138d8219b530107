"""The network seam: calls with retries, limits, cache and cost; recordings; baselines.

Importing this package imports neither litellm nor aiohttp: the first call through one of them does,
as do the first batch and the first look for a provider.
"""

from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.costs import Budget, Estimate, ends_on, estimate, is_billed, tariff_of
from phyblock.models.keys import api_key_status, server_address
from phyblock.models.model import ModelEvent, RetryPolicy, build_model, takes_format
from phyblock.models.request import (
    HaltedError,
    Image,
    Message,
    Model,
    Request,
)  # fmt: skip
from phyblock.records.record import Reply, Usage

__all__ = [
    "Budget", "Estimate", "HaltedError", "Image",
    "Message", "Model", "ModelEvent", "Reply", "ReplyCache", "Request", "RetryPolicy", "Usage",
    "api_key_status", "build_model", "ends_on", "estimate", "is_billed",
    "reply_key", "server_address", "takes_format", "tariff_of",
]  # fmt: skip
