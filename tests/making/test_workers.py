"""Workers: tasks on a Ray cluster (extra `phyblock[ray]`), and the end of their processes."""

from __future__ import annotations

import importlib.util
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import psutil
import pytest

from phyblock.errors import InputError
from phyblock.making.scenes.production import Order, Share, produce
from phyblock.making.workers import open_workers

ORDER = Order(3, "kit", (Share("1", 3, 1), Share("2", 4, 2), Share("3", 2, 1)))
_IDLE = re.compile("IDLE|Agent")
HAS_RAY = importlib.util.find_spec("ray") is not None


def ray_workers() -> list[psutil.Process]:
    """Worker processes of the cluster that this test started."""
    found = []
    for process in psutil.Process().children(recursive=True):
        try:
            if process.name().startswith("ray::") and not _IDLE.search(process.name()):
                found.append(process)
        except psutil.NoSuchProcess:
            continue
    return found


def squares(workers, killed: list[int]) -> Iterator[int]:
    def slowly(task: int) -> int:
        time.sleep(0.2)
        return task * task

    for count, answer in enumerate(workers.map(slowly, range(30))):
        if count == 5:
            busy = ray_workers()
            assert busy
            killed.append(busy[0].pid)
            busy[0].kill()
        yield answer


@pytest.mark.slow
@pytest.mark.skipif(not HAS_RAY, reason="Ray is not installed: pip install 'phyblock[ray]'")
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_and_doubles_nothing() -> None:
    with open_workers() as workers:
        expected = list(produce(ORDER, workers))
    killed: list[int] = []
    with open_workers(2, "local") as workers:
        assert list(squares(workers, killed)) == [n * n for n in range(30)]
        assert len(killed) == 1
        found = []
        for scene in produce(ORDER, workers):
            found.append(scene)
            if len(found) == 5 and (busy := ray_workers()):
                killed.append(busy[0].pid)
                busy[0].kill()
    assert found == expected


@pytest.mark.skipif(HAS_RAY, reason="Ray is installed")
def test_without_ray_the_extra_is_named() -> None:
    with pytest.raises(InputError, match=r"phyblock\[ray\]"), open_workers(2, "local"):
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
    sent: signal.Signals, tmp_path: os.PathLike[str]
) -> None:
    script = os.path.join(tmp_path, "work.py")
    for name, text in (("work.py", WORK), ("tasks.py", TASKS)):
        with open(os.path.join(tmp_path, name), "w", encoding="utf-8") as file:
            file.write(text)
    with subprocess.Popen(
        [sys.executable, script],
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
