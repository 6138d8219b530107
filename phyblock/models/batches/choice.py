"""Which protocol the batches of a model have."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from phyblock.config.models import ModelConfig
from phyblock.errors import Problem, SpecError
from phyblock.models.batches.anthropic import AnthropicBatches
from phyblock.models.batches.gemini import GeminiBatches
from phyblock.models.batches.openai import OpenAIBatches
from phyblock.models.batches.protocol import BatchProtocol

__all__ = ["batch_protocol"]

_PROTOCOLS: Mapping[str, Callable[[ModelConfig, tuple[str, ...]], BatchProtocol]] = {
    "openai": OpenAIBatches,
    "hosted_vllm": OpenAIBatches,
    "anthropic": AnthropicBatches,
    "gemini": GeminiBatches,
}


def batch_protocol(config: ModelConfig, secrets: tuple[str, ...]) -> BatchProtocol:
    """The protocol of a model's provider; SpecError where there is none that is spoken here."""
    make = _PROTOCOLS.get(config.provider)
    if make is None:
        message = "cannot be asked in batches: phyblock does not speak those of its provider"
        allowed = ", ".join(f"{name}/..." for name in _PROTOCOLS)
        where = f"model {config.name}"
        raise SpecError(Problem(where, message, "batch", config.id, allowed))
    if config.has_address and config.api_base is None:
        message = "cannot be asked in batches at a list of servers: a batch lies at one"
        raise SpecError(Problem(f"model {config.name}", message, "batch"))
    return make(config, secrets)
