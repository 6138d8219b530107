"""Many short commands, each in a process of its own that need not import anything again.

`python -m tests.fork_server` imports the command line once. For each line of JSON on stdin it
forks; the child takes over folder, environment, limits and output files and calls `main` as the
installed script does, the parent waits and prints the exit code.
"""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import phyblock.cli
import phyblock_making.cli
from tests.workspace import Done, small_files_only


class ForkServer:
    """The client's side; a context manager."""

    def __enter__(self) -> ForkServer:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.fork_server"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[1],
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def phyblock(
        self,
        args: list[str],
        cwd: Path,
        env: Mapping[str, str],
        scratch: Path,
        bytes_left: int | None,
    ) -> Done:
        """Run the command to its end; its output passes through files in `scratch`."""
        out, err = scratch / "stdout", scratch / "stderr"
        order = {
            "args": args,
            "cwd": str(cwd),
            "env": dict(env),
            "out": str(out),
            "err": str(err),
            "bytes_left": bytes_left,
        }
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        code = int(self._process.stdout.readline())
        return Done(code, out.read_text(encoding="utf-8"), err.read_text(encoding="utf-8"))


def serve() -> None:
    for package in (phyblock.cli, phyblock_making.cli):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            _become(json.loads(line))
        _, status = os.waitpid(pid, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _become(order: dict[str, object]) -> None:
    """Never returns."""
    for number, name in ((1, "out"), (2, "err")):
        file = os.open(str(order[name]), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, number)
        os.close(file)
    os.close(0)
    os.open(os.devnull, os.O_RDONLY)
    os.chdir(str(order["cwd"]))
    os.environ.clear()
    os.environ.update(order["env"])  # type: ignore[arg-type]
    if order["bytes_left"] is not None:
        small_files_only(int(str(order["bytes_left"])))()
    sys.argv = ["phyblock", *order["args"]]  # type: ignore[misc]
    from phyblock.cli.main import main

    main()


if __name__ == "__main__":
    serve()
