"""Thousands of commands, each through the installed script's `main`, in one process.

`python -m tests.fuzz.worker` reads one order a line (JSON) and answers one line when the command
has ended: its exit code, and what it did to files and to whom it connected. A command that hangs,
or that ends the process, ends it for itself alone: the client starts another.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import pkgutil
import resource
import selectors
import subprocess
import sys
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fork_server import Done
from tests.fuzz.deeds import Deed, watch_deeds

__all__ = ["LONGEST_S", "Ended", "Worker"]

LONGEST_S = 30.0
"""A command on small files that is not done by then hangs [s]."""

_MOST_MEMORY_BYTES = 8 * 2**30
_READY = b"ready\n"
_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Ended:
    """The end of a command: code None where it hung, negative where a signal ended the process."""

    code: int | None
    out: str
    err: str
    deeds: tuple[Deed, ...] = ()

    @property
    def done(self) -> Done:
        """As of a command that was run by itself."""
        return Done(-1 if self.code is None else self.code, self.out, self.err)


class Worker:
    """The client's side; a context manager."""

    def __init__(self, scratch: Path, longest_s: float = LONGEST_S) -> None:
        self._longest_s = longest_s
        self._out, self._err = scratch / "stdout", scratch / "stderr"
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def phyblock(
        self,
        args: list[str],
        cwd: Path,
        env: Mapping[str, str],
        longest_s: float | None = None,
    ) -> Ended:
        """Run the command to its end, or for its longest time."""
        process = self._process = self._process or self._start()
        order = {"args": args, "cwd": str(cwd), "env": dict(env),
                 "out": str(self._out), "err": str(self._err)}  # fmt: skip
        assert process.stdin is not None
        process.stdin.write(json.dumps(order).encode() + b"\n")
        process.stdin.flush()
        answer = self._answer(process, longest_s or self._longest_s)
        code, deeds = None, []
        if answer:
            code, deeds = json.loads(answer)
        else:
            code = None if answer is None else process.wait()
            self._end()
        out, err = (path.read_bytes().decode("utf-8", "replace") for path in (self._out, self._err))
        return Ended(code, out, err, tuple(Deed(*deed) for deed in deeds))

    def _start(self) -> subprocess.Popen[bytes]:
        """A worker that has imported everything."""
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=_ROOT,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        )
        assert process.stdout is not None
        assert process.stdout.readline() == _READY
        return process

    @staticmethod
    def _answer(process: subprocess.Popen[bytes], longest_s: float) -> bytes | None:
        """The line that the worker answers; empty where it died, None where it hangs."""
        assert process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            return process.stdout.readline() if selector.select(longest_s) else None

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def serve() -> None:
    """Answer orders until there are no more."""
    import phyblock.cli
    import phyblock.making.cli
    from phyblock.cli.main import main

    for package in (phyblock.cli, phyblock.making.cli):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY_BYTES, _MOST_MEMORY_BYTES))
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    orders = os.fdopen(os.dup(0), encoding="utf-8")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    deeds = watch_deeds()
    print(_READY.decode(), end="", file=answers, flush=True)
    for line in orders:
        order = json.loads(line)
        with _taken_over(order):
            deeds.clear()
            code = _code_of(main)
            done = list(deeds)
        print(json.dumps([code, done]), file=answers, flush=True)


@contextlib.contextmanager
def _taken_over(order: Mapping[str, Any]) -> Iterator[None]:
    """The order's folder, environment, arguments and files for output."""
    for number, name in ((1, "out"), (2, "err")):
        file = os.open(order[name], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, number)
        os.close(file)
    os.chdir(order["cwd"])
    os.environ.clear()
    os.environ.update(order["env"])
    sys.argv = ["phyblock", *order["args"]]
    yield
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os.chdir(_ROOT)


def _code_of(main: Any) -> int:
    """The exit code that the interpreter gives for what `main` raises, a traceback included."""
    try:
        main()
    except SystemExit as ending:
        return ending.code if isinstance(ending.code, int) else int(ending.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    serve()
