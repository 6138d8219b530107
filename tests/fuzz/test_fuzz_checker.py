"""The check of the laws itself: phyblock is broken on purpose, and each breach must be seen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fuzz.bench import Bench, Case
from tests.fuzz.ledger import Entry, LedgerChat, asked_twice, kept_in, lost
from tests.fuzz.worker import Worker
from tests.servers.chassis import Running
from tests.workspace import Workspace

SOUND = Case(
    ("run", "suite.yaml", "--out", "out", "--no-report", "--models", "random,oracle"),
    may_write=("out",),
    lasting=("out/report/ch1/thesis.tex", "thesis/ch1.tex"),
)
BREACHES = {
    "raises-what-nobody-expects": "law 1: traceback of KeyError",
    "ends-with-a-code-of-its-own": "law 1: exit code 3",
    "says-nothing": "law 1: exit code 2 without a message",
    "dies": "law 1: exit code -6",
    "writes-at-home": "law 2: a file was made",
    "writes-and-tidies-up": "law 2: open elsewhere",
    "deletes-what-is-not-its-own": "law 2: a file was deleted",
    "calls-home": "law 2: a connection",
    "drops-earlier-records": "law 3: a line of records.jsonl is lost",
}
ASKING = {
    "": set(),
    "keeps-nothing-of-some-replies": {"a reply is lost"},
    "asks-what-is-answered": {"asked twice"},
    "sends-twice": {"asked twice"},
}

MakeBench = Callable[[Worker], Bench]


@pytest.fixture
def bench_with(ended: Workspace, pictures_dir: Path, tmp_path: Path) -> MakeBench:
    """A bench beside finished runs, with a worker of its own."""
    (tmp_path / "root").mkdir()
    return lambda worker: Bench(worker, ended.root, pictures_dir, tmp_path / "root")


def test_a_sound_command_breaks_no_law(runs_bench: Bench) -> None:
    assert runs_bench.broken(SOUND) == []


@pytest.mark.fuzz
@pytest.mark.slow
@pytest.mark.parametrize("sabotage", BREACHES)
def test_each_breach_is_seen(bench_with: MakeBench, tmp_path: Path, sabotage: str) -> None:
    with Worker(tmp_path, sabotage) as worker:
        found = bench_with(worker).broken(SOUND)
    assert any(BREACHES[sabotage] in broken.name for broken in found), found


@pytest.mark.fuzz
@pytest.mark.slow
def test_a_command_that_hangs_is_seen(bench_with: MakeBench, tmp_path: Path) -> None:
    with Worker(tmp_path, "hangs", longest_s=3.0) as worker:
        (broken,) = bench_with(worker).broken(SOUND)
    assert broken.name == "law 1: it hangs"


@pytest.mark.fuzz
@pytest.mark.slow
@pytest.mark.parametrize("sabotage", ASKING)
def test_each_breach_in_asking_is_seen(
    workspace: Workspace, tmp_path_factory: pytest.TempPathFactory, sabotage: str
) -> None:
    with (
        Running(LedgerChat()) as running,
        Worker(tmp_path_factory.mktemp("worker"), sabotage) as worker,
    ):
        server = running.server
        assert isinstance(server, LedgerChat)
        workspace.write_models(running.url, "alpha", transport="direct")
        workspace.write_suite(models=["alpha"])
        for _ in range(2):
            args = ["run", "suite.yaml", "--out", "out", "--no-report"]
            assert worker.phyblock(args, workspace.root, workspace.env).code in (0, 1)
    found = [*asked_twice(server.ledger.entries), *lost(server.ledger, kept_in(workspace.out))]
    assert {broken.kind for broken in found} == ASKING[sabotage]


def test_the_ledger_tells_what_may_be_asked_again() -> None:
    failed, answered = Entry("m", "a", "500"), Entry("m", "a", "ok")
    refused, other = Entry("m", "b", "400"), Entry("n", "a", "ok")
    assert not list(asked_twice([failed, failed, answered, refused, other]))
    assert len(list(asked_twice([answered, failed]))) == 1
    assert len(list(asked_twice([answered, answered, answered]))) == 2
    assert len(list(asked_twice([refused, refused]))) == 1
    assert not list(asked_twice([refused, refused], retries_refused=True))
