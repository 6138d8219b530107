"""Leases end with their process where that can be told, and with time where it cannot."""

from __future__ import annotations

import contextlib
import os
import signal
import sqlite3
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.models import ReplyCache, holder
from phyblock.models.holder import holder_name, is_holder_gone
from phyblock.models.leases import LEASE_S, Leases

ROOT = Path(__file__).parents[2]
HOLDING = """
import sqlite3, sys, time
from phyblock.models.leases import Leases
leases = Leases(sqlite3.connect(sys.argv[1], isolation_level=None))
assert leases.take("k")
print("taken", flush=True)
time.sleep(600)
"""
tells_processes_apart = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="only Linux tells when a process of a name ended"
)


@pytest.fixture
def db(tmp_path: Path) -> Iterator[sqlite3.Connection]:
    ReplyCache(tmp_path / "c.sqlite").close()
    with contextlib.closing(sqlite3.connect(tmp_path / "c.sqlite", isolation_level=None)) as db:
        yield db


@contextlib.contextmanager
def holding(path: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that holds the lease of "k"."""
    command = [sys.executable, "-c", HOLDING, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "taken\n"
            yield process
        finally:
            process.kill()


def wait_for(has_come: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 20
    while not has_come():
        assert time.monotonic() < end_s
        time.sleep(0.005)


def state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]


@tells_processes_apart
def test_a_lease_ends_with_its_process_and_not_while_it_stands_still(
    db: sqlite3.Connection, tmp_path: Path
) -> None:
    with holding(tmp_path / "c.sqlite") as process:
        # A clock that stands: what ends the lease is not time.
        (until_s,) = db.execute("SELECT until FROM leases").fetchone()
        leases = Leases(db, lambda: until_s - LEASE_S / 2)
        assert leases.take("k") is None
        process.send_signal(signal.SIGSTOP)
        wait_for(lambda: state(process.pid) == "T")
        assert leases.take("k") is None
        process.kill()
        wait_for(lambda: state(process.pid) == "Z")
        assert not leases.is_taken("k")
        process.wait()
        assert not leases.is_taken("k")
        assert leases.take("k") is not None


def of_another_start(name: str) -> str:
    """The name of a process that had this one's id before it."""
    realm, pid, start = name.split()
    return f"{realm} {pid} {int(start) + 1}"


@tells_processes_apart
def test_a_process_is_told_from_another_of_its_id() -> None:
    name = holder_name()
    assert not is_holder_gone(name)
    assert is_holder_gone(of_another_start(name))
    with subprocess.Popen(["true"]) as ended:
        pass
    assert is_holder_gone(name.replace(f" {os.getpid()} ", f" {ended.pid} "))


@tells_processes_apart
@given(st.data())
def test_nothing_is_known_of_a_process_elsewhere(data: st.DataObject) -> None:
    """Another boot or machine, other namespaces: one letter is enough."""
    realm, _, rest = of_another_start(holder_name()).partition(" ")
    at = data.draw(st.integers(0, len(realm) - 1))
    other = data.draw(st.characters().filter(lambda letter: letter != realm[at]))
    assert not is_holder_gone(f"{realm[:at]}{other}{realm[at + 1 :]} {rest}")


@given(st.one_of(st.text(), st.from_regex(r"\S+ \d+ \d+")))
def test_what_names_no_process_is_never_taken_for_an_ended_one(name: str) -> None:
    assert not is_holder_gone(name)


@pytest.mark.parametrize("name", ["", " ", " b/pid:[1] 7 7", " of a later form"])
def test_a_lease_that_names_no_known_process_ends_with_time(
    db: sqlite3.Connection, name: str
) -> None:
    """As the leases of earlier versions, which named none."""
    now_s = 1000.0
    leases = Leases(db, lambda: now_s)
    assert leases.take("k") is not None
    db.execute("UPDATE leases SET owner = ?", (uuid.uuid4().hex + name,))
    now_s += LEASE_S - 1
    assert leases.take("k") is None
    now_s += 2
    assert leases.take("k") is not None


def test_where_the_system_cannot_tell_processes_apart_none_is_taken_for_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = holder_name()
    monkeypatch.setattr(holder, "_PROC", tmp_path)
    assert holder_name() == ""
    # The /proc of another namespace, then one that hides the processes of others.
    (tmp_path / "sys/kernel/random").mkdir(parents=True)
    (tmp_path / "sys/kernel/random/boot_id").write_text("b-o-o-t\n", encoding="ascii")
    for pid, realm in ((os.getppid(), ""), (os.getpid(), "b-o-o-t/pid:[1]")):
        (tmp_path / f"{pid}/ns").mkdir(parents=True)
        (tmp_path / f"{pid}/ns/pid").symlink_to("pid:[1]")
        (tmp_path / "self").unlink(missing_ok=True)
        (tmp_path / "self").symlink_to(str(pid))
        assert holder._realm() == realm
        assert holder_name() == ""
        assert not is_holder_gone(f"b-o-o-t/pid:[1] {os.getpid()} 7")
        assert not is_holder_gone(name)
