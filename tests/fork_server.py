"""Commands in processes of their own that need not import anything again.

`python -m tests.fork_server FD` imports the command line, and what it imports only when it is
needed, once. For each order at its socket it forks; the child takes over folder, environment,
limits and open files and calls `main` as the installed script does. All of its children have the
hash seed of the server: what is to be the same in every process is shown by processes that were
started one by one.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import gc
import importlib
import json
import os
import pkgutil
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, NoReturn

ONE_THREAD = {"OMP_NUM_THREADS": "1"}
"""The environment in which numerical libraries use one thread. Those of two tests that run at once
would wait for each other, busily, for most of their time.
"""

_ROOT = Path(__file__).parents[1]
_ORDER_BYTES = 1 << 20
_POLL_S = 0.01
_NOT_WRITTEN = 120
_MOST_MEMORY_BYTES = 8 * 2**30
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGING = {
    **dict.fromkeys(("os.remove", "os.rmdir", "os.mkdir", "os.truncate"), 1),
    **dict.fromkeys(("os.chmod", "os.chown", "shutil.rmtree", "sqlite3.connect"), 1),
    **dict.fromkeys(("os.rename", "os.symlink", "os.link"), 2),
}
"""Events that change files, and how many of their first arguments are paths."""

_PRELOADED = ("PIL.GifImagePlugin", "PIL.JpegPresets", "aiohttp", "matplotlib.backends.backend_agg",
              "matplotlib.backends.backend_svg", "matplotlib.pyplot", "pandas.core.methods.to_dict",
              "pandas.io.formats.csvs", "phyblock.run.runner", "phyblock.results.tables",
              "phyblock.sim.pybullet", "phyblock.web.report", "pyarrow.pandas_compat", "sqlite3",
              "yarl")  # fmt: skip


@dataclass(frozen=True)
class Done:
    """The end of a command."""

    code: int
    out: str
    err: str

    @property
    def errors(self) -> list[str]:
        """The messages on stderr, one a problem."""
        found: list[str] = []
        for line in self.err.splitlines():
            if line.startswith("error: "):
                found.append(line)
            elif found:
                found[-1] += "\n" + line
        return found


def small_files_only(limit_bytes: int) -> Callable[[], None]:
    """Return a first call of a process, after which it can write no larger file."""

    def apply() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    return apply


def killed(marks: Path, times: int) -> str:
    """Kill the process that this runs in, so many times; then work."""
    if len(list(marks.iterdir())) < times:
        (marks / str(os.getpid())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


class ForkServer:
    """The client's side."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._orders, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._home = tempfile.TemporaryDirectory()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.fork_server", str(theirs.fileno())],
                cwd=_ROOT,
                env={
                    "PATH": os.environ["PATH"],
                    "HOME": self._home.name,
                    "MPLCONFIGDIR": self._home.name,
                    **ONE_THREAD,
                },
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )

    def end(self) -> None:
        self._orders.close()
        self._process.wait()
        self._home.cleanup()

    def run(
        self,
        args: Sequence[str],
        cwd: Path,
        env: Mapping[str, str],
        bytes_left: int | None = None,
        timeout_s: float = 300,
        deeds: IO[bytes] | None = None,
    ) -> Done:
        """Run the command to its end; what it does to files and hosts is written to `deeds`."""
        watching = () if deeds is None else (deeds,)
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            files = (out, err, *watching)
            pid = self._fork(args, cwd, env, files, bytes_left=bytes_left, leads=False)
            code = self.wait(pid, timeout_s)
            texts = []
            for file in (out, err):
                file.seek(0)
                texts.append(file.read().decode(errors="replace" if watching else "strict"))
        return Done(code, *texts)

    def start(self, args: Sequence[str], cwd: Path, env: Mapping[str, str]) -> Forked:
        """Start the command and return at once; the process leads a group of its own."""
        pipes = [os.pipe() for _ in range(2)]
        reads = [os.fdopen(read, encoding="utf-8") for read, _ in pipes]
        writes = [os.fdopen(write, "wb") for _, write in pipes]
        pid = self._fork(args, cwd, env, writes, bytes_left=None, leads=True)
        for file in writes:
            file.close()
        return Forked(self, pid, *reads)

    def _fork(
        self,
        args: Sequence[str],
        cwd: Path,
        env: Mapping[str, str],
        files: Sequence[IO[bytes]],
        **options: Any,
    ) -> int:
        order = {"args": list(args), "cwd": str(cwd), "env": dict(env), **options}
        return int(self._answer(order, [file.fileno() for file in files]))

    def wait(self, pid: int, timeout_s: float) -> int:
        """The exit code once the process has ended; kills it when that takes too long."""
        end = time.monotonic() + timeout_s
        while (code := self.poll(pid)) is None:
            if time.monotonic() > end:
                os.kill(pid, signal.SIGKILL)
                raise subprocess.TimeoutExpired(["phyblock"], timeout_s)
            time.sleep(_POLL_S)
        return code

    def poll(self, pid: int) -> int | None:
        """The exit code, or None while the process runs; an order for each process to its end."""
        answer = self._answer({"ended": pid})
        return None if answer is None else int(answer)

    def _answer(self, order: Mapping[str, Any], files: Sequence[int] = ()) -> Any:
        with self._lock:
            socket.send_fds(self._orders, [json.dumps(order).encode()], files)
            return json.loads(self._orders.recv(_ORDER_BYTES))


class Forked:
    """A process that was started, as `subprocess.Popen` shows one."""

    def __init__(self, server: ForkServer, pid: int, out: IO[str], err: IO[str]) -> None:
        self._server = server
        self.pid = pid
        self.stdout, self.stderr = out, err
        self.returncode: int | None = None

    def __enter__(self) -> Forked:
        return self

    def __exit__(self, *_: object) -> None:
        self.wait()
        self.stdout.close()
        self.stderr.close()

    def poll(self) -> int | None:
        if self.returncode is None:
            self.returncode = self._server.poll(self.pid)
        return self.returncode

    def wait(self, timeout: float = 300) -> int:
        if self.returncode is None:
            self.returncode = self._server.wait(self.pid, timeout)
        return self.returncode

    def communicate(self, timeout: float = 300) -> tuple[str, str]:
        """Wait for its end; what it wrote, which must fit into the pipes."""
        self.wait(timeout)
        with self.stdout, self.stderr:
            return self.stdout.read(), self.stderr.read()

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


@functools.cache
def fork_server() -> ForkServer:
    """The one of this process; `end_fork_server` ends it."""
    return ForkServer()


def end_fork_server() -> None:
    if fork_server.cache_info().currsize:
        fork_server().end()
        fork_server.cache_clear()


def serve(orders: socket.socket) -> None:
    import phyblock.cli
    import phyblock.making.cli
    from phyblock.config.suite import suite_model
    from phyblock.models.litellm_client import _litellm
    from phyblock.records.files import known_records
    from phyblock.results.text import latex_template

    for module in pkgutil.iter_modules(phyblock.cli.__path__, "phyblock.cli."):
        importlib.import_module(module.name)
    for name in _PRELOADED:
        # Other Pythons have neither PyBullet nor what only development needs.
        with contextlib.suppress(ModuleNotFoundError):
            importlib.import_module(name)
    _litellm()
    suite_model()
    known_records()
    latex_template()
    gc.collect()
    gc.freeze()
    while True:
        text, files, _, _ = socket.recv_fds(orders, _ORDER_BYTES, 3)
        if not text:
            return
        order = json.loads(text)
        if "ended" in order:
            pid, status = os.waitpid(order["ended"], os.WNOHANG)
            answer = os.waitstatus_to_exitcode(status) if pid else None
        elif not (answer := os.fork()):
            orders.close()
            _become(order, files)
        for file in files:
            os.close(file)
        orders.send(json.dumps(answer).encode())


def _become(order: Mapping[str, Any], files: Sequence[int]) -> NoReturn:
    for number, (name, file) in enumerate(zip(("stdout", "stderr"), files, strict=False), 1):
        os.dup2(file, number)
        os.close(file)
        old = getattr(sys, name)
        # A stream remembers whether what it was opened on has a position.
        new = open(number, "w", encoding=old.encoding, errors=old.errors, closefd=False)  # noqa: SIM115
        new.reconfigure(line_buffering=name == "stderr")
        setattr(sys, name, new)
        setattr(sys, f"__{name}__", new)
    if order["leads"]:
        os.setsid()
    os.chdir(order["cwd"])
    os.environ.clear()
    os.environ.update(order["env"])
    tempfile.tempdir = None
    if order["bytes_left"] is not None:
        small_files_only(order["bytes_left"])()
    if len(files) > 2:
        sys.dont_write_bytecode = True
        resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY_BYTES, _MOST_MEMORY_BYTES))
        _watch_deeds(files[2])
    sys.argv = ["phyblock", *order["args"]]
    from phyblock.cli.main import main

    try:
        main()
    except SystemExit as ending:
        _exit(ending.code)
    raise AssertionError("main always exits")


def _watch_deeds(file: int) -> None:
    """Write every change to a file and every connection from now on as a line of JSON.

    Each is an audit event of Python's, and the path (its links followed) or the address that it is
    about. SQLite opens its files by itself; the event that names the database stands for them all.
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


def _exit(code: object) -> NoReturn:
    """As the interpreter exits, but without taking every module apart, which takes longest."""
    threading._shutdown()
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        code = _NOT_WRITTEN
    os._exit(code if isinstance(code, int) else int(code is not None))


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as ours:
        serve(ours)
