"""The network seam: calls with retries, limits, cache and cost; recordings; baselines.

Importing this package imports neither litellm nor aiohttp: the first call through one of them does.
"""

from phyblock.models.batch import BatchFiles, under_way, waiting_keys
from phyblock.models.build import build_model
from phyblock.models.cache import CacheStats, ReplyCache, reply_key
from phyblock.models.costs import (
    Budget,
    Estimate,
    Price,
    Prices,
    Rate,
    Tariff,
    ends_on,
    estimate,
    is_billed,
    is_unlisted,
    most_usd,
    prices_of,
    reply_cost_usd,
    today,
)
from phyblock.models.keys import KeyStatus, api_key_status, server_address
from phyblock.models.litellm_client import known_providers
from phyblock.models.model import ModelEvent, Observer, RetryPolicy, Tell, takes_format
from phyblock.models.replay import read_raw_reply
from phyblock.models.request import (
    AskLaterError,
    GatheringModel,
    HaltedError,
    Image,
    Message,
    Model,
    Request,
)
from phyblock.records.reply import Reply, Usage

__all__ = [
    "AskLaterError",
    "BatchFiles",
    "Budget",
    "CacheStats",
    "Estimate",
    "GatheringModel",
    "HaltedError",
    "Image",
    "KeyStatus",
    "Message",
    "Model",
    "ModelEvent",
    "Observer",
    "Price",
    "Prices",
    "Rate",
    "Reply",
    "ReplyCache",
    "Request",
    "RetryPolicy",
    "Tariff",
    "Tell",
    "Usage",
    "api_key_status",
    "build_model",
    "ends_on",
    "estimate",
    "is_billed",
    "is_unlisted",
    "known_providers",
    "most_usd",
    "prices_of",
    "read_raw_reply",
    "reply_cost_usd",
    "reply_key",
    "server_address",
    "takes_format",
    "today",
    "under_way",
    "waiting_keys",
]
