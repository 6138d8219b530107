"""Workers: the end of their processes, and a Ray cluster (extra `phyblock[ray]`)."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from phyblock.errors import InputError
from phyblock.making.scenes.production import Share, produce
from phyblock.making.workers import open_workers

SHARES = (Share("1", 3, 1), Share("2", 4, 2), Share("3", 2, 1))
HAS_RAY = importlib.util.find_spec("ray") is not None


def killed_once(mark: str) -> int:
    """Kill the process that works on it, but for the second time."""
    try:
        Path(mark).touch(exist_ok=False)
    except FileExistsError:
        return os.getpid()
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


@pytest.mark.slow
@pytest.mark.skipif(not HAS_RAY, reason="Ray is not installed: pip install 'phyblock[ray]'")
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_and_doubles_nothing(tmp_path: Path) -> None:
    with open_workers() as workers:
        expected = list(produce(3, "kit", SHARES, workers))
    with open_workers(2, "local") as workers:
        marks = [str(tmp_path / str(number)) for number in range(3)]
        assert len(list(workers.map(killed_once, marks))) == 3
        assert list(produce(3, "kit", SHARES, workers)) == expected


def test_no_ray_and_no_cluster_are_told() -> None:
    with pytest.raises(InputError, match="--ray"), open_workers(2, "127.0.0.1:1"):
        pass


# A task says its process and stays; the first line tells that both are at work. Workers know the
# functions of modules, not those of the program itself.
TASKS = """
import time, os

def stay(n):
    os.write(1, f"{os.getpid()}\\n".encode())
    time.sleep(60)
"""
WORK = """
import sys
from phyblock.making.workers import open_workers
from tasks import stay

try:
    with open_workers(2) as workers:
        list(workers.map(stay, range(2)))
except KeyboardInterrupt:
    sys.exit(130)
"""


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_workers_end_with_the_process_that_started_them(
    sent: signal.Signals, tmp_path: Path
) -> None:
    for name, text in (("work.py", WORK), ("tasks.py", TASKS)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "work.py")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        workers = [int(process.stdout.readline()) for _ in range(2)]
        if sent == signal.SIGINT:
            os.killpg(process.pid, sent)
        else:
            process.kill()
        _, errors = process.communicate(timeout=30)
    assert b"Traceback" not in errors
    assert process.returncode == (130 if sent == signal.SIGINT else -signal.SIGKILL)
    until = time.monotonic() + 30
    while any(map(is_alive, workers)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(is_alive, workers))
