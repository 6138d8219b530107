"""The laws hold whatever servers do: each track, over both transports, with every fault drawn;
batches under faults and kills; costs under whatever usage is reported.
"""

import math
import random
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import RetryableError, SampleError
from phyblock.models.costs import Budget
from phyblock.records.record import Reply
from tests.fuzz.laws import TRACKS, LedgerChat, watched
from tests.fuzz.strategies import FAULTS, SEED, fuzzed
from tests.models import factory
from tests.models.factory import ROUTES, Disk, Killing, command, requests_of, run_command
from tests.servers.batches import AnthropicBatches, BatchFaults, GeminiBatches, OpenAIBatches
from tests.servers.chassis import Faults, Running
from tests.servers.faults import WIRE_FAULTS
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import PRICE, SCENES, questions, read_lines, write_questions

pytestmark = pytest.mark.fuzz

_SHARE = 0.35
_TRANSPORTS = ("direct", "litellm")
_CELLS = [
    pytest.param(track, transport, marks=[] if n == 0 else [pytest.mark.slow])
    for n, (track, transport) in enumerate((t, w) for w in _TRANSPORTS for t in TRACKS)
]
_STOPPING = [name for name, fault in WIRE_FAULTS.items() if fault.ending == "unavailable"]
_PASSING = ["429", "500", "empty", "400", *(n for n in WIRE_FAULTS if n not in _STOPPING)]
_QUOTA = math.ceil(FAULTS / len(_CELLS))
"""Faults that each track meets over each transport."""
WAYS = [
    (OpenAIBatches, "direct"),
    pytest.param(AnthropicBatches, "anthropic", marks=pytest.mark.slow),
    pytest.param(GeminiBatches, "gemini", marks=pytest.mark.slow),
]
ASKED = 4
COMMANDS = 25
WHOLE = ("ok", "twice", "stranger")
endings = st.sampled_from([*WHOLE, "500", "429", "400", "length", "missing", "broken", "expired"])
failures = st.lists(st.sampled_from(["", "500", "reset", "done-reset"]), max_size=3).map(tuple)
lines = st.dictionaries(st.integers(0, ASKED - 1), endings, max_size=ASKED)
batch_faults = st.builds(
    BatchFaults,
    st.dictionaries(st.integers(0, 3), lines),
    st.dictionaries(st.integers(0, 1), st.sampled_from(["refused", "cancelled"]), max_size=1),
    st.fixed_dictionaries(dict.fromkeys(("upload", "create", "look", "results"), failures)),
    looks=st.integers(1, 3),
)
"""Faults of four batches, one of which may be cancelled or refused, and of calls about them."""


def prepare(workspace, url, track, transport, seeds):
    write_questions(workspace.root / "questions", questions(SCENES, 4, ("SH", "OR", "VP")))
    fields = {"transport": transport, "price": {"input": 1, "output": 1}}
    if transport == "direct":  # by two addresses, so that what fails at one is asked at the other
        fields["api_base"] = [f"{one}/v1" for one in (url, url.replace("127.0.0.1", "localhost"))]
    workspace.write_models(url, "alpha", **fields)
    limits = {"max_concurrency": 24, "timeout_s": 5.0}
    workspace.write_suite(models=["alpha"], seeds=seeds, limits=limits, **TRACKS[track][1])


def run(workspace, *args):
    """Run the suite of a workspace, which holds the laws of commands."""
    words = ["run", "suite.yaml", "--out", str(workspace.out), "--no-report", "--yes", *args]
    ended, broken = watched(words, workspace, [workspace.out.name], longest_s=300.0)
    holds(broken)
    return ended


def holds(broken):
    assert not (told := [f"{one.name}: {one.detail}" for one in broken]), "\n".join(told[:20])


def one_round(workspace, server, track):
    """A run with faults to its end, the same again, what was refused again, and a second run."""
    ledger = server.ledger
    first = len(ledger)
    for _ in range(10):
        done = run(workspace)
        if "To continue" not in done.out:
            break
    asked = len(ledger)
    assert run(workspace).code == (1 if ledger.that_came_to("sample") else 0), done.out + done.err
    assert len(ledger) == asked, "a run that was done asked again"
    holds(ledger.broken(workspace.out))

    server.faults = Faults()
    refused = {entry.key for entry in ledger[first:] if entry.comes_to == "sample"}
    done = run(workspace, "--retry-failed")
    assert done.code == 0, done.out + done.err
    again = ledger[asked:]
    if track != "step_planning":  # where an episode goes on with turns that were never asked
        assert Counter(entry.key for entry in again) == Counter(refused)
    holds(ledger.broken(workspace.out, retries_refused=True))

    asked = len(ledger)
    workspace.out = workspace.out.with_name(f"{workspace.out.name}-again")
    done = run(workspace)
    assert done.code == 0, done.out + done.err
    assert len(ledger) == asked, "what stands in the cache was asked again"


@pytest.mark.parametrize(("track", "transport"), _CELLS)
def test_faults(workspace, tallies, track, transport):
    seeds = math.ceil(_QUOTA * (1 - _SHARE) / _SHARE / TRACKS[track][0]) + 1
    met = Counter()
    n = 0
    while sum(met.values()) < _QUOTA:
        shares = dict.fromkeys(_PASSING, _SHARE / len(_PASSING))
        faults = Faults(shares, seed=1 + SEED + n, retry_after="0")
        server = LedgerChat(faults)
        with Running(server) as running:
            workspace.out = workspace.root / f"out{n}"
            drawn = list(range(n * seeds, (n + 1) * seeds))
            prepare(workspace, running.url, track, transport, drawn)
            one_round(workspace, server, track)
        met += server.ledger.faults
        n += 1
    tallies.setdefault(f"faults met by {track}, {transport}", Counter()).update(met)


@pytest.mark.slow
@pytest.mark.parametrize("transport", _TRANSPORTS)
def test_faults_that_stop_a_model(workspace, tallies, transport):
    faults = Faults(dict.fromkeys(_STOPPING, 0.5 / len(_STOPPING)), seed=1 + SEED)
    with Running(LedgerChat(faults)) as running:
        server = running.server
        prepare(workspace, running.url, "full_planning", transport, list(range(8)))
        workspace.write_models(running.url, "alpha", transport=transport, max_concurrency=2)
        for _ in range(12):
            done = run(workspace)
            assert done.code in (0, 1), done.out + done.err
        server.faults = Faults()
        assert run(workspace).code == 0
    holds(server.ledger.broken(workspace.out))
    tallies.setdefault(f"faults that stop, {transport}", Counter()).update(server.ledger.faults)


# What a kill cuts off in litellm is closed when it is collected.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(("kind", "route"), WAYS)
@fuzzed(15)
@given(batch_faults, st.lists(st.integers(0, 25), max_size=3))
def test_batches(kind, route, faults, kills):
    requests = requests_of(ASKED)
    policy = replace(factory.QUICK, attempts=3)
    with tempfile.TemporaryDirectory() as folder, Running(kind(batch=faults)) as running:
        server = running.server
        config = ROUTES[route].config(running.url, batch=True, price={"input": 1.0, "output": 1.0})
        disk = Disk(Path(folder))
        for at in kills:
            Killing(at).run(disk, server, command(config, disk, requests, policy=policy))
        options = {"policy": policy, "budget": Budget(1e9)}
        failed = []
        for _ in range(COMMANDS):
            ended = run_command(config, disk, requests, recorded=failed, **options)
            # A run records what failed, and asks it again.
            failed = [r for r, e in zip(requests, ended, strict=True) if type(e) is RetryableError]
            if all(isinstance(one, (Reply, SampleError)) for one in ended):
                break
            if unsure := [str(one) for one in ended if "is not known whether" in str(one)]:
                disk.lines = factory.look_up(server, disk.lines, unsure[0])
        else:
            raise AssertionError(f"no end after {COMMANDS} commands: {ended}")
        answered = Counter()
        for made in server.made:
            told = faults.lines.get(made.ordinal, {})
            if faults.ends.get(made.ordinal) != "refused":
                for place, seen in enumerate(made.seen):
                    answered[seen.sample] += told.get(place, "ok") in (*WHOLE, "length", "400")
        assert set(answered.values()) == {1}, answered


@pytest.mark.parametrize("number", range(-(-FAULTS // 40)))
def test_no_more_is_spent_than_the_limit_and_what_was_under_way(workspace, tallies, number):
    draw = random.Random(f"{SEED} costs {number}")
    limit = 10 ** draw.uniform(-1, 2)
    billed = []

    def usage(_):
        """Up to ninety times the tokens that are expected."""
        tokens = tuple(int(10 ** draw.uniform(1, most)) for most in (4.4, 4.9))
        billed.append((tokens[0] * PRICE["input"] + tokens[1] * PRICE["output"]) / 1e6)
        return tokens

    entry = {"price": PRICE, "max_tokens": 999}
    with workspace.served(OpenAIChat(usage=usage), entry=entry, seeds=list(range(8))):
        done = workspace.run("--set", f"limits.max_cost_usd={limit}")
        assert done.code in (0, 1), done.err
    ended, sent, spent_at_last = {}, set(), 0.0
    for call in read_lines(workspace.out / "calls.jsonl"):
        if call.get("ended"):
            ended[call["call"]] = call["billed_usd"]
        else:
            sent.add(call["call"])
            spent_at_last = sum(ended.values())
            assert len(sent) - len(ended) <= 1 + len(ended), "more at once than were answered"
    assert spent_at_last <= limit + 1e-9, "a call was sent beyond the limit"
    assert sum(ended.values()) == pytest.approx(sum(billed)), "spend is not what was billed"
    tallies.setdefault("costs", Counter()).update({"calls": len(sent), "stopped": done.code})
