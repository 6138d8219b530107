"""Which models take the JSON schema of an answer as `response_format`, and how one refuses it."""

from __future__ import annotations

import re

from phyblock.config.models import DIRECT_PROVIDERS, ModelConfig
from phyblock.errors import ModelError, RefusedError
from phyblock.models.prices import map_entry

__all__ = ["FORMAT_HINT", "refuses_format", "takes_format"]

FORMAT_HINT = (
    "if the provider takes no JSON schema, set response_format: never for this model in the models "
    "file: the prompt says the form all the same"
)
_WHOLE_PROVIDERS = ("predibase", "fireworks_ai", "lm_studio", "nebius", "databricks")
"""Providers of which litellm knows that all their models take a schema."""

_SPEAKS_OF_FORMAT = re.compile(
    r"response_?(?:format|schema|json_?schema)|json[_ ]?schema|structured[_ ]outputs?"
    r"|output_(?:format|config)|guided[_ ](?:json|decoding)|\bgrammar\b",
    re.IGNORECASE,
)


def takes_format(config: ModelConfig) -> bool:
    """Whether a model is taken to accept a schema.

    Servers of one's own that speak the OpenAI protocol (vLLM, SGLang, llama.cpp, LM Studio, Ollama)
    do; of all others litellm's map of models is believed.
    """
    if config.provider in DIRECT_PROVIDERS and config.has_address:
        return True
    is_whole = config.provider in _WHOLE_PROVIDERS
    return is_whole or bool(map_entry(config).get("supports_response_schema"))


def refuses_format(error: ModelError) -> bool:
    """Whether an error can mean that the provider does not take the field."""
    is_refusal = error.status in (400, 422) or error.sent == "no"
    speaks_of_it = _SPEAKS_OF_FORMAT.search(str(error)) is not None
    return is_refusal and speaks_of_it and not isinstance(error, RefusedError)
