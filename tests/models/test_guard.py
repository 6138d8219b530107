"""Nothing comes out of a transport but replies and errors of ours; litellm sends through ours."""

from __future__ import annotations

import asyncio
import importlib
import json

import pytest

from phyblock.config.models import ModelConfig
from phyblock.errors import DataError, ModelError, Problem, RetryableError, UnavailableError
from phyblock.models import Reply, RetryPolicy
from phyblock.models.http_client import Answer
from phyblock.models.litellm_call import _litellm
from phyblock.models.litellm_extras import leave_out
from phyblock.models.refusals import read_body
from phyblock.models.transport import Call, GuardedTransport, SeedRefusedError
from tests.models.factory import ask, make_model, make_request, run, with_fields
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat

KEY = "not-4-key-anybody-has"
CONFIG = ModelConfig(name="m", id="openai/m", api_base="http://127.0.0.1:9/v1")
CALL = Call((), {}, None)


class Failing(GuardedTransport):
    """Raises what it was given."""

    def __init__(self, error: BaseException) -> None:
        super().__init__(CONFIG, (KEY,))
        self._error = error

    async def _ask(self, _: Call) -> Reply:
        raise self._error


class Nested(GuardedTransport):
    """Recurses without end, as a decoder may."""

    async def _ask(self, call: Call) -> Reply:
        return await self._ask(call)


@pytest.mark.parametrize(
    "error",
    [
        TypeError(f"not a {KEY}"),
        KeyError(KEY),
        ValueError(KEY),
        OSError(5, KEY),
        RecursionError(),
        MemoryError(),
        UnicodeDecodeError("utf-8", KEY.encode(), 0, 1, KEY),
        StopAsyncIteration(),
        TimeoutError(),
    ],
    ids=lambda error: type(error).__name__,
)
def test_whatever_is_raised_below_is_a_failed_call(error: Exception) -> None:
    with pytest.raises(RetryableError, match=type(error).__name__) as caught:
        run(lambda: Failing(error).send(CALL))
    assert caught.value.status is None
    assert KEY not in str(caught.value)


def test_endless_recursion_is_a_failed_call() -> None:
    with pytest.raises(RetryableError, match="RecursionError"):
        run(lambda: Nested(CONFIG, ()).send(CALL))


@pytest.mark.parametrize(
    "error", [SeedRefusedError(sent=True), DataError(Problem("picture", "is no picture"))]
)
def test_what_we_raise_on_purpose_passes(error: Exception) -> None:
    with pytest.raises(type(error)) as caught:
        run(lambda: Failing(error).send(CALL))
    assert caught.value is error


@pytest.mark.parametrize("error", [asyncio.CancelledError(), KeyboardInterrupt(), SystemExit(3)])
def test_what_stops_the_process_passes(error: BaseException) -> None:
    async def main() -> None:
        with pytest.raises(type(error)):
            await Failing(error).send(CALL)

    asyncio.run(main())


def test_keys_leave_an_error_before_it_is_cut() -> None:
    for length in range(440, 520):
        error = UnavailableError(f"{'x' * length}{KEY} and more", status=401)
        with pytest.raises(ModelError) as caught:
            run(lambda error=error: Failing(error).send(CALL))  # type: ignore[misc]
        assert len(str(caught.value)) <= 500
        assert KEY[:4] not in str(caught.value)


@pytest.mark.parametrize("params", [{"tools": 5}, {"extra_headers": 7}])
def test_arguments_that_litellm_chokes_on_end_a_call_and_no_run(
    params: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    with Running(OpenAIChat()) as running:
        config = ROUTES["openai"].config(running.url, extra_body=params)
        (answer,) = ask(make_model(config, policy=RetryPolicy(1, 0.0)), make_request())
    assert isinstance(answer, ModelError | Reply), answer


def test_a_provider_that_litellm_would_call_past_our_client_is_refused() -> None:
    config = ModelConfig(name="m", id="aiohttp_openai/m", api_base="http://127.0.0.1:9/v1")
    (answer,) = ask(make_model(config), make_request())
    assert isinstance(answer, UnavailableError), answer


def test_every_client_that_litellm_makes_sends_through_ours() -> None:
    """Holds what `litellm_wire.install` relies on; a new litellm that differs fails here."""
    _litellm()
    from litellm.llms.custom_httpx.http_handler import (
        AsyncHTTPHandler,
        HTTPHandler,
        get_async_httpx_client,
    )
    from litellm.llms.openai.common_utils import BaseOpenAILLM
    from litellm.types.utils import LlmProviders

    from phyblock.models.litellm_wire import WireTransport

    for client in (
        AsyncHTTPHandler().client,
        AsyncHTTPHandler(ssl_verify=False, timeout=1.0).client,
        get_async_httpx_client(LlmProviders.ANTHROPIC).client,
        BaseOpenAILLM._get_async_http_client(),
    ):
        assert client is not None
        assert isinstance(client._transport, WireTransport)
        assert not client._mounts
    assert not HTTPHandler().client.follow_redirects


def test_nothing_is_sent_outside_of_a_call_and_nothing_twice() -> None:
    _litellm()
    import httpx

    from phyblock.models.http_client import HttpClient
    from phyblock.models.litellm_wire import CURRENT, Exchange, WireTransport

    server = OpenAIChat()

    async def main() -> None:
        url = f"{running.url}/v1/chat/completions"
        body = {"model": "m", "messages": [{"role": "user", "content": "?"}]}
        client = httpx.AsyncClient(transport=WireTransport(True), trust_env=False)
        with pytest.raises(httpx.ReadError, match="outside of a call"):
            await client.post(url, json=body)
        config = with_fields(CONFIG, api_base=url)
        ours = HttpClient(config)
        CURRENT.set(Exchange(ours, config))
        assert (await client.post(url, json=body)).status_code == 200
        with pytest.raises(RuntimeError, match="twice"):
            await client.post(url, json=body)
        await client.aclose()
        await ours.aclose()

    with Running(server) as running:
        run(main)
    assert server.requests == 1


@pytest.mark.parametrize("code", [429, "429", 502, "529"])
def test_what_passes_and_is_told_with_a_success_is_what_its_code_says(code: object) -> None:
    """A limit that is reached, and faults behind a gateway: none is a reply that was paid for."""
    body = json.dumps({"error": {"message": "slow down", "code": code}}).encode()
    with pytest.raises(RetryableError, match="slow down") as told:
        read_body(Answer(200, {"Retry-After": "7"}, body))
    assert (told.value.status, told.value.retry_after_s) == (int(str(code)), 7)


def test_what_is_left_out_is_left_out_of_our_calls_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Holds what `litellm_extras` relies on; a new litellm that differs fails here."""
    monkeypatch.setenv(KEY_VARIABLE, KEY)
    litellm = _litellm()
    heard: list[object] = []
    litellm._async_success_callback.append(lambda *_: heard.append("success"))
    costs: list[object] = []
    calculate = litellm.response_cost_calculator
    monkeypatch.setattr(
        litellm, "response_cost_calculator", lambda **k: costs.append(calculate(**k)) or costs[-1]
    )

    async def another() -> object:
        message = {"role": "user", "content": "?"}
        answer = await litellm.acompletion("gpt-4o", [message], mock_response="Hello")
        await asyncio.sleep(0.2)
        return answer._hidden_params["response_cost"]

    async def ours() -> Reply:
        model = make_model(ROUTES["openai"].config(running.url))
        try:
            return await model.ask(make_request())
        finally:
            await model.aclose()

    async def one_task() -> object:
        await ours()
        assert (set(costs), heard) == ({None}, [])
        return await another()

    try:
        with Running(OpenAIChat()) as running:
            cost = run(one_task)
    finally:
        litellm._async_success_callback.pop()
    assert isinstance(cost, float)
    assert cost > 0
    assert heard


def test_a_request_is_the_same_without_the_search_for_fields_to_rename() -> None:
    _litellm()
    from phyblock.models.http_client import HttpClient
    from phyblock.models.litellm_wire import CURRENT, Exchange

    chats = importlib.import_module("openai.resources.chat.completions.completions")
    form = importlib.import_module("openai.types.chat.completion_create_params")
    schema = {"type": "object", "properties": {"plan": {"type": "array"}}, "required": ["plan"]}
    picture = {"url": "data:image/png;base64,iVBORw0KGgo=", "detail": "high"}
    body = {
        "model": "m",
        "messages": [
            {"role": "system", "content": "Plan."},
            {
                "role": "user",
                "content": [
                    {"type": "text", "text": "?"},
                    {"type": "image_url", "image_url": picture},
                ],
            },
        ],
        "temperature": 0.0,
        "seed": 3,
        "stop": None,
        "tools": importlib.import_module("openai").NOT_GIVEN,
        "response_format": {
            "type": "json_schema",
            "json_schema": {"name": "plan", "strict": True, "schema": schema},
        },
    }

    async def renamed(is_ours: bool) -> str:
        token = CURRENT.set(Exchange(HttpClient(CONFIG), CONFIG) if is_ours else None)
        try:
            kind = form.CompletionCreateParamsNonStreaming
            return json.dumps(await chats.async_maybe_transform(body, kind))
        finally:
            CURRENT.reset(token)

    assert run(lambda: renamed(True)) == run(lambda: renamed(False))
    assert chats.async_maybe_transform.__module__ == leave_out.__module__
