"""Worker processes: what they answer, how they end, and what they leave alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from operator import truediv
from pathlib import Path

import pytest

from phyblock.errors import DataError, Problem
from phyblock.workers import WorkerDiedError, WorkerPool


def fail(where: str) -> None:
    raise DataError(Problem(where, "is broken"))


def die(_: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_jobs_give_what_functions_give_or_raise() -> None:
    with WorkerPool(2) as pool:
        assert list(pool.map(truediv, range(20), [4] * 20)) == [n / 4 for n in range(20)]
        with pytest.raises(ZeroDivisionError) as caught:
            pool.submit(truediv, 1, 0).result()
        assert "in _serve" in str(caught.value.__cause__)
        with pytest.raises(DataError, match="here: is broken") as broken:
            pool.submit(fail, "here").result()
        assert broken.value.problems == (Problem("here", "is broken"),)


def test_a_process_that_is_killed_fails_its_own_job_alone() -> None:
    with WorkerPool(2) as pool:
        jobs: list[Future[object]] = [
            pool.submit(die if n == 3 else abs, -n)  # type: ignore[arg-type]
            for n in range(8)
        ]
        done = [job.exception() or job.result() for job in jobs]
    assert isinstance(done.pop(3), WorkerDiedError)
    assert done == [0, 1, 2, 4, 5, 6, 7]


def test_processes_that_are_killed_answer_nothing() -> None:
    pool = WorkerPool(2)
    job = pool.submit(time.sleep, 600)
    assert pool.submit(abs, -1).result() == 1
    pool.kill()
    with pytest.raises(WorkerDiedError):
        job.result()
    pool.shutdown()


UNGUARDED = """
import os, sys, threading, time
main = sys.modules["__main__"]
seen = set()
def look():
    while True:
        seen.add(sys.modules["__main__"])
threading.Thread(target=look, daemon=True).start()
from phyblock.workers import WorkerPool
pool = WorkerPool(1)
pid = pool.submit(os.getpid).result()
assert seen == {main}
print("begun", pid, flush=True)
pool.submit(time.sleep, 600).result()
"""


def test_a_program_without_a_guard_runs_once_and_takes_its_workers_with_it(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(UNGUARDED)
    words = [sys.executable, str(tmp_path / "program.py")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        begun, pid = program.stdout.readline().split()
        assert begun == "begun"
        assert os.getpgid(int(pid)) != os.getpgid(program.pid)
        program.kill()
        # The worker holds the pipe open: it ends when the worker has.
        assert program.stdout.read() == ""
