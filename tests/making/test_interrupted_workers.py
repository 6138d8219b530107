"""Ctrl-C and kill -9 end the work of several processes at once, and leave none behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

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
