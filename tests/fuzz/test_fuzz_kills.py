"""kill -9 at random moments of each track, with one server and with four that fail, die and come
back: nothing answered is lost, no more is asked again than was under way, and costs are known.
"""

import contextlib
import json
import random
import signal
import sqlite3
import time
from collections import Counter

import pytest

from tests.fuzz.laws import TRACKS, Ledger, LedgerChat, kept_in
from tests.fuzz.strategies import KILLS, SEED
from tests.run.test_track_runs import by_sample
from tests.servers.chassis import FAULTS, Faults, Running
from tests.workspace import CALL_USD, PRICE, SCENES, questions, write_questions

AT_ONCE = 6
_ASKED_PER_EVENT = 12
_LONGEST_WAIT_S = 120.0


def on_disk(workspace):
    """The replies that stand in records, turns or the cache, as the ledger names them."""
    found = kept_in(workspace.out)
    path = workspace.cache / "replies.sqlite"
    if path.exists():
        with contextlib.closing(sqlite3.connect(path)) as database:
            tables = database.execute("SELECT name FROM sqlite_master").fetchall()
            rows = database.execute("SELECT reply FROM replies").fetchall() if tables else []
        found |= {("alpha", json.loads(row[0])["reasoning"]) for row in rows}
    return found


def counted_usd(workspace):
    """Return the cost of a run's calls, those without an end at their most, and their number."""
    path = workspace.out / "calls.jsonl"
    lines = path.read_bytes().split(b"\n")[:-1] if path.exists() else ()
    calls = {call["call"]: call for call in map(json.loads, lines)}
    open_calls = [call for call in calls.values() if not call.get("ended")]
    ended_usd = sum(call["billed_usd"] for call in calls.values() if call.get("ended"))
    return ended_usd + sum(call["most_usd"] for call in open_calls), len(open_calls)


def run_until_killed(workspace, servers, ledger, draw, options):
    """A run that is killed; of several servers some die and come back before: deaths of both."""
    deaths = 0
    with workspace.start("--yes", *options) as process:
        for _ in range(1 if len(servers) == 1 else 4):
            target = len(ledger) + draw.randrange(1, _ASKED_PER_EVENT)
            give_up_s = time.monotonic() + _LONGEST_WAIT_S
            while process.poll() is None and len(ledger) < target:
                assert time.monotonic() < give_up_s, "the run hangs"
                time.sleep(0.002)
            if len(servers) == 1:
                time.sleep(draw.random() / 20)
                continue
            alive = [server for server in servers if server.is_alive]
            dead = [server for server in servers if not server.is_alive]
            if dead and (len(alive) == 1 or draw.random() < 0.4):
                draw.choice(dead).come_back()
            else:
                draw.choice(alive).die()
                deaths += 1
        process.kill()
        process.communicate()
    seen = -1
    while any(server.server.at_once for server in servers) or seen != len(ledger):
        seen = len(ledger)
        time.sleep(0.05)
    return deaths, int(process.returncode == -signal.SIGKILL)


@pytest.mark.fuzz
@pytest.mark.parametrize(
    ("track", "count", "options"),
    [
        ("full_planning", 1, ()),
        ("step_planning", 1, ("--no-cache",)),
        pytest.param("vqa", 1, ("--no-cache",), marks=pytest.mark.slow),
        *(pytest.param(track, 4, (), marks=pytest.mark.slow) for track in TRACKS),
    ],
)
def test_kills(workspace, tallies, track, count, options):
    asked_per_seed, fields = TRACKS[track]
    rounds = -(-KILLS // len(TRACKS))
    draw = random.Random(f"{SEED} {track} {count}")
    write_questions(workspace.root / "questions", questions(SCENES, 4, ("SH", "OR", "VP")))
    ledger, names = Ledger(), () if count == 1 else FAULTS
    asked = rounds * (1 if count == 1 else 4) * (_ASKED_PER_EVENT + AT_ONCE)
    seeds, limits = list(range(asked // asked_per_seed + 2)), {"max_concurrency": AT_ONCE}
    workspace.write_suite(models=["alpha"], seeds=seeds, limits=limits, **fields)
    tally, under_way = Counter[str](), Counter[tuple[str, str]]()
    with contextlib.ExitStack() as stack:
        servers = []
        for n in range(count):
            fields = {"seed": 1 + SEED + n, "retry_after": "0", "latency_s": 0.03}
            faults = Faults(dict.fromkeys(names, 0.15 / len(FAULTS)), **fields)
            servers.append(stack.enter_context(Running(LedgerChat(faults, ledger=ledger))))
        bases = [f"{server.url}/v1" for server in servers]
        for _ in range(rounds):
            # The order of the addresses may change.
            order = draw.sample(bases, count)
            workspace.write_models("", "alpha", api_base=order, price=PRICE, max_tokens=1000)
            deaths, killed = run_until_killed(workspace, servers, ledger, draw, options)
            tally.update({"deaths of servers": deaths, "kills": killed})
            missing = ledger.that_came_to("reply") - on_disk(workspace)
            assert len(missing) <= AT_ONCE * (deaths + killed), "more is lost than was under way"
            under_way.update(missing)
            known_usd, unanswered = counted_usd(workspace)
            billed_usd = CALL_USD * sum(entry.comes_to == "reply" for entry in ledger)
            assert known_usd >= billed_usd - 1e-9, "less is known than was billed"
        for server in servers:
            server.come_back()
        done = workspace.run("--yes", *options)
        assert done.code == 0, done.out + done.err
        stored = workspace.records()
        assert len(stored) == len(by_sample(stored))
        assert not ledger.that_came_to("reply") - kept_in(workspace.out)
        replies = Counter(entry.key for entry in ledger if entry.comes_to == "reply")
        if count == 1:
            assert (f"{unanswered} call" in done.out) == (unanswered > 0)
            assert tally["kills"] == rounds, "a run ended before it was killed"
            twice = {key: times for key, times in replies.items() if times > 1 + under_way[key]}
            assert not twice, "asked again, though its reply stood on disk"
        again = sum(replies.values()) - len(replies)
        assert again <= AT_ONCE * (tally["deaths of servers"] + tally["kills"])
        tallies[f"kills, {track}, {count}"] = tally + Counter({"again": again}) + ledger.faults
        if options:
            workspace.out = workspace.root / "quiet"
            assert workspace.run("--yes", *options).code == 0
            assert by_sample(workspace.records()) == by_sample(stored)
