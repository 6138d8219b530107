"""Four servers of one model that fail, die and come back while runs are killed: the laws hold."""

from __future__ import annotations

import random
import signal
import time
from collections import Counter
from contextlib import ExitStack

import pytest

from tests.fuzz.ledger import Ledger, LedgerAgent, LedgerChat, kept_in
from tests.fuzz.sizes import KILLS, SEED
from tests.fuzz.test_fuzz_kills import AT_ONCE, TRACKS, on_disk
from tests.servers.chassis import Faults, Running
from tests.vqa_set import questions, write_questions
from tests.workspace import SCENES, Workspace

_FAULTS = ("429", "500", "reset", "cut", "html", "empty")
_SHARE = 0.15
_LATENCY_S = 0.03
_ASKED_PER_SEED = {"full_planning": 5, "vqa": 8, "step_planning": 30}
_ASKED_PER_EVENT = 8
_EVENTS_PER_ROUND = 4
_LONGEST_ROUND_S = 120.0


def wait_for_more(ledger: Ledger, count: int, is_over: object) -> bool:
    """Wait until so many more requests came; whether they did before the run was over."""
    target = len(ledger.entries) + count
    give_up_s = time.monotonic() + _LONGEST_ROUND_S
    while len(ledger.entries) < target:
        assert time.monotonic() < give_up_s, "the run hangs"
        if is_over() is not None:  # type: ignore[operator]
            return False
        time.sleep(0.002)
    return True


def one_round(
    workspace: Workspace, servers: list[Running], ledger: Ledger, draw: random.Random
) -> tuple[int, int]:
    """A run in which servers die and come back, and that is killed; how many deaths of each."""
    deaths = 0
    with workspace.start() as process:
        for _ in range(_EVENTS_PER_ROUND):
            if not wait_for_more(ledger, draw.randrange(1, _ASKED_PER_EVENT), process.poll):
                break
            alive = [server for server in servers if server.is_alive]
            dead = [server for server in servers if not server.is_alive]
            if dead and (len(alive) == 1 or draw.random() < 0.4):
                draw.choice(dead).come_back()
            else:
                draw.choice(alive).die()
                deaths += 1
        process.kill()
        process.communicate()
    killed = process.returncode == -signal.SIGKILL
    seen = -1
    while any(server.server.at_once for server in servers) or seen != len(ledger.entries):
        seen = len(ledger.entries)
        time.sleep(0.05)
    return deaths, int(killed)


@pytest.mark.fuzz
@pytest.mark.slow
@pytest.mark.parametrize("track", TRACKS)
def test_servers_die_and_runs_are_killed(
    workspace: Workspace, tallies: dict[str, Counter[str]], track: str
) -> None:
    rounds = -(-KILLS // len(TRACKS))
    draw = random.Random(f"{SEED} {track} replicas")
    write_questions(workspace.root / "questions", questions(SCENES, 4, ("SH", "CO")))
    ledger = Ledger()
    kind = LedgerAgent if track == "step_planning" else LedgerChat
    tally: Counter[str] = Counter()
    with ExitStack() as stack:
        servers = [
            stack.enter_context(
                Running(
                    kind(
                        Faults.spread(
                            _FAULTS, _SHARE, seed=1 + SEED + n, retry_after="0",
                            latency_s=_LATENCY_S,
                        ),
                        ledger=ledger,
                    )
                )
            )
            for n in range(4)
        ]  # fmt: skip
        seeds = range(2 + rounds * _EVENTS_PER_ROUND * _ASKED_PER_EVENT // _ASKED_PER_SEED[track])
        fields = {"images": {"size_px": 128}, **TRACKS[track]}
        limits = {"max_concurrency": AT_ONCE}
        workspace.write_suite(
            **{**fields, "models": ["alpha"], "seeds": list(seeds), "limits": limits}
        )
        bases = [f"{server.url}/v1" for server in servers]
        for _ in range(rounds):
            # The order of the addresses may change.
            fields = {"api_base": draw.sample(bases, 4)}
            workspace.write_models("", "alpha", **fields)
            deaths, killed = one_round(workspace, servers, ledger, draw)
            tally.update({"deaths of servers": deaths, "kills": killed})
            missing = ledger.answered() - on_disk(workspace)
            assert len(missing) <= AT_ONCE * (deaths + killed), "more is lost than was under way"
        for server in servers:
            server.come_back()
        done = workspace.run("--yes")
    assert done.code == 0, done.out + done.err
    assert not ledger.answered() - kept_in(workspace.out)
    replies = Counter(entry.key for entry in ledger.entries if entry.comes_to == "reply")
    again = sum(replies.values()) - len(replies)
    assert again <= AT_ONCE * (tally["deaths of servers"] + tally["kills"])
    tally.update({"asked again": again, **ledger.faults})
    tallies[f"replicas, {track}"] = tally
