"""Prices by day, by length of the prompt, in batches, and of what a prompt cache holds."""

from __future__ import annotations

from datetime import date, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.models import (
    Estimate,
    Price,
    Prices,
    Rate,
    Reply,
    Tariff,
    Usage,
    ends_on,
    is_unlisted,
    most_usd,
    prices_of,
    reply_cost_usd,
)
from phyblock.models.costs import counted, map_entry
from tests.models.factory import make_model, make_request, reply_of, with_fields
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.anthropic_messages import AnthropicMessages
from tests.servers.chassis import LocalServer, Running, Seen
from tests.servers.gemini_generate import GeminiGenerate
from tests.servers.openai_chat import OpenAIChat

DAY = date(2026, 11, 22)

usd = st.floats(0, 100)
prices = st.builds(Price, usd, usd, st.none() | usd, st.none() | usd)


def config(model_id: str, **fields: Any) -> ModelConfig:
    return ModelConfig(name="m", id=model_id, **fields)


@given(
    prices,
    st.integers(0, 10**6),
    st.integers(0, 10**6),
    st.integers(0, 10**6),
    st.integers(0, 10**9),
)
def test_each_prompt_token_is_paid_once(
    price: Price, fresh: int, cached: int, written: int, out: int
) -> None:
    usage = Usage(
        prompt_tokens=fresh + cached + written,
        completion_tokens=out,
        reasoning_tokens=None,
        cached_tokens=cached,
        cache_write_tokens=written,
    )
    read_usd = price.input_usd if price.cached_usd is None else price.cached_usd
    write_usd = price.input_usd if price.cache_write_usd is None else price.cache_write_usd
    paid = fresh * price.input_usd + cached * read_usd + written * write_usd
    cost = price.cost(usage)
    assert cost == pytest.approx((paid + out * price.output_usd) / 1e6)
    half = price.halved().cost(usage)
    assert half == pytest.approx(cost / 2)


@given(
    st.lists(st.tuples(st.integers(1, 300_000), prices), max_size=3, unique_by=lambda t: t[0]),
    prices,
    st.integers(0, 400_000),
    st.booleans(),
)
def test_the_highest_tier_below_the_prompt_holds(
    tiers: list[tuple[int, Price]], base: Price, prompt: int, batched: bool
) -> None:
    rates = (Rate(base), *(Rate(p, above) for above, p in sorted(tiers, key=lambda t: t[0])))
    known = Prices((Tariff(rates),))
    below = [rate for rate in rates if rate.above_tokens < prompt] or [rates[0]]
    assert known.at(DAY, prompt, batched=batched) == below[-1].price


@pytest.mark.parametrize(
    ("model_id", "fields", "is_half"),
    [
        ("openai/mine", {}, True),
        ("openai/mine", {"api_base": "https://api.openai.com/v1"}, True),
        ("openai/mine", {"api_base": "https://gateway.example/v1"}, False),
        ("hosted_vllm/mine", {"api_base": "http://localhost:8000/v1"}, False),
        ("anthropic/mine", {"api_base": "https://gateway.example"}, False),
        ("gemini/mine", {}, True),
    ],
)
def test_batches_cost_half_only_where_that_is_known(
    model_id: str, fields: dict[str, Any], is_half: bool
) -> None:
    whole = Price(8.0, 40.0, 1.0)
    served = config(model_id, batch=True, **fields)
    known = prices_of(with_fields(served, price={"input": 8, "output": 40, "cached": 1}))
    assert known is not None
    assert known.at(DAY, batched=True) == (whole.halved() if is_half else whole)
    expected = Estimate(1000, 500, 500)
    most = [most_usd(known, expected, DAY, batched=batched) for batched in (True, False)]
    assert most[0] == pytest.approx(most[1] / (1 + is_half))
    batch = {"input": 3, "output": 4}
    told = {"input": 8, "output": 40, "cached": 1, "batch": batch}
    own = prices_of(with_fields(served, price=told))
    assert own is not None
    assert own.at(DAY, batched=True) == Price(3.0, 4.0)


@given(
    st.lists(st.integers(0, 400), min_size=1, max_size=4, unique=True),
    st.integers(-9, 410),
    st.booleans(),
)
def test_the_price_of_a_day_is_the_last_that_has_begun(
    begins: list[int], asked: int, is_mapped: bool
) -> None:
    days = [DAY + timedelta(days=n) for n in sorted(begins)]
    told = [{"from": one, "input": float(n), "output": 0} for n, one in enumerate(days, start=1)]
    model_id = "azure/gpt-4o-2024-08-06" if is_mapped else "azure/mine"
    known, mapped = prices_of(config(model_id, price=told)), prices_of(config(model_id))
    day = DAY + timedelta(days=asked)
    begun = [price["input"] for price in told if price["from"] <= day]  # type: ignore[operator]
    assert known is not None
    assert (mapped is not None) == is_mapped
    if begun:
        assert known.at(day) == Price(begun[-1], 0)  # type: ignore[arg-type]
    else:
        assert known.at(day) == (mapped and mapped.at(day))


@given(prices, st.integers(0, 10**6), st.integers(0, 10**5), st.data())
def test_no_call_costs_more_than_the_most(
    price: Price, prompt: int, completion: int, data: st.DataObject
) -> None:
    batched = data.draw(st.booleans())
    days = [DAY + timedelta(days=n) for n in range(3 if batched else 2)]
    dearer = Tariff((Rate(price), Rate(Price(50.0, 60.0), 100_000)), days[-1])
    both = Prices((Tariff((Rate(price),)), dearer))
    most = most_usd(both, Estimate(prompt, 1, completion), DAY, batched=batched)
    written = data.draw(st.integers(0, prompt))
    usage = Usage(
        prompt_tokens=prompt,
        completion_tokens=completion,
        reasoning_tokens=None,
        cached_tokens=0,
        cache_write_tokens=written,
    )
    for day in days:
        cost = reply_cost_usd(both, Reply(text="a", usage=usage, batched=batched), day)
        assert cost is not None
        assert cost <= most * (1 + 1e-9)


@pytest.mark.parametrize(
    ("model_id", "prompt", "names"),
    [
        ("gemini/gemini-2.5-pro", 200_000, ("", "")),
        ("gemini/gemini-2.5-pro", 200_001, ("_above_200k_tokens", "")),
        ("openai/gpt-5.6", 300_000, ("_above_272k_tokens", "_batches")),
        ("anthropic/claude-haiku-5-5", 100_001, ("_above_100k_tokens", "_batches")),
        ("xai/grok-4.7", 10, ("", "")),
    ],
)
def test_tiers_batches_and_caches_are_priced_as_the_map_says(
    model_id: str, prompt: int, names: tuple[str, str]
) -> None:
    entry = map_entry(config(model_id))
    known = prices_of(config(model_id))
    assert known is not None
    price = known.at(DAY, prompt, batched=bool(names[1]))
    ending = "".join(names)
    assert price is not None
    assert price.input_usd == pytest.approx(entry["input_cost_per_token" + ending] * 1e6)
    assert price.output_usd == pytest.approx(entry["output_cost_per_token" + ending] * 1e6)
    assert price.cached_usd == pytest.approx(entry["cache_read_input_token_cost" + ending] * 1e6)


def test_a_model_that_has_tiers_alone_has_a_price() -> None:
    known = prices_of(config("dashscope/qwen3-vl-plus"))
    assert known is not None
    usual, long = known.at(DAY, 32_000), known.at(DAY, 32_001)
    assert usual is not None and long is not None  # noqa: PT018
    assert (usual.input_usd, long.input_usd) == pytest.approx((0.2, 0.3))
    assert known.on(DAY).source.startswith("litellm ")  # type: ignore[union-attr]


CACHED: dict[type[LocalServer], dict[str, Any]] = {
    OpenAIChat: {
        "usage": {
            "prompt_tokens": 1000,
            "completion_tokens": 40,
            "total_tokens": 1040,
            "prompt_tokens_details": {"cached_tokens": 600, "cache_write_tokens": 300},
        }
    },
    AnthropicMessages: {
        "usage": {
            "input_tokens": 100,
            "output_tokens": 40,
            "cache_read_input_tokens": 600,
            "cache_creation_input_tokens": 300,
        }
    },
    GeminiGenerate: {
        "usageMetadata": {
            "promptTokenCount": 1000,
            "candidatesTokenCount": 40,
            "totalTokenCount": 1040,
            "cachedContentTokenCount": 600,
        }
    },
}
"""What each protocol says of a prompt of 1,000 tokens, most of them in its cache."""


@pytest.mark.parametrize("route", ROUTES)
def test_what_a_prompt_cache_held_is_recorded_and_priced(
    monkeypatch: pytest.MonkeyPatch, route: str
) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")
    kind = ROUTES[route].server

    class Caching(kind):  # type: ignore[misc, valid-type]
        def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
            return {**super().reply(seen, ending), **CACHED[kind]}

    price = {"input": 10, "output": 100, "cached": 1, "cache_write": 12}
    with Running(Caching()) as running:
        config = ROUTES[route].config(running.url, price=price)
        reply = reply_of(make_model(config), make_request())
    usage = reply.usage
    written = 0 if kind is GeminiGenerate else 300
    assert (usage.prompt_tokens, usage.completion_tokens) == (1000, 40)
    assert (usage.cached_tokens, usage.cache_write_tokens or 0) == (600, written)
    paid = 600 * 1 + written * 12 + (400 - written) * 10 + 40 * 100
    assert reply.cost_usd == pytest.approx(paid / 1e6)
    assert reply.storable() == reply


@given(st.integers(-5, 2000), st.none() | st.integers(-5, 2000), st.none() | st.integers(-5, 2000))
def test_no_more_is_cached_than_the_prompt_holds(
    prompt: int, cached: int | None, written: int | None
) -> None:
    expected = Estimate(1000, 100, 100)
    usage = Usage(
        prompt_tokens=prompt,
        completion_tokens=5,
        reasoning_tokens=None,
        cached_tokens=cached,
        cache_write_tokens=written,
    )
    read = counted(Reply(text="a", usage=usage), expected).usage
    assert (read.cached_tokens or 0) >= 0
    assert (read.cache_write_tokens or 0) >= 0
    assert (read.cached_tokens or 0) + (read.cache_write_tokens or 0) <= (read.prompt_tokens or 0)


def test_a_day_that_the_map_names_is_read() -> None:
    dated = config("openai/gpt-4o-2024-08-06")
    said = map_entry(dated)["deprecation_date"]
    assert ends_on(dated) == date.fromisoformat(said)
    assert not is_unlisted(dated)


@pytest.mark.parametrize(
    ("asked", "unlisted"),
    [
        (config("openai/no-such-model"), True),
        (config("openai/no-such-model", api_base="http://localhost:1/v1"), False),
        (config("hosted_vllm/no-such-model"), False),
        (ModelConfig(name="oracle"), False),
    ],
)
def test_models_that_the_map_does_not_know_have_no_day(asked: ModelConfig, unlisted: bool) -> None:
    assert ends_on(asked) is None
    assert is_unlisted(asked) == unlisted
