"""Calls through litellm, by its public arguments: one request each, its own retries off.

litellm sends through a client over phyblock's HTTP client: its requests follow no redirect, are
read up to the same limit, and are sent once. Its settings, loggers and classes are not changed. It
takes seconds to import, so it is imported by the first call, and never by a run whose replies are
all cached, recorded or made by baselines. This is the only module that imports it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from phyblock.config.models import DIRECT_PROVIDERS, ModelConfig
from phyblock.errors import DataError, RefusedError, RetryableError, UnavailableError
from phyblock.models import client
from phyblock.models.client import Answer, Client, HttpClient
from phyblock.models.costs import map_entries
from phyblock.models.request import Request, wire_messages, wire_params
from phyblock.records.record import Reply, Usage

if TYPE_CHECKING:
    import httpx

_GRACE_S = 10.0
"""Time that litellm's own work may take beyond the exchange [s]."""

_MOST_ERROR_BYTES = 10_000
"""The part of an error's body that litellm gets, since it searches it for keys repeatedly."""

_WHILE_IMPORTED = {
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",  # else the import fetches the price map
    "LITELLM_MODE": "PRODUCTION",  # else the import reads keys from any .env file above
    "MAX_BASE64_LENGTH_FOR_LOGGING": "0",  # else a regex goes over every picture for its log
}
_OURS = ("accept-encoding", "connection", "content-length", "host", "transfer-encoding")
"""Headers that phyblock's HTTP client sets."""
_OWN_CLIENTS = (
    "aiohttp_openai", "amazon_nova", "cloudflare", "cohere", "cohere_chat", "maritalk", "nlp_cloud",
    "oobabooga", "petals", "predibase", "replicate",
)  # fmt: skip
"""Providers whose code in litellm sends with its own HTTP client. They can be used, but litellm
then decides about redirects, sizes and repeated requests."""


@dataclass
class _Exchange:
    """The traffic of one call: the last answer, or the reason why there is none."""

    http: HttpClient
    answer: Answer | None = None
    failure: Exception | None = None
    posted: set[str] = field(default_factory=set)


_CURRENT: ContextVar[_Exchange] = ContextVar("phyblock_exchange")


class LitellmClient(Client):
    """`litellm.acompletion`, for every provider it knows, over phyblock's HTTP client."""

    _sender: Any = None

    @cached_property
    def takes_seed(self) -> bool:
        """True if seeds are sent; by default if litellm knows that the provider accepts them."""
        if self.config.seed != "auto":
            return self.config.seed == "always"
        return "seed" in (_litellm().get_supported_openai_params(model=self.config.id) or ())

    async def _complete(self, request: Request, seed: int | None) -> Reply:
        config = self.config
        litellm = _litellm()
        if self._sender is None:
            self._sender = _sender(config)
        fields = {
            **wire_params(config, request),
            "model": config.id,
            "messages": wire_messages(request.messages, config.image_detail),
            "timeout": config.timeout_s,
            "num_retries": 0,
            "max_retries": 0,
            "client": self._sender,
            "no-log": True,
            "api_key": client.api_key(config),
            "api_base": config.api_base,
            "seed": seed,
        }
        given = {name: value for name, value in fields.items() if value is not None}
        exchange = _Exchange(self.http)
        token = _CURRENT.set(exchange)
        try:
            limit_s = config.timeout_s + _GRACE_S
            response = await asyncio.wait_for(litellm.acompletion(**given), limit_s)
        except TimeoutError:
            raise RetryableError("no answer in time", sent="maybe") from None
        except Exception as error:
            if exchange.failure is not None:
                raise exchange.failure from None
            answer = exchange.answer
            said = f"{type(error).__name__}: {str(error).partition('Traceback (most recent')[0]}"
            if answer is None and config.provider in _OWN_CLIENTS:
                status = getattr(error, "status_code", None) or 500
                raise client.error_of(Answer(status, {}, said.encode())) from None
            if answer is None:
                # A package, a credential or a setting is missing: every request would fail.
                raise UnavailableError(said, sent="no") from None
            if not answer.is_success:
                failure = client.error_of(answer)
                if isinstance(error, litellm.ContentPolicyViolationError):
                    failure = RefusedError(str(failure), status=answer.status)
                raise failure from None
            # litellm could not read what phyblock may.
            with contextlib.suppress(DataError):
                reply = client.read_raw_reply(client.read_json(answer), "")
                if reply.text:
                    return reply.model_copy(update={"usage": Usage()})
            raise client.malformed(answer.status, said) from None
        finally:
            _CURRENT.reset(token)
        status = exchange.answer.status if exchange.answer else 200
        return client.read_completion(response.model_dump(), status)


def _sender(config: ModelConfig) -> Any:
    """Return an OpenAI client that is also a handler of litellm, which accepts either."""
    import httpx
    import openai
    from litellm.llms.custom_httpx.http_handler import AsyncHTTPHandler

    class Wire(httpx.AsyncBaseTransport):
        """Sends each request once, and only to the model's server, through the exchange of the
        task; every failure is a ReadError, after which litellm does not retry.
        """

        async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
            exchange, url, method = _CURRENT.get(), str(request.url), request.method
            try:
                server = urlsplit(config.api_base or url)
                if urlsplit(url)[:2] != server[:2]:
                    host = urlsplit(url).hostname
                    why = f"nothing is sent to {host}, which is not the model's server"
                    raise UnavailableError(why, sent="no")
                if method == "POST" and url in exchange.posted:
                    why = "litellm would send the request twice"
                    raise exchange.failure or UnavailableError(why)
                exchange.posted.add(url)
                sent = {k: v for k, v in request.headers.items() if k not in _OURS}
                answer = await exchange.http.send(url, await request.aread(), sent, method=method)
                if answer.fault or answer.is_success:
                    client.read_json(answer)
            except Exception as failure:
                exchange.failure = failure
                # Its message may contain what litellm must not log.
                raise httpx.ReadError("the call failed", request=request) from None
            exchange.answer = answer
            unpacked = ("content-encoding", "content-length", "transfer-encoding")
            headers = [(k, v) for k, v in answer.headers.items() if k.lower() not in unpacked]
            body = answer.body if answer.is_success else answer.body[:_MOST_ERROR_BYTES]
            return httpx.Response(answer.status, headers=headers, content=body, request=request)

    http = httpx.AsyncClient(transport=Wire(), trust_env=False, follow_redirects=False)
    fields: dict[str, Any] = {"http_client": http, "max_retries": 0, "timeout": config.timeout_s}
    if config.provider == "azure":
        return openai.AsyncAzureOpenAI(
            api_key=client.api_key(config),
            azure_ad_token=os.environ.get("AZURE_AD_TOKEN"),
            azure_endpoint=config.api_base or "",
            api_version=os.environ.get("AZURE_API_VERSION") or _litellm().AZURE_DEFAULT_API_VERSION,
            **fields,
        )

    class Sender(AsyncHTTPHandler):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(timeout=config.timeout_s)
            self.client = http

        @cached_property
        def _sdk(self) -> Any:
            return openai.AsyncOpenAI(
                api_key=client.api_key(config), base_url=config.api_base, **fields
            )

        def __getattr__(self, name: str) -> Any:
            if name.startswith("__"):
                raise AttributeError(name)
            return getattr(self._sdk, name)

    return Sender()


@cache
def _litellm() -> Any:
    """Import litellm, and restore the environment afterwards."""
    before = {name: os.environ.pop(name, None) for name in _WHILE_IMPORTED}
    os.environ.update(_WHILE_IMPORTED)
    try:
        import litellm
    finally:
        for name in _WHILE_IMPORTED:
            del os.environ[name]
        os.environ.update({name: value for name, value in before.items() if value is not None})
    if _is_quiet:
        litellm.suppress_debug_info = True
        for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    return litellm


_is_quiet = False


def be_quiet() -> None:
    """Keep litellm from printing, in programs that are phyblock's own, such as its commands."""
    global _is_quiet
    _is_quiet = True


def known_providers(config: ModelConfig) -> frozenset[str]:
    """Return known providers; litellm is imported only if the model has none of the usual ones."""
    mapped = (str(entry.get("litellm_provider", "")) for entry in map_entries().values())
    usual = frozenset((*DIRECT_PROVIDERS, *client.KEYLESS, *filter(None, mapped)))
    if config.provider in usual:
        return usual
    return usual | {str(getattr(one, "value", one)) for one in _litellm().provider_list}
