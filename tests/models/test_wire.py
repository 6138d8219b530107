"""Calls over a real wire, through both transports and all protocols: what arrives at the server,
and what comes of each way in which it can end a call.
"""

import asyncio
import contextlib
import json
import socket
import time
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock import errors
from phyblock.config.models import ModelConfig
from phyblock.config.suite import Suite
from phyblock.errors import RetryableError, SampleError, UnavailableError
from phyblock.models import client
from phyblock.models.client import shown
from phyblock.models.model import RetryPolicy
from phyblock.models.request import Image, Message, json_body, wire_messages
from phyblock.parsing.answer import choice_form, move_form
from phyblock.parsing.plan import plan_form
from phyblock.records.record import Reply
from phyblock.run.plan import to_config
from tests.models import factory
from tests.models.factory import QUICK, ROUTES, ask, make_model, make_request, picture
from tests.servers.chassis import FAULTS, Faults, Running
from tests.servers.faults import WIRE_FAULTS
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import KEY

OPENAI = ("direct", "openai", "vllm")
ONCE = RetryPolicy(attempts=1, retry_for_s=0.0, base_s=0.0, max_retry_after_s=0.0)
LOCAL = {"api_base": "http://localhost:8000/v1"}
SNAPSHOT = {"id": "openai/gpt-4o-2024-08-06"}
GATEWAYS = [replace(ROUTES["vllm"], model_id=f"{name}/m") for name in ("xai", "openrouter")]
texts = st.text(max_size=30)
images = st.builds(
    lambda magic, tail: Image(magic + tail, "goal", 8, 8),
    st.sampled_from([factory.PNG, factory.JPEG, b"GIF89a", b"RIFF0000WEBP"]),
    st.binary(max_size=40),
)
messages = st.builds(
    Message,
    st.sampled_from(["system", "user", "assistant"]),
    st.lists(texts | images, min_size=1, max_size=5).map(tuple),
)


class Wire:
    """One server for each route, which forgets what was before whenever a test asks."""

    def __init__(self, running):
        self._running = running

    def at(self, route, faults=None):
        """Return the server of a route, as new, and its address."""
        running = self._running[route]
        running.server.forget(faults)
        return running.server, running.url

    def ask(self, route, *requests, faults=None, policy=QUICK, **fields):
        """Ask a new model one request after another: its answers, the server, the events."""
        (server, url), events = self.at(route, faults), []
        config = ROUTES[route].config(url, **{"max_concurrency": 1, **fields})
        model = make_model(config, events=events, policy=policy)
        return ask(model, *(requests or [make_request("001", 1)])), server, events

    def arrived(self, route, request, **fields):
        (answer,), server, _ = self.ask(route, request, **fields)
        assert isinstance(answer, Reply), answer
        return server.seen[0]


@pytest.fixture(scope="module")
def wire():
    with contextlib.ExitStack() as stack:
        yield Wire({n: stack.enter_context(Running(r.server())) for n, r in ROUTES.items()})


# What arrives.


@pytest.mark.parametrize("route", ROUTES)
def test_a_request_arrives_in_order_byte_for_byte_and_nothing_else(wire, route):
    pictures = (picture(1, factory.PNG, 150_000), picture(2, factory.JPEG, 90_000))
    request = make_request("017", 42, pictures=pictures)
    parts = list(request.messages[1].parts)
    parts[1] = ("image/png", parts[1].sha256)
    parts[3] = ("image/jpeg", parts[3].sha256)
    longest = "max_output_tokens" if route == "gemini" else "max_tokens"
    params = {"temperature": 0.5, "top_p": 0.9, longest: 128}
    seen = wire.arrived(route, request)
    assert (seen.system, seen.parts, seen.params, seen.seed) == (
        "You assemble blocks.", tuple(parts), params, None if route == "anthropic" else 42
    )  # fmt: skip


@pytest.mark.parametrize(
    "extra",
    [
        {},
        {"extra_body": {"top_k": 20, "chat_template_kwargs": {"enable_thinking": False}}},
        {"stop": ["END"], "presence_penalty": 0.5},
        {"temperature": None, "top_p": None},
    ],
)
def test_both_transports_put_the_same_json_on_the_wire(wire, extra):
    request = make_request("017", 42, **extra)
    direct, through_litellm = (wire.arrived(route, request).raw for route in ("direct", "openai"))
    assert direct == through_litellm
    assert direct["seed"] == 42
    assert ("temperature" in direct) == (extra.get("temperature", 0) is not None)


@pytest.mark.parametrize("route", ["direct", "openai"])
def test_thoughts_left_in_the_text_become_reasoning(route):
    text = "<think>\nred first\n</think>\n\nStep1: Move block with index 3"
    with Running(OpenAIChat(say=lambda _: text, think=lambda _: None)) as running:
        (reply,) = ask(make_model(ROUTES[route].config(running.url)), make_request())
    read = (reply.text.strip(), reply.reasoning.strip())
    assert read == ("Step1: Move block with index 3", "red first")


def looked_at(seen):
    """Return the detail that a request asks for, picture by picture or as a whole."""
    if "contents" in seen.raw:
        whole = seen.params.get("mediaResolution")
        parts = [part for content in seen.raw["contents"] for part in content["parts"]]
        return [part.get("media_resolution", whole) for part in parts if "text" not in part]
    content = seen.raw["messages"][-1]["content"]
    return [p["image_url"].get("detail") for p in content if p["type"] == "image_url"]


@pytest.mark.parametrize(
    ("route", "model_id", "detail", "arrives"),
    [
        ("direct", "openai/m", "low", "low"),
        ("openai", "openai/m", "original", "original"),
        ("vllm", "hosted_vllm/m", "high", "high"),
        ("gemini", "gemini/gemini-3.8-flash", "medium", {"level": "MEDIA_RESOLUTION_MEDIUM"}),
        ("gemini", "gemini/gemini-2.5-flash", "low", "MEDIA_RESOLUTION_LOW"),
        ("direct", "openai/m", None, None),
        ("gemini", "gemini/gemini-3.8-flash", None, None),
    ],
)
def test_the_detail_arrives_in_the_words_of_the_provider(wire, route, model_id, detail, arrives):
    # litellm refuses the sampling parameters that models of today do not take.
    request = replace(make_request(), params={})
    seen = wire.arrived(route, request, id=model_id, image_detail=detail)
    assert looked_at(seen) == [arrives, arrives]


@settings(max_examples=200)
@given(
    st.lists(messages, max_size=4).map(tuple),
    st.dictionaries(texts, texts, max_size=3),
    st.sampled_from([None, "low", "high"]),
)
def test_a_body_made_around_the_encoder_says_what_the_encoder_would(content, fields, detail):
    expected = {**fields, "messages": wire_messages(content, detail)}
    request = replace(make_request(pictures=(b"", b"")), messages=content)
    assert json.loads(json_body(fields, request, detail)) == expected


def test_only_pictures_are_sent_as_pictures():
    request = make_request(pictures=(b"<html>", picture(1)))
    with pytest.raises(errors.DataError, match=r"'goal'.*is not a picture"):
        wire_messages(request.messages, None)


@pytest.mark.slow
@pytest.mark.parametrize("form", [plan_form(16), move_form(16), choice_form("abcd", True)])
def test_litellm_hands_every_schema_on(wire, form):
    asked = replace(make_request("017", 42), response_format=form.response_format)
    arrived = partial(wire.arrived, request=asked, response_format="always")
    direct = arrived("direct").raw
    assert [arrived(route).raw for route in ("openai", "vllm")] == [direct, direct]
    gemini = arrived("gemini").params
    assert gemini["response_mime_type"] == "application/json"
    assert form.key in json.dumps(gemini["response_json_schema"])
    claude = arrived("anthropic").params
    assert claude["tools"][0]["input_schema"]["properties"] == form.schema["properties"]


@pytest.mark.parametrize(
    ("fields", "sends"),
    [
        (SNAPSHOT, True),
        (SNAPSHOT | {"response_format": "never"}, False),
        (LOCAL | {"id": "hosted_vllm/Qwen/Qwen3-VL-8B-Instruct"}, True),
        (LOCAL | {"id": "openai/mine"}, True),
        ({"id": "openai/mine"}, False),
        ({"id": "dashscope/qwen-vl-max"}, False),
        ({"id": "dashscope/qwen-vl-max", "response_format": "always"}, True),
    ],
)
def test_who_is_sent_a_schema(fields, sends):
    spec = ModelConfig.model_validate(fields)
    for asked, is_sent in (("json_schema", sends), ("text", False)):
        suite = Suite(name="s", models=("m",), answer_format=asked)
        assert (to_config("m", spec, suite).response_format == "always") is is_sent


@pytest.mark.parametrize(
    ("model_id", "fields", "is_direct"),
    [
        ("openai/m", LOCAL, True),
        ("hosted_vllm/m", LOCAL, True),
        ("openai/m", {}, False),
        ("openai/o1", LOCAL, False),
        ("anthropic/c", LOCAL, False),
        ("anthropic/c", LOCAL | {"transport": "direct"}, True),
        ("openai/m", LOCAL | {"transport": "litellm"}, False),
    ],
)
def test_the_transport_is_chosen_by_rule(model_id, fields, is_direct):
    assert ModelConfig(name="m", id=model_id, **fields).is_direct == is_direct


# What comes of it.

ALL = tuple(ROUTES)
ENDS = {
    **dict.fromkeys(FAULTS, (RetryableError, QUICK.attempts, ALL)),
    **dict.fromkeys(("401", "403", "404"), (UnavailableError, 1, ALL)),
    "400": (SampleError, 3, ALL),
    "policy": (errors.RefusedError, 3, (*OPENAI, "anthropic")),
    "quota": (UnavailableError, 1, OPENAI),
    **dict.fromkeys(("ok", "length", "filtered"), (Reply, 3, ALL)),
}
"""By mode: the outcome, requests of three questions (of one that is retried), and the routes."""
CELLS = [(route, mode) for mode, (_, _, routes) in ENDS.items() for route in routes]


@pytest.mark.parametrize(("route", "mode"), CELLS)
def test_a_call_ends_as_the_server_ends_it(wire, route, mode):
    kind, requests, _ = ENDS[mode]
    seeds = (1,) if kind is RetryableError else (1, 2, 3)
    asked = [make_request("001", seed) for seed in seeds]
    answers, server, events = wire.ask(route, *asked, faults=Faults(mode=mode), seed="never")
    assert {type(answer) for answer in answers} == {kind}, answers
    assert server.requests == requests
    retries = requests - 1 if kind is RetryableError else 0
    assert [event.kind for event in events] == ["retry"] * retries
    if mode.startswith("4") and kind is UnavailableError:
        assert {answer.status for answer in answers} == {int(mode)}
    if kind is Reply:
        finish = {"ok": "stop", "filtered": "refusal"}.get(mode, mode)
        text = server.seen[0].reply_text if mode == "ok" else ""
        read = {(one.finish, one.text, one.usage.prompt_tokens) for one in answers}
        assert read == {(finish, text, 1000)}
        assert mode != "ok" or {answer.reasoning for answer in answers} == {"Let me see."}
        assert {(answer.attempts, answer.seed_sent) for answer in answers} == {(1, False)}
        assert {seen.seed for seen in server.seen} == {None}


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("wish", ["7", "Wed, 21 Oct 2099 07:28:00 GMT", "nan"])
def test_retry_after_is_read_as_seconds_and_as_a_date(wire, route, wish):
    faults = Faults(mode="429", retry_after=wish)
    (answer,), _, _ = wire.ask(route, faults=faults, policy=ONCE)
    until_s = datetime(2099, 10, 21, 7, 28, tzinfo=UTC).timestamp()
    seconds = {"7": 7, "nan": None}.get(wish, pytest.approx(until_s - time.time(), abs=60))
    assert (type(answer), answer.retry_after_s) == (RetryableError, seconds)


@pytest.mark.parametrize("route", [*OPENAI, "gemini"])
def test_a_refused_seed_is_an_error_that_names_it(wire, route):
    (answer,), _, _ = wire.ask(route, faults=Faults(mode="seed"))
    assert (type(answer), "seed" in str(answer)) == (SampleError, True)
    (answer,), _, _ = wire.ask(route, faults=Faults(mode="seed"), seed="never")
    assert (answer.seed_sent, answer.attempts) == (False, 1)


def test_where_no_seed_exists_none_is_sent_unless_it_must_be(wire):
    (answer,), _, _ = wire.ask("anthropic")
    assert not answer.seed_sent
    (answer,), server, _ = wire.ask("anthropic", seed="always")
    assert (type(answer), server.requests) == (UnavailableError, 0)


@pytest.mark.parametrize("route", ROUTES)
def test_a_server_that_never_answers_is_a_timeout(wire, route):
    policy, faults = replace(QUICK, attempts=2), Faults(mode="slow")
    (answer,), server, _ = wire.ask(route, faults=faults, policy=policy, timeout_s=0.3)
    found = (type(answer), answer.status, server.requests)
    assert found == (RetryableError, None, policy.attempts)


def test_keys_leave_an_error_before_it_is_cut():
    for length in range(440, 520):
        text = shown(f"{'x' * length}{KEY} and more", (KEY,))
        assert len(text) <= 500
        assert KEY[:4] not in text


# Every named fault of a server.

SERVERS_WORDS = {
    "200-quota": "You exceeded your current quota",
    "400-string": "Invalid value for messages",
    "401-string": "Unauthorized",
    "429-bare": "Too many requests",
    "503": "Overloaded",
    "redirect-nowhere": "it redirects, and no redirect is followed",
    **dict.fromkeys(("200-code-401", "200-code-401-number"), "No auth credentials found"),
    **{
        f"200-{name}": "Upstream is down"
        for name in ("code-429", "code-500", "code-object", "message-object", "code-huge")
    },
    "200-error-string": "Upstream is down",
}
"""Words of the error, by fault."""
ENDINGS = {"reply": Reply, "sample": SampleError}
ENDINGS |= {"retryable": RetryableError, "unavailable": UnavailableError}
AS_LITELLM_READS = {
    **dict.fromkeys((name, "usage-true") for name in ("openai", "vllm", "anthropic", "gemini")),
    **dict.fromkeys(("anthropic", mode) for mode in ("usage-huge", "usage-fraction")),
}
"""Counts that are none and that litellm takes for some: what it makes of them is what is known."""


def answers_to(route, server, url, faults):
    """Return what comes of each fault, met one after another; each costs one request. One model
    meets them all, as long as it is not stopped: no fault spoils what comes after it.
    """

    def new(timeout_s):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(client, "LARGEST_REPLY_BYTES", 2**20)
            asked = route.config(url, seed="never", timeout_s=timeout_s)
            return make_model(asked, policy=ONCE)

    async def all_of_them():
        found = {}
        model, hasty = new(20.0), new(0.7)
        for mode in faults:
            server.faults = Faults(mode=mode)
            try:
                found[mode] = await (hasty if mode == "drip" else model).ask(make_request())
            except errors.ModelError as error:
                found[mode] = error
            if isinstance(found[mode], UnavailableError):
                await model.aclose()
                model = new(20.0)
        await model.aclose()
        await hasty.aclose()
        return found

    return asyncio.run(all_of_them())


@pytest.mark.parametrize("name", ROUTES)
def test_every_fault_ends_as_it_must_after_one_request(wire, name):
    server, url = wire.at(name)
    answers = answers_to(ROUTES[name], server, url, list(WIRE_FAULTS))
    for mode, answer in answers.items():
        assert isinstance(answer, ENDINGS[WIRE_FAULTS[mode].ending]), (mode, answer)
        assert server.ended[mode] == 1, mode
        assert KEY[:8] not in str(answer) + repr(answer), mode
        if name != "anthropic" and mode in SERVERS_WORDS:
            # Whichever transport it came through.
            assert SERVERS_WORDS[mode] in str(answer), mode
        if mode.startswith("usage-") and (name, mode) not in AS_LITELLM_READS:
            usage = answer.usage
            counts = (usage.prompt_tokens, usage.completion_tokens, usage.reasoning_tokens)
            assert counts == (None, None, None), mode
    whole, surrogate, echo = (answers[m] for m in ("gzip", "surrogate", "echo-key-in-reply"))
    assert (whole.usage.prompt_tokens, whole.usage.completion_tokens) == (1000, 40)
    assert surrogate.text == "Step1: \ufffd index 1"
    assert all("[key]" in text for text in (echo.text, echo.provider_model))


@pytest.mark.parametrize("route", [*ROUTES.values(), *GATEWAYS], ids=lambda route: route.model_id)
def test_a_redirect_takes_nothing_anywhere(route):
    away = OpenAIChat()
    with Running(away) as elsewhere:
        there = elsewhere.url.replace("127.0.0.1", "localhost")
        with Running(route.server(elsewhere=there)) as running:
            modes = [mode for mode in WIRE_FAULTS if mode.startswith("redirect")]
            answers = answers_to(route, running.server, running.url, modes)
    assert away.requests == 0
    assert running.server.ended == dict.fromkeys(modes, 1)
    for mode, answer in answers.items():
        assert isinstance(answer, UnavailableError), mode
        assert "it redirects, and no redirect is followed" in str(answer)
        assert "is api_base the address" in str(answer)
        assert "h1dden" not in str(answer)


def unreachable(name, url, **fields):
    """Return what is said of a server that no connection can be made to."""
    config = ROUTES[name].config(url, seed="never", **fields)
    (answer,) = ask(make_model(config, policy=ONCE), make_request())
    assert (type(answer), answer.sent, answer.status) == (RetryableError, "no", None), answer
    return str(answer)


@pytest.mark.parametrize("name", ["direct", "openai", "vllm", "anthropic"])
def test_an_unknown_name_a_closed_port_and_a_server_without_tls_are_named(wire, name):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        closed = f"http://127.0.0.1:{taken.getsockname()[1]}"
        without_tls = wire.at("direct")[1].replace("http://", "https://")
        for url in ("http://no-such-host.invalid", closed, without_tls):
            assert f"no connection to {url.partition('//')[2]}" in unreachable(name, url)


def test_a_connection_that_is_not_made_in_time_was_not_sent():
    with socket.socket() as full, contextlib.ExitStack() as stack:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        for _ in range(4):
            other = stack.enter_context(socket.socket())
            other.setblocking(False)
            other.connect_ex(full.getsockname())
        url = f"http://127.0.0.1:{full.getsockname()[1]}"
        assert "no connection to 127.0.0.1" in unreachable("direct", url, timeout_s=0.6)
