"""Calls through litellm: one request each, its own retries off. The only place that imports it.

litellm takes seconds to import, so it is imported by the first call and never by a run whose
replies are all cached, recorded or made by baselines.
"""

from __future__ import annotations

import asyncio
import logging
import os
import re
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from phyblock.errors import ModelError, RefusedError, UnavailableError
from phyblock.models.base import Reply
from phyblock.models.completions import read_completion
from phyblock.models.config import ModelConfig
from phyblock.models.keys import api_key, hidden
from phyblock.models.payload import wire_messages
from phyblock.models.transport import (
    Call,
    SeedRefusedError,
    classify,
    refuses_seed,
    retry_after_s,
)

if TYPE_CHECKING:
    import types

__all__ = ["LitellmTransport"]

_DEFAULTS = {
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",  # else the import fetches the price map
    "MAX_BASE64_LENGTH_FOR_LOGGING": "0",  # else a regex goes over every picture for its log
    "LITELLM_MODE": "PRODUCTION",  # else the import reads keys from any .env file above
}
_MALFORMED = re.compile("Unable to get json response|Error converting to valid response")
_open: set[LitellmTransport] = set()


class LitellmTransport:
    """`litellm.acompletion`, for every provider it knows."""

    def __init__(self, config: ModelConfig, secrets: Sequence[str]) -> None:
        self._config = config
        self._secrets = secrets

    async def send(self, call: Call) -> Reply:
        """Send once; see Transport."""
        litellm = _litellm()
        _open.add(self)
        arguments = self._arguments(call)
        started = time.perf_counter()
        try:
            response = await asyncio.wait_for(
                litellm.acompletion(**arguments), self._config.timeout_s
            )
        except asyncio.TimeoutError:
            raise classify(None, "no answer in time") from None
        except litellm.UnsupportedParamsError as error:
            raise self._unsupported(call, str(error)) from None
        except Exception as error:
            # litellm gives whatever went wrong a class of its own; all of them mean that the call
            # failed, and the status says how.
            raise self._failure(call, error) from None
        return read_completion(_plain(response), time.perf_counter() - started)

    async def aclose(self) -> None:
        """Close litellm's clients, which all models share, with the last model that used them."""
        if self in _open:
            _open.discard(self)
            if not _open:
                await _litellm().close_litellm_async_clients()

    def _arguments(self, call: Call) -> dict[str, Any]:
        arguments = {
            **call.params,
            "model": self._config.id,
            "messages": wire_messages(call.messages),
            "timeout": self._config.timeout_s,
            "num_retries": 0,
            "max_retries": 0,
            "no-log": True,
        }
        key = api_key(self._config)
        optional = {"api_key": key, "api_base": self._config.api_base, "seed": call.seed}
        return arguments | {name: value for name, value in optional.items() if value is not None}

    def _unsupported(self, call: Call, message: str) -> ModelError | SeedRefusedError:
        """litellm knows that the provider lacks a parameter; nothing was sent."""
        if call.seed is not None and refuses_seed(400, message):
            return SeedRefusedError(sent=False)
        return UnavailableError(hidden(message, self._secrets))

    def _failure(self, call: Call, error: Exception) -> ModelError | SeedRefusedError:
        status, message = _status(error), _message(error)
        if call.seed is not None and refuses_seed(status, message):
            return SeedRefusedError(sent=True)
        text = hidden(message, self._secrets)
        if isinstance(error, _litellm().ContentPolicyViolationError):
            return RefusedError(text, status=status)
        headers = getattr(error, "litellm_response_headers", None)
        return classify(status, text, retry_after_s=retry_after_s(headers))


def _status(error: Exception) -> int | None:
    """The server's status; None where litellm made one up for a connection that failed.

    A body that litellm could not read comes with whatever status; the server had said 200.
    """
    if _MALFORMED.search(str(error)):
        return 200
    status: int | None = getattr(error, "status_code", None)
    heard = getattr(error, "litellm_response_headers", None) is not None
    return status if heard or (status is not None and status != 408 and status < 500) else None


def _message(error: Exception) -> str:
    """What went wrong, with the code of the error body, and without litellm's own traceback."""
    body = getattr(error, "body", None)
    code = body.get("code") if isinstance(body, dict) else None
    text = str(error).partition("Traceback (most recent call last)")[0]
    return f"{text} {code}" if code else text


def _litellm() -> types.ModuleType:
    """litellm, imported with its network access, key files, chatter and second requests off."""
    for name, value in _DEFAULTS.items():
        os.environ.setdefault(name, value)
    import litellm

    if not litellm.suppress_debug_info:
        litellm.suppress_debug_info = True
        litellm.telemetry = False
        litellm.drop_params = False
        for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        _send_once()
    module: types.ModuleType = litellm
    return module


def _send_once() -> None:
    """Take from litellm's HTTP client its habit of sending again what died with its connection.

    It has no setting for it (BerriAI/litellm pull request 34830 removes it), and a request that
    the server may have answered and billed would be sent twice unseen.
    """
    import httpx
    from litellm.llms.custom_httpx.http_handler import AsyncHTTPHandler

    async def refuse(_: object, url: str, **__: object) -> None:
        raise httpx.ReadError("the connection was lost", request=httpx.Request("POST", url))

    AsyncHTTPHandler.single_connection_post_request = refuse


def _plain(response: Any) -> Mapping[str, object]:
    """The parts of litellm's response that a reply is made of."""
    return {
        "choices": [
            {"finish_reason": choice.finish_reason, "message": choice.message.model_dump()}
            for choice in response.choices
        ],
        "usage": response.usage.model_dump() if getattr(response, "usage", None) else None,
        "model": response.model,
    }
