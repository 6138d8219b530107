"""Batches: every question gets what a call of its own would have got, once, whatever happens."""

import contextlib
import itertools
import json
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.errors import BudgetReachedError, RetryableError, SampleError, UnavailableError
from phyblock.models.batch import Batch, answers_of, custom_id, read_batches, under_way
from phyblock.models.batch_providers import PROVIDERS, UNREADABLE, _joined
from phyblock.models.cache import ReplyCache
from phyblock.models.costs import Budget
from phyblock.records.record import BatchLine, Reply
from tests.fuzz.strategies import documents
from tests.models import factory
from tests.models.factory import Disk, ask, make_model, requests_of, run_command, with_fields
from tests.servers.batches import AnthropicBatches, BatchFaults, GeminiBatches, OpenAIBatches
from tests.servers.chassis import Running
from tests.workspace import KEY

SERVERS = {"direct": OpenAIBatches, "anthropic": AnthropicBatches, "gemini": GeminiBatches}
PRICE = {"input": 1000, "output": 1000, "batch": {"input": 500, "output": 500}}
TOKEN = "pb0"
keys = st.lists(st.sampled_from("abcdef"), unique=True, min_size=1)
fates = st.sampled_from(["intended", "created", "lost", "ended"])
values = st.none() | st.integers() | st.text()
DOCUMENTS = documents(
    *("id", "name", "status", "processing_status", "request_counts", "total", "metadata", "state"),
    *("batchStats", "requestCount", "response", "output", "responsesFile", "error", "code", "body"),
    *("custom_id", "key", "result", "type", "message", "status_code", "created_at", "createTime"),
    *("data", "has_more", "operations", "nextPageToken", "errors", "output_file_id"),
    leaves=values | st.booleans() | st.floats() | st.just("2026-11-23T10:00:00Z"),
)
# Names of requests of this and of other batches.
names = st.integers(0, 5).map(lambda n: custom_id(Batch(TOKEN), n)) | st.sampled_from(
    ["pb0-x", "pb0--1", "pb01-1", "pb0-1-1", "pb0-", "-", "", "pb0-٣", "pb0-99999999999"]
)


@pytest.fixture(params=SERVERS)
def route(request):
    return request.param


@pytest.fixture
def disk(tmp_path):
    return Disk(tmp_path)


@contextlib.contextmanager
def serving(route, faults=None, kind=None):
    with Running((kind or SERVERS[route])(batch=faults or BatchFaults())) as running:
        yield running.server, factory.ROUTES[route].config(running.url, batch=True, price=PRICE)


def served(route, disk, requests, faults=None, **options):
    with serving(route, faults) as (server, config):
        return server, run_command(config, disk, requests, **options)


def all_once(server, ended):
    assert {type(one) for one in ended} == {Reply}, ended
    assert (len(server.asked), set(server.asked.values())) == (len(ended), {1})


def test_a_batch_asks_and_answers_as_single_calls_do(route, disk):
    requests = requests_of(3)
    server, ended = served(route, disk, requests, BatchFaults(lines={0: {1: "length"}}))
    with serving(route) as (other_server, config):
        single = ask(make_model(with_fields(config, batch=False)), *requests)
        in_order = {one.sample: one.raw for one in other_server.seen}
    assert {one.sample: one.raw for one in server.seen} == in_order
    assert [one.finish for one in ended] == ["stop", "length", "stop"]
    for one, other in zip(ended, single, strict=True):
        assert one.batched
        assert one.cost_usd == pytest.approx(other.cost_usd / 2)
        if one.finish == "stop":
            alike = {"batched": False, "latency_s": 0.0, "cost_usd": None, "billed_usd": None}
            assert one.model_copy(update=alike) == other.model_copy(update=alike)
    assert server.keys == {KEY}
    all_once(server, ended)


FAULTS = {
    "500": (True, Reply), "429": (True, Reply), "expired": (False, Reply),
    "missing": (True, Reply), "broken": (True, Reply), "twice": (False, Reply),
    "stranger": (False, Reply), "400": (False, SampleError),
}  # fmt: skip
"""By fault of a line: whether the question is asked again, and what comes in the end."""


def test_each_line_that_fails_is_asked_again_or_ends_as_a_call_would(route, disk):
    requests = requests_of(len(FAULTS) + 1)
    faults = BatchFaults(lines={0: dict(enumerate(FAULTS))})
    with serving(route, faults) as (server, config):
        ended = run_command(config, disk, requests)
        assert len(server.made) == 1
        assert Counter(map(type, ended)) == {Reply: 3, RetryableError: 5, SampleError: 1}
        ended = run_command(config, disk, requests, recorded=requests[:-2])
        # What was rejected is asked again only when that is wanted.
        (mended,) = run_command(config, disk, requests[-2:-1], recorded=requests)
        assert isinstance(mended, Reply)
    samples = [one.sample for one in server.seen[: len(requests)]]
    for sample, one, (again, kind) in zip(samples, ended, FAULTS.values(), strict=False):
        assert isinstance(one, kind), (one, kind)
        assert server.asked[sample] == 1 + (again or kind is SampleError)
    assert isinstance(ended[-1], Reply)
    assert [len(made.requests) for made in server.made[1:]] == [5, 1]


@pytest.mark.parametrize("end", ["expired", "cancelled"])
def test_a_batch_that_is_ended_keeps_its_answers_and_the_rest_is_asked_again(route, disk, end):
    # Of a batch that expired Gemini has no results at all.
    places = range(4) if (route, end) == ("gemini", "expired") else (1, 2)
    faults = BatchFaults(ends={0: end}, lines={0: dict.fromkeys(places, end)})
    requests, budget = requests_of(4), Budget(1e9)
    with serving(route, faults) as (server, config):
        ended = run_command(config, disk, requests, budget=budget)
        assert [isinstance(one, RetryableError) for one in ended] == [n in places for n in range(4)]
        # It is not sent again at once, and what was never asked costs nothing.
        assert len(server.made) == 1
        paid = sum(one.cost_usd for one in ended if isinstance(one, Reply))
        assert budget.spent_usd == pytest.approx(paid)
        all_once(server, run_command(config, disk, requests, recorded=requests))
    assert [len(made.requests) for made in server.made] == [4, len(places)]


def test_a_refused_batch_stops_the_model_and_asks_nothing(disk):
    requests = requests_of(2)
    with serving("direct", BatchFaults(ends={0: "refused"})) as (server, config):
        ended = run_command(config, disk, requests, budget=Budget(1e9))
        assert {type(one) for one in ended} == {UnavailableError}
        assert "Enqueued token limit" in str(ended[0])
        assert disk.lines[-1].event == "lost"
        all_once(server, run_command(config, disk, requests))


STOPS = UnavailableError
CALLS = {
    "a look fails": ({"look": ("500", "reset", "503")}, Reply),
    "an upload fails": ({"upload": ("500", "reset"), "create": ("429",)}, Reply),
    "results fail": ({"results": ("500", "done-reset", "reset")}, Reply),
    "a look is rejected": ({"look": ("400",)}, STOPS),
    "a batch is not known": ({"look": ("404",)}, STOPS),
    "looks fail for long": ({"look": ("500",) * 4}, STOPS),
    "results fail for long": ({"results": ("500",) * 4}, STOPS),
    "results are not known": ({"results": ("404",)}, STOPS),
    "the key is wrong": ({"upload": ("401",), "create": ("401",)}, STOPS),
}
"""By what fails: how calls end, and what comes of it: replies, or a model that is stopped."""


@pytest.mark.parametrize(("calls", "kind"), CALLS.values(), ids=list(CALLS))
def test_calls_that_fail_lose_nothing_and_the_next_command_goes_on(route, disk, calls, kind):
    policy = replace(factory.QUICK, attempts=4)
    requests, budget = requests_of(2), Budget(1e9)
    with serving(route, BatchFaults(calls=calls)) as (server, config):
        ended = run_command(config, disk, requests, policy=policy, budget=budget)
        assert {type(one) for one in ended} == {kind}
        assert KEY not in str(ended) + "".join(line.as_json() for line in disk.lines)
        assert server.made == [] or budget.spent_usd > 0
        server.batch = BatchFaults()
        all_once(server, run_command(config, disk, requests))


UNSURE = {
    "it is made unheard": (("done-reset",), 1),
    "it is made with an error": (("500",), 0),
    "nobody knows": (("reset",), 0),
}


@pytest.mark.parametrize(("faults", "made"), UNSURE.values(), ids=list(UNSURE))
def test_a_batch_that_may_exist_stops_the_model_until_it_is_looked_up(route, disk, faults, made):
    requests = requests_of(2)
    with serving(route, BatchFaults(calls={"create": faults})) as (server, config):
        for budget in (Budget(1e9), Budget(1e9)):
            ended = run_command(config, disk, requests, budget=budget)
            assert {type(one) for one in ended} == {UnavailableError}
            assert "it is not known whether batch pb" in str(ended[0])
            assert (len(server.made), budget.spent_usd > 0) == (made, True)
        disk.lines = factory.look_up(server, disk.lines, str(ended[0]))
        all_once(server, run_command(config, disk, requests))
    assert len(server.made) == 1


def test_once_a_model_is_stopped_its_draft_is_not_sent_and_costs_nothing(disk, monkeypatch):
    monkeypatch.setattr(factory, "POLL_S", 0.25)  # A draft waits for a second.
    old, new = requests_of(2)
    with serving("direct", BatchFaults(calls={"look": ("404", "404")})) as (server, config):
        run_command(config, disk, [old])
        budget = Budget(1e9)
        ended = run_command(config, disk, [old, new], budget=budget)
    assert {type(one) for one in ended} == {UnavailableError}
    assert len(server.made) == 1
    assert budget.spent_usd == pytest.approx(disk.lines[0].most_usd[0])


@pytest.mark.parametrize(
    ("limit", "most", "size"),
    [
        ("most_requests", 2, len),
        ("most_bytes", 4_000, lambda requests: len(json.dumps([body for _, body in requests]))),
    ],
)
def test_what_does_not_fit_goes_out_in_further_batches(route, disk, monkeypatch, limit, most, size):
    provider, _, _ = factory.ROUTES[route].model_id.partition("/")
    monkeypatch.setattr(PROVIDERS[provider], limit, most)
    server, ended = served(route, disk, requests_of(5))
    assert 1 < len(server.made) < 5
    assert max(size(made.requests) for made in server.made) <= most
    all_once(server, ended)


@pytest.mark.parametrize(("shares", "first"), [(2.5, 2), (0.5, 0)])
def test_a_cost_limit_is_kept_by_the_dearest_case_of_what_is_sent(disk, shares, first):
    """The limit is so many requests at their dearest; what is left of it pays for the next."""
    requests = requests_of(4)
    free = Disk(disk.folder / "free")
    served("direct", free, requests, budget=Budget(1e9))
    most_usd = free.lines[0].most_usd[0]
    budget = Budget(shares * most_usd)
    server, ended = served("direct", disk, requests, budget=budget)
    assert [len(made.requests) for made in server.made][:1] == [first] * bool(first)
    answered = [one for one in ended if isinstance(one, Reply)]
    assert len(answered) == sum(server.asked.values())
    assert 0 < budget.spent_usd <= shares * most_usd or not first
    assert sum(one.billed_usd or 0.0 for one in answered) == pytest.approx(budget.spent_usd)
    assert first or isinstance(ended[0], BudgetReachedError)


def test_what_is_in_the_cache_is_not_asked_and_answers_go_there(route, tmp_path):
    """Batched or not, it is the same question; what it cost is what it was asked for as."""
    requests = requests_of(2)
    with ReplyCache(tmp_path / "replies.sqlite") as cache:
        server, (first,) = served(route, Disk(tmp_path), requests[:1], cache=cache)
        with serving(route) as (_, config):
            model = make_model(with_fields(config, batch=False), cache=cache)
            found, single = ask(model, *requests)
        server, ended = served(route, Disk(tmp_path / "other"), requests, cache=cache)
    assert (found.cached, found.batched, found.cost_usd) == (True, True, first.cost_usd)
    assert (single.cached, single.batched) == (False, False)
    assert not server.calls
    assert [one.cost_usd for one in ended] == [first.cost_usd, single.cost_usd]


# What a kill cuts off in litellm is closed when it is collected.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_kill_at_any_moment_loses_nothing_and_asks_nothing_twice(route, tmp_path):
    requests = requests_of(2)
    for at in itertools.count():
        disk = Disk(tmp_path / str(at))
        killing = factory.Killing(at)
        with serving(route) as (server, config):
            is_over = killing.run(disk, server, factory.command(config, disk, requests))
            again = run_command(config, disk, requests, budget=Budget(1e9))
            if "is not known whether" in str(again[0]):
                disk.lines = factory.look_up(server, disk.lines, str(again[0]))
                again = run_command(config, disk, requests, budget=Budget(1e9))
            all_once(server, again)
        if is_over:
            break
        assert len(server.made) == 1, killing.names[at]
    assert at >= 14


@given(st.lists(st.tuples(keys, fates)))
def test_a_request_is_in_the_last_batch_that_was_not_lost(batches):
    def line(n, event, **fields):
        told = {"batch": f"t{n}", "model": "m", "event": event, "time": "2026-11-23T10:00:00Z"}
        return BatchLine.model_validate({**told, **fields})

    lines = [line(n, "intended", keys=tuple(of)) for n, (of, _) in enumerate(batches)]
    for n, (_, fate) in enumerate(batches):
        if fate in ("created", "ended"):
            lines.append(line(n, "created", id=f"id-{n}"))
        if fate in ("lost", "ended"):
            lines.append(line(n, fate))
    read = read_batches(lines, "m")
    left = [n for n, (_, fate) in enumerate(batches) if fate != "lost"]
    assert [(one.token, one.event, list(one.most_usd)) for one in read] == [
        (f"t{n}", batches[n][1], batches[n][0]) for n in left
    ]
    assert [bool(one.id) for one in read] == [batches[n][1] != "intended" for n in left]
    assert read_batches(lines, "another") == []
    waits = [f"t{n}" for n in left if batches[n][1] != "ended"]
    assert [one.token for one in under_way(lines, "m")] == waits


@given(st.lists(st.tuples(names, st.booleans())), st.integers(0, 4))
def test_the_first_whole_line_of_a_request_answers_it(lines, requests):
    texts = []
    for n, (name, is_whole) in enumerate(lines):
        response = {"status_code": 200, "body": {"n": n}}
        text = json.dumps({"custom_id": name, "response": response})
        texts.append(text if is_whole else text[:-9])
    batch = Batch(TOKEN, most_usd=dict.fromkeys(map(str, range(requests))))
    provider = PROVIDERS["openai"](ModelConfig(name="m", id="openai/m"))
    answers = answers_of("\n\n".join(texts).encode(), provider, batch)
    found = {key: json.loads(answer.body) for key, answer in answers.items()}
    expected = {}
    for place in range(requests):
        wanted = (custom_id(batch, place), True)
        if wanted in lines:
            expected[str(place)] = {"n": lines.index(wanted)}
    assert found == expected


@given(st.sampled_from(["openai", "anthropic", "gemini"]), DOCUMENTS)
def test_any_line_and_any_status_is_read_or_has_not_its_form(name, raw):
    provider = PROVIDERS[name](ModelConfig(name="m", id=f"{name}/m"))
    for read in (provider.read, provider._read_status):
        with contextlib.suppress(*UNREADABLE):
            read(raw)


@given(st.dictionaries(st.text(), values, max_size=3), st.text(min_size=1), values)
def test_bodies_stand_in_lines_as_they_are(fields, name, body):
    fields.pop(name, None)
    line = _joined(fields, name, json.dumps(body).encode())
    assert json.loads(line) == {**fields, name: body}
    assert b"\n" not in line


def test_results_that_are_not_there_yet_are_not_taken_for_none(disk):
    class Late(OpenAIBatches):
        def told(self, made):
            is_early = made.looks <= self.batch.looks
            return {**super().told(made), **({"output_file_id": None} if is_early else {})}

    with serving("direct", kind=Late) as (server, config):
        all_once(server, run_command(config, disk, requests_of(2)))
    assert len(server.made) == 1


def test_headers_that_requests_need_go_with_their_batch(disk):
    schema = {"type": "object", "properties": {}, "additionalProperties": False}
    form = {"type": "json_schema", "json_schema": {"name": "a", "strict": True, "schema": schema}}
    betas = {"create": set(), "look": set(), "results": set()}

    class Noting(AnthropicBatches):
        def key_of(self, request):
            betas[self.calls[-1]].add(request.headers.get("anthropic-beta", ""))
            return super().key_of(request)

    fields = {"id": "anthropic/claude-sonnet-4-5", "response_format": "always"}
    with serving("anthropic", kind=Noting) as (_, config):
        request = replace(factory.make_request(), response_format=form)
        (reply,) = run_command(with_fields(config, **fields), disk, [request])
    assert isinstance(reply, Reply)
    (beta,) = betas.pop("create")
    assert beta.startswith("structured-outputs")
    assert betas == {"look": {""}, "results": {""}}
