"""Commands in processes of their own that need not import anything again: the standard library's
fork server imports `tests.preloaded` once, and a child calls `main` as the installed script does.
All have the hash seed of the server.
"""

from __future__ import annotations

import atexit
import functools
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing import forkserver, get_context
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import IO, Any, NoReturn
from unittest import mock

ONE_THREAD = {"OMP_NUM_THREADS": "1"}
"""The environment in which numerical libraries use one thread. Those of two tests that run at once
would wait for each other, busily, for most of their time.
"""

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGING = {
    **dict.fromkeys(("os.remove", "os.rmdir", "os.mkdir", "os.truncate"), 1),
    **dict.fromkeys(("os.chmod", "os.chown", "shutil.rmtree", "sqlite3.connect"), 1),
    **dict.fromkeys(("os.rename", "os.symlink", "os.link"), 2),
}
"""Events that change files, and how many of their first arguments are paths."""


@dataclass(frozen=True)
class Done:
    """The end of a command: code None where it hung, negative where a signal ended the process."""

    code: int | None
    out: str
    err: str


def killed(marks: Path, times: int) -> str:
    """Kill the process that this runs in, so many times; then work."""
    if len(list(marks.iterdir())) < times:
        (marks / str(os.getpid())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


class Forked:
    """A command that was started, as `subprocess.Popen` shows one; it leads a group of its own, can
    write `bytes_left` to a file, and what it does to files and hosts is written to `deeds`.
    """

    def __init__(
        self,
        args: Sequence[str],
        cwd: Path,
        env: Mapping[str, str],
        bytes_left: int | None = None,
        deeds: IO[bytes] | None = None,
    ) -> None:
        pipes = [os.pipe() for _ in range(2)]
        self.stdout, self.stderr = (
            os.fdopen(read, encoding="utf-8", errors="replace" if deeds else "strict")
            for read, _ in pipes
        )
        ends = [Connection(write, readable=False) for _, write in pipes]
        if deeds is not None:
            ends.append(Connection(os.dup(deeds.fileno()), readable=False))
        order = (list(args), str(cwd), dict(env), bytes_left, ends)
        self._process = _context().Process(target=_become, args=order)
        self._process.start()
        for end in ends:
            end.close()
        self.pid: int = self._process.pid

    def __enter__(self) -> Forked:
        return self

    def __exit__(self, *_: object) -> None:
        self.wait()
        self.stdout.close()
        self.stderr.close()

    def poll(self) -> int | None:
        return self._process.exitcode

    returncode = property(poll)

    def wait(self, timeout: float = 300) -> int:
        """The exit code once it has ended; kills it when that takes too long."""
        self._process.join(timeout)
        if self.poll() is None:
            self._process.kill()
            raise subprocess.TimeoutExpired(["phyblock"], timeout)
        return self.returncode

    def communicate(self, timeout: float = 300) -> tuple[str, str]:
        """Wait for its end; what it wrote."""
        with ThreadPoolExecutor() as pool, self.stdout, self.stderr:
            out, err = (pool.submit(stream.read) for stream in (self.stdout, self.stderr))
            self.wait(timeout)
            return out.result(), err.result()

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def run_forked(*args: Any, timeout_s: float = 300, **options: Any) -> Done:
    """Run the command of a `Forked` to its end."""
    process = Forked(*args, **options)
    texts = process.communicate(timeout_s)
    return Done(process.returncode, *texts)


@functools.cache
def _context() -> ForkServerContext:
    """Return the context whose server was started with what tests import."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["tests.preloaded"])
    root = str(Path(__file__).parents[1])
    with mock.patch.dict(os.environ, {"PYTHONPATH": root, **ONE_THREAD}):
        forkserver.ensure_running()
    return context


def _become(
    args: list[str], cwd: str, env: dict[str, str], bytes_left: int | None, ends: list[Connection]
) -> NoReturn:
    for number, (name, end) in enumerate(zip(("stdout", "stderr"), ends, strict=False), 1):
        os.dup2(end.fileno(), number)
        end.close()
        old = getattr(sys, name)
        # A stream remembers whether what it was opened on has a position.
        new = open(number, "w", encoding=old.encoding, errors=old.errors, closefd=False)  # noqa: SIM115
        new.reconfigure(line_buffering=name == "stderr")
        setattr(sys, name, new)
        setattr(sys, f"__{name}__", new)
    os.setsid()
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(env)
    tempfile.tempdir = None
    if bytes_left is not None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, bytes_left))
    if len(ends) > 2:
        sys.dont_write_bytecode = True
        resource.setrlimit(resource.RLIMIT_AS, (8 * 2**30, 8 * 2**30))
        _watch_deeds(ends[2].fileno())
    sys.argv = ["phyblock", *args]
    from phyblock.cli.main import main

    code: object = "main always exits"
    try:
        main()
    except SystemExit as ending:
        code = ending.code
    # As the interpreter exits, but without taking every module apart, which takes longest.
    threading._shutdown()
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        code = 120
    os._exit(code if isinstance(code, int) else int(code is not None))


def _watch_deeds(file: int) -> None:
    """Write every change to a file and every connection from now on as a line of JSON: an audit
    event of Python's, and the path (its links followed) or the address that it is about.
    """

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        abouts = []
        if event == "open":
            path, _, flags = arguments
            if flags & _WRITING and not isinstance(path, int):
                abouts = [os.path.realpath(os.fsdecode(path))]
        elif event == "socket.connect":
            abouts = [repr(arguments[1])]
        elif event in _CHANGING:
            paths = [path for path in arguments[: _CHANGING[event]] if not isinstance(path, int)]
            # The entry that a path names, even where that is a link.
            ends = [os.path.split(os.fsdecode(path).rstrip("/")) for path in paths]
            abouts = [os.path.join(os.path.realpath(above or "."), name) for above, name in ends]
        for about in abouts:
            os.write(file, json.dumps([event, about]).encode() + b"\n")

    sys.addaudithook(hook)
