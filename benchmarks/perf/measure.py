"""Running a command as a whole process tree: wall time, CPU time and peak memory; local servers."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import psutil

ROOT = Path(__file__).parents[2]
_EVERY_S = 0.05


@dataclass(frozen=True)
class Cost:
    """Wall and CPU seconds, and the peak of resident memory summed over the tree [MB]."""

    wall_s: float
    cpu_s: float
    peak_mb: float


def run_measured(command: Sequence[str], env: Mapping[str, str]) -> Cost:
    """Run a command to its end; exit with its output when it fails."""
    # Into a file: nobody reads a pipe meanwhile, and a full one would hold the command up.
    with tempfile.TemporaryFile("w+") as output:
        start = time.perf_counter()
        process = subprocess.Popen(command, env=dict(env), stdout=output, stderr=subprocess.STDOUT)
        root = psutil.Process(process.pid)
        peak = 0
        cpu: dict[int, float] = {}
        while process.poll() is None:
            peak = max(peak, _sample(root, cpu))
            time.sleep(_EVERY_S)
        wall_s = time.perf_counter() - start
        if process.returncode:
            output.seek(0)
            said = output.read()
            sys.exit(f"{' '.join(command)} failed ({process.returncode}):\n{said}")
    return Cost(wall_s, sum(cpu.values()), peak / 1e6)


def served(stack: ExitStack, module: str, *options: str) -> str:
    """Return the address of a new server of `tests.servers`, which ends with the stack."""
    server = subprocess.Popen(
        [sys.executable, "-m", f"tests.servers.{module}", *options],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    stack.callback(server.wait)
    stack.callback(server.terminate)
    assert server.stdout is not None
    return f"http://127.0.0.1:{int(server.stdout.readline())}/v1"


def _sample(root: psutil.Process, cpu: dict[int, float]) -> int:
    """Return the resident memory of the tree [bytes]; note the CPU time of each process."""
    resident = 0
    try:
        tree = [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return 0
    for process in tree:
        try:
            times = process.cpu_times()
            cpu[process.pid] = times.user + times.system
            resident += process.memory_info().rss
        except psutil.NoSuchProcess:
            continue
    return resident
