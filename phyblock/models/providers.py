"""Which providers there are, by litellm and by what is reached without it."""

from __future__ import annotations

import importlib.util

from phyblock.config.models import DIRECT_PROVIDERS, ModelConfig
from phyblock.models.keys import KEYLESS
from phyblock.models.litellm_call import litellm_providers
from phyblock.models.prices import map_entry, mapped_providers

__all__ = ["known_providers"]

_AT_HAND = frozenset((*DIRECT_PROVIDERS, *KEYLESS))


def known_providers(config: ModelConfig) -> frozenset[str]:
    """The providers of which a model's is one; litellm is imported only where its map has neither
    the model nor another of its provider, which takes seconds.
    """
    if config.provider in _AT_HAND or map_entry(config) or config.provider in mapped_providers():
        return frozenset((config.provider,))
    if importlib.util.find_spec("litellm") is None:
        return _AT_HAND
    return _AT_HAND | litellm_providers()
