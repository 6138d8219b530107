"""Calls through litellm: one request each, its own retries off. The only place that imports it.

litellm takes seconds to import, so it is imported by the first call and never by a run whose
replies are all cached, recorded or made by baselines.
"""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.completions import read_completion
from phyblock.models.keys import api_key
from phyblock.models.litellm_extras import leave_out, unlogged
from phyblock.models.payload import wire_messages
from phyblock.models.refusals import (
    refusal,
    refused_before_sending,
    refused_for_policy,
    refuses_seed,
    unreadable,
)
from phyblock.models.transport import Call, GuardedTransport, SeedRefusedError
from phyblock.records.reply import Reply

if TYPE_CHECKING:
    import types

    from phyblock.models.litellm_wire import Exchange

__all__ = ["LitellmTransport", "litellm_providers"]

_SETTINGS = {
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",  # else the import fetches the price map
    "MAX_BASE64_LENGTH_FOR_LOGGING": "0",  # else a regex goes over every picture for its log
    "LITELLM_MODE": "PRODUCTION",  # else the import reads keys from any .env file above
}
_OWN_CLIENTS = ("aiohttp_openai",)
"""Providers whose code in litellm opens connections of its own, past our client."""

_GRACE_S = 10.0
"""What litellm's own work may take beyond the time for the exchange, which ours keeps."""


class LitellmTransport(GuardedTransport):
    """`litellm.acompletion`, for every provider it knows, over our HTTP client."""

    async def _ask(self, call: Call) -> Reply:
        if self._config.provider in _OWN_CLIENTS:
            why = f"{self._config.provider} is not supported: use openai/..."
            raise UnavailableError(why, sent="no")
        litellm = _litellm()
        from phyblock.models.litellm_wire import CURRENT, Exchange

        arguments = self._arguments(call)
        exchange = Exchange(self._client, self._config)
        token = CURRENT.set(exchange)
        started = time.perf_counter()
        try:
            with unlogged():
                response = await asyncio.wait_for(
                    litellm.acompletion(**arguments), self._config.timeout_s + _GRACE_S
                )
            latency_s = time.perf_counter() - started
            return read_completion(_plain(response), latency_s, exchange.answered().status)
        except ModelError:
            raise
        except TimeoutError:
            raise RetryableError("no answer in time") from None
        except Exception as error:
            raise self._failure(call, error, exchange) from None
        finally:
            exchange.end()
            CURRENT.reset(token)

    def _arguments(self, call: Call) -> dict[str, Any]:
        arguments = {
            **call.params,
            "model": self._config.id,
            "messages": wire_messages(call.messages, self._config.image_detail),
            "timeout": self._config.timeout_s,
            "num_retries": 0,
            "max_retries": 0,
            "no-log": True,
        }
        key = api_key(self._config)
        optional = {"api_key": key, "api_base": self._config.api_base, "seed": call.seed}
        return arguments | {name: value for name, value in optional.items() if value is not None}

    def _failure(
        self, call: Call, error: Exception, exchange: Exchange
    ) -> ModelError | SeedRefusedError:
        """The error of a call that litellm gave up, by what was on the wire.

        litellm gives whatever went wrong a class of its own, which says less; but it knows more of
        the words by which providers refuse for their policy.
        """
        litellm, answer = _litellm(), exchange.answer
        if exchange.failure is not None:
            return exchange.failure
        if answer is None:
            is_unsupported = isinstance(error, litellm.UnsupportedParamsError)
            if is_unsupported and call.seed is not None and refuses_seed(400, str(error)):
                return SeedRefusedError(sent=False)
            said = [_message(error), exchange.refused]
            return refused_before_sending("; ".join(filter(None, said)))
        if answer.is_success:
            return unreadable(answer, _message(error))
        if isinstance(error, litellm.ContentPolicyViolationError):
            return refused_for_policy(answer)
        refused = refusal(answer)
        if call.seed is not None and refuses_seed(answer.status, str(refused)):
            return SeedRefusedError(sent=True)
        return refused


def _message(error: Exception) -> str:
    """What litellm says, without the traceback that it puts into some messages."""
    text = str(error).partition("Traceback (most recent call last)")[0]
    return f"{type(error).__name__}: {text}"


def _litellm() -> types.ModuleType:
    """litellm, imported with its network access, key files, chatter and second requests off."""
    os.environ.update(_SETTINGS)
    import litellm

    if not litellm.suppress_debug_info:
        litellm.suppress_debug_info = True
        litellm.telemetry = False
        litellm.drop_params = False
        for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        from phyblock.models.litellm_wire import CURRENT, install

        install()
        leave_out(litellm, lambda: CURRENT.get() is not None)
        # The import made clients of its own, which calls with its usual timeout would be given.
        litellm.in_memory_llm_clients_cache.flush_cache()
    module: types.ModuleType = litellm
    return module


def litellm_providers() -> frozenset[str]:
    """The names of all providers that litellm knows."""
    return frozenset(str(getattr(one, "value", one)) for one in _litellm().provider_list)


def _plain(response: Any) -> Mapping[str, object]:
    """The parts of litellm's response that a reply is made of."""
    return {
        "choices": [
            {
                "finish_reason": choice.finish_reason,
                "message": choice.message.model_dump(warnings=False),
            }
            for choice in response.choices
        ],
        "usage": response.usage.model_dump(warnings=False)
        if getattr(response, "usage", None)
        else None,
        "model": response.model,
    }
