"""Prices, estimates and the budget."""

import asyncio
import contextlib
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig, Price, Tariff
from phyblock.errors import BudgetReachedError, RetryableError, UnavailableError
from phyblock.models import costs
from phyblock.models.cache import ReplyCache
from phyblock.models.costs import Budget, Estimate, ModelBudget, cost_usd, estimate, most_usd
from phyblock.models.request import Image, Message
from phyblock.records.record import Reply, Usage
from tests.models.factory import ROUTES, ask, make_model, make_request, requests_of, with_fields
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import PRICE, in_a_loop

sides = st.integers(1, 6000)
FAMILIES = ("gpt-4o", "gpt-5.6", "claude-opus-4-7", "claude-3", "gemini-2.5", "grok-4")
A_MILLIONTH = Tariff(input=0.0, output=1.0)
"""The price of a token of a reply, so that a call costs any number of them."""
steps = st.tuples(st.integers(10_000, 3_000_000), st.floats(0, 1), st.integers(0, 3))
told_tokens = st.tuples(st.integers(1, 90_000), st.integers(1, 9000))
amounts = st.one_of(st.none(), st.floats(), st.floats(0, 2))
usd = st.floats(0, 100)
maybe = st.none() | usd
prices = st.builds(Price, input=usd, output=usd, cached=maybe, cache_write=maybe)


def config(model_id, **fields):
    return ModelConfig(name="m", id=model_id, **fields)


def request_of(*parts, **params):
    return replace(make_request(), messages=(Message("user", parts),), params=params)


PICTURES = """
openai/gpt-4o-mini-2024-07-18 512 512 8500          openrouter/openai/gpt-4o-mini 1024 1024 25501
openai/gpt-4o-2024-08-06 1024 1024 765              openai/gpt-4o-2024-08-06:low 1024 512 85
openai/gpt-4o-2024-08-06:high 1024 1024 765         openai/gpt-4.1-mini 1024 1024 1659
openai/o4-mini 2048 2048 2642                       openai/gpt-4.1-nano 64 33 10
openai/gpt-5.6 1024 512 615                         openai/gpt-5.6-luna 1024 1024 1229
openai/gpt-5.6 2048 2048 4916                       openai/gpt-5.6:low 1024 512 154
openai/gpt-5.6:original 4096 2048 9831              openai/gpt-6-luna:high 2048 2048 3000
openai/gpt-5.5:auto 4096 4096 12000                 openai/gpt-5.4 2048 2048 3000
openai/gpt-5.4-mini:low 2048 2048 4916              openai/gpt-5.2:low 1024 512 615
openai/gpt-5-mini-2025-08-07 1280 720 1104          openai/gpt-5-2025-08-07 1024 512 350
openai/gpt-5 1024 512 350                           openai/o3-2025-04-16 1024 512 375
openai/o3:low 1024 512 75                           anthropic/claude-sonnet-5-5 1024 512 703
anthropic/claude-3-7-sonnet-20250219 1024 512 703
anthropic/claude-3-7-sonnet-20250219 3000 3000 1568
bedrock/us.anthropic.claude-opus-4-7 1024 512 703
openrouter/anthropic/claude-opus-4-7 2048 1024 2738
gemini/gemini-2.0-flash 384 384 258                 gemini/gemini-2.5-pro 1024 512 516
gemini/gemini-2.5-pro:low 1024 512 64               gemini/gemini-3.8-flash 1024 512 1120
gemini/gemini-3.8-flash:low 1024 512 280            gemini/gemini-3.8-flash:medium 1024 512 560
gemini/gemini-4-argon:ultra_high 64 64 2240         xai/grok-4 1024 512 1792
xai/grok-4.7:low 1024 512 1792
hosted_vllm/Qwen/Qwen2.5-VL-7B-Instruct 1024 512 705
hosted_vllm/Qwen/Qwen3-VL-8B-Instruct 1024 512 514
"""
"""Model, with the detail that is asked for, width, height [pixels], tokens."""


def test_a_picture_counts_as_its_model_counts_it():
    words = PICTURES.split()
    for model, width, height, tokens in zip(*(words[n::4] for n in range(4)), strict=True):
        model_id, _, detail = model.partition(":")
        image = Image(b"", "goal", int(width), int(height))
        asked = config(model_id, image_detail=detail or None)
        assert estimate(asked, request_of(image)).prompt_tokens == int(tokens), model


@given(st.sampled_from(FAMILIES), sides, sides)
def test_every_picture_counts_and_none_without_bound(model, width, height):
    tokens = costs.picture_tokens(f"x/{model}", Image(b"", "goal", width, height))
    assert 1 <= tokens <= 36_000
    assert tokens == costs.picture_tokens(f"x/{model}", Image(b"", "goal", height, width))


@pytest.mark.parametrize(
    ("model_id", "params", "usual", "most"),
    [
        ("x/y", {}, 500, 32768),
        ("x/y", {"max_tokens": 300}, 300, 300),
        ("x/y", {"max_tokens": 16384}, 4000, 16384),
        ("x/y", {"reasoning_effort": "low"}, 4000, 32768),
        ("x/y", {"reasoning_effort": "none", "max_completion_tokens": 70}, 70, 70),
        ("openai/gpt-4o-2024-08-06", {}, 500, 16384),
    ],
)
def test_a_reply_is_as_long_as_the_model_thinks_and_may_say(model_id, params, usual, most):
    expected = estimate(config(model_id), request_of("a", **params))
    assert (expected.completion_tokens, expected.most_completion_tokens) == (usual, most)


def test_a_local_server_is_free_only_where_no_key_is_sent(monkeypatch):
    monkeypatch.delenv("HOSTED_VLLM_API_KEY", raising=False)
    local = config("hosted_vllm/x", api_base="http://127.0.0.1:9/v1")
    assert not costs.is_billed(local)
    monkeypatch.setenv("HOSTED_VLLM_API_KEY", "sk-not-a-real-key-1234")
    assert costs.is_billed(local)
    assert costs.is_billed(config("openai/nobodys"))


@given(st.floats(0.1, 10), st.lists(steps, max_size=30))
@in_a_loop
async def test_a_budget_is_never_passed_and_stops_only_when_nothing_more_fits(limit, calls):
    budget = Budget(limit)
    own = ModelBudget(budget, A_MILLIONTH)

    async def call(tokens, share, steps):
        most = tokens / 1e6
        try:
            held = await own.reserve(Estimate(0, 0, tokens))
        except BudgetReachedError:
            assert budget.spent_usd + most > limit
            return
        for _ in range(steps):
            await asyncio.sleep(0)
        own.settle(held, most * share)
        assert budget.spent_usd <= limit + 1e-9

    await asyncio.gather(*(call(*one) for one in calls))
    assert budget.spent_usd <= limit + 1e-9


@given(st.floats(0.01, 5), st.lists(told_tokens, min_size=1, max_size=40), st.integers(1, 16))
@in_a_loop
async def test_a_call_costs_no_more_than_was_held_once_a_reply_like_it_has_come(limit, told, width):
    """Whatever a server counts, the limit is passed at most by calls that were under way then; the
    first call is alone, and never are more under way than one more than were answered.
    """
    expected, budget, room = Estimate(1000, 100, 100), Budget(limit), asyncio.Semaphore(width)
    own = ModelBudget(budget, Tariff(**PRICE))
    longest, over_usd, under_way, answered = (0, 0), 0.0, 0, 0

    async def call(tokens):
        nonlocal longest, over_usd, under_way, answered
        async with room:
            try:
                held = await own.reserve(expected)
            except BudgetReachedError:
                return
            known, held_usd = longest, own.most_usd(expected) or 0.0
            under_way += 1
            assert under_way <= answered + 1
            await asyncio.sleep(0)
            usage = Usage(prompt_tokens=tokens[0], completion_tokens=tokens[1])
            usd = cost_usd(own.tariff, Reply(text="a", usage=usage))
            if tokens[0] <= known[0] and tokens[1] <= known[1]:
                assert usd <= held_usd
            over_usd += max(0.0, usd - held_usd)
            own.learn(expected, usage)
            own.settle(held, usd)
            longest = tuple(map(max, longest, tokens))
            under_way, answered = under_way - 1, answered + 1
            assert budget.spent_usd <= limit + over_usd + 1e-9

    await asyncio.gather(*map(call, told))


@given(st.lists(st.tuples(st.integers(10_000, 2_000_000), amounts), max_size=30))
@in_a_loop
async def test_what_was_spent_never_becomes_less_and_an_unknown_cost_is_the_dearest(calls):
    budget = Budget(1000.0)
    own = ModelBudget(budget, A_MILLIONTH)
    for tokens, cost in calls:
        before, most = budget.spent_usd, tokens / 1e6
        try:
            held = await own.reserve(Estimate(0, 0, tokens))
        except BudgetReachedError:
            break
        counted = own.settle(held, cost)
        is_known = cost is not None and 0 <= cost < float("inf")
        assert counted == (cost if is_known else most)
        assert budget.spent_usd == before + counted >= before


@given(st.lists(st.tuples(st.integers(0, 5000), st.none() | st.integers(0, 10**9)), max_size=20))
def test_what_is_learned_stays_within_bounds(counts):
    own = ModelBudget(Budget(1.0), Tariff(input=1.0, output=1.0))
    expected = Estimate(1000, 100, 100)
    plain = own.most_usd(expected) or 0.0
    last = plain
    for asked, told in counts:
        own.learn(Estimate(asked, 1, 1), Usage(prompt_tokens=told, completion_tokens=told))
        most = own.most_usd(expected) or 0.0
        assert last <= most <= 100 * plain
        last = most


@pytest.mark.parametrize("route", ["direct", "openai"])
@pytest.mark.parametrize("usage", ["null", "zero", "negative", "huge"])
def test_a_server_that_does_not_count_stops_within_the_limit(route, usage):
    server = OpenAIChat(Faults(mode=f"usage-{usage}"))
    budget = Budget(0.1)
    with Running(server) as running:
        config = ROUTES[route].config(running.url, price=PRICE, max_concurrency=4)
        asked = estimate(config, make_request())
        dearest = most_usd(Tariff(**PRICE), asked.prompt_tokens, asked.most_completion_tokens)
        answers = ask(make_model(config, budget=budget), *requests_of(40))
    replies = [answer for answer in answers if isinstance(answer, Reply)]
    assert {type(answer) for answer in answers} == {Reply, BudgetReachedError}
    assert 0 < len(replies) == server.requests <= 0.1 / dearest
    assert budget.spent_usd <= 0.1
    for reply in replies:
        assert (reply.cost_usd, reply.usage) == (None, Usage())
        assert reply.billed_usd == pytest.approx(dearest)


@pytest.mark.parametrize(("mode", "is_counted"), [("html", True), ("reset", True), ("500", False)])
def test_a_failure_that_may_have_been_billed_counts_against_the_budget(mode, is_counted):
    budget = Budget(100.0)
    with Running(ROUTES["direct"].server(Faults(mode=mode))) as running:
        model = make_model(ROUTES["direct"].config(running.url, price=PRICE), budget=budget)
        (answer,) = ask(model, make_request())
    assert isinstance(answer, RetryableError)
    assert (budget.spent_usd > 0.1) == is_counted
    assert answer.billed_usd == pytest.approx(budget.spent_usd)


def test_a_reply_says_what_the_limit_counts_for_all_its_attempts(tmp_path):
    server = ROUTES["direct"].server(Faults({"reset": 0.2, "html": 0.2, "500": 0.2}))
    requests = requests_of(30)
    with Running(server) as running, ReplyCache(tmp_path / "c.sqlite") as cache:
        config = ROUTES["direct"].config(running.url, price=PRICE)
        budget = Budget(100.0)
        replies = ask(make_model(config, cache=cache, budget=budget), *requests)
        again = ask(make_model(config, cache=cache, budget=Budget(1.0)), *requests)
    billed = [reply.billed_usd for reply in replies]
    assert sum(usd or 0.0 for usd in billed) == pytest.approx(budget.spent_usd)
    assert max(usd or 0.0 for usd in billed) > min(usd or 0.0 for usd in billed) > 0
    assert {reply.billed_usd for reply in again} == {None}


@given(prices, *[st.integers(0, 10**6)] * 3, st.integers(0, 10**9))
def test_each_prompt_token_is_paid_once(price, fresh, cached, written, out):
    usage = Usage(
        prompt_tokens=fresh + cached + written,
        completion_tokens=out,
        cached_tokens=cached,
        cache_write_tokens=written,
    )
    read_usd = price.input if price.cached is None else price.cached
    write_usd = price.input if price.cache_write is None else price.cache_write
    paid = fresh * price.input + cached * read_usd + written * write_usd + out * price.output
    counted = cost_usd(Tariff(**dict(price)), Reply(text="a", usage=usage))
    assert counted == pytest.approx(paid / 1e6)


def test_the_cost_of_a_prompt_beyond_the_price_is_unknown_and_none_is_sent_under_a_limit():
    tariff = Tariff(input=1.0, output=1.0, up_to=1000)
    for prompt, is_known in ((1000, True), (1001, False)):
        usage = Usage(prompt_tokens=prompt, completion_tokens=1)
        assert (cost_usd(tariff, Reply(text="a", usage=usage)) is not None) == is_known
        expected = Estimate(prompt, 1, 1)
        assert ModelBudget(Budget(), tariff).most_usd(expected) is not None
        with contextlib.nullcontext() if is_known else pytest.raises(UnavailableError):
            ModelBudget(Budget(1.0), tariff).most_usd(expected)


@pytest.mark.parametrize(
    ("model_id", "api_base", "is_half"),
    [
        ("openai/mine", None, True),
        ("openai/mine", "https://api.openai.com/v1", True),
        ("openai/mine", "https://gateway.example/v1", False),
        ("hosted_vllm/mine", "http://localhost:8000/v1", False),
        ("anthropic/mine", "https://gateway.example", False),
        ("gemini/mine", None, True),
    ],
)
def test_batches_cost_half_only_where_that_is_known(model_id, api_base, is_half):
    whole = {"input": 8.0, "output": 40.0, "cached": 1.0}
    half = {name: usd / 2 for name, usd in whole.items()}
    served = config(model_id, batch=True, api_base=api_base)
    known = costs.tariff_of(with_fields(served, price=whole))
    found = costs.price_at(known, batched=True)
    assert found.model_dump(include=set(whole)) == (half if is_half else whole)
    most = [most_usd(known, 1000, 500, batched=batched) for batched in (True, False)]
    assert most[0] == pytest.approx(most[1] / (1 + is_half))
    own = costs.tariff_of(with_fields(served, price=whole | {"batch": {"input": 3, "output": 4}}))
    assert costs.price_at(own, batched=True) == Price(input=3.0, output=4.0)


@given(prices, st.integers(0, 10**6), st.integers(0, 10**5), st.data())
def test_no_call_costs_more_than_the_most(price, prompt, completion, data):
    batched = data.draw(st.booleans())
    tariff = Tariff(**dict(price))
    most = most_usd(tariff, prompt, completion, batched=batched)
    written = data.draw(st.integers(0, prompt))
    usage = Usage(prompt_tokens=prompt, completion_tokens=completion, cache_write_tokens=written)
    cost = cost_usd(tariff, Reply(text="a", usage=usage, batched=batched))
    assert cost <= most * (1 + 1e-9)


@pytest.mark.parametrize(
    ("model_id", "up_to", "ending"),
    [
        ("gemini/gemini-2.5-pro", 200_000, ""),
        ("openai/gpt-5.6", 272_000, "_batches"),
        ("anthropic/claude-haiku-5-5", 100_000, "_batches"),
        ("xai/grok-4.7", 200_000, ""),
        ("azure/gpt-4.1", None, ""),
    ],
)
def test_batches_and_caches_are_priced_as_the_map_says(model_id, up_to, ending):
    entry = costs.map_entry(config(model_id))
    known = costs.tariff_of(config(model_id))
    assert known.up_to == up_to
    price = costs.price_at(known, batched=bool(ending))
    names = ("input_cost_per_token", "output_cost_per_token", "cache_read_input_token_cost")
    told = [entry[name + ending] * 1e6 for name in names]
    assert [price.input, price.output, price.cached] == pytest.approx(told)
