"""Ways to break phyblock on purpose, each against one law: a check that misses one is worthless.

Each is a function that changes the product inside a worker, and nowhere else.
"""

from __future__ import annotations

import itertools
import os
import shutil
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["SABOTAGES"]


def _raises_what_nobody_expects() -> None:
    """Law 1: a KeyError goes up to the interpreter."""
    from phyblock.cli import run

    def load_suite(*_: Any, **__: Any) -> None:
        raise KeyError("models")

    run.load_suite = load_suite  # type: ignore[assignment]


def _ends_with_a_code_of_its_own() -> None:
    """Law 1: an exit code that is not documented."""
    from phyblock.cli import run

    run.load_suite = lambda *_, **__: sys.exit(3)  # type: ignore[assignment]


def _says_nothing() -> None:
    """Law 1: exit code 2, and no word why."""
    from phyblock.cli import run

    run.load_suite = lambda *_, **__: sys.exit(2)  # type: ignore[assignment]


def _dies() -> None:
    """Law 1: the process ends as by a crash of a library."""
    from phyblock.cli import run

    run.load_suite = lambda *_, **__: os.abort()  # type: ignore[assignment]


def _hangs() -> None:
    """Law 1: a command never ends."""
    from phyblock.cli import run

    run.load_suite = lambda *_, **__: time.sleep(3600)  # type: ignore[assignment]


def _after_load(deed: Callable[[], object]) -> None:
    from phyblock.cli import run

    load_suite = run.load_suite

    def loads_and_more(*args: Any, **options: Any) -> Any:
        deed()
        return load_suite(*args, **options)

    run.load_suite = loads_and_more


def _writes_at_home() -> None:
    """Law 2: a file is made in the home folder."""
    _after_load(lambda: Path("~/.phyblock").expanduser().write_text("hello", encoding="utf-8"))


def _writes_and_tidies_up() -> None:
    """Law 2: a file is made outside and taken away again, so that no look afterwards finds it."""

    def come_and_go() -> None:
        Path("../passing").write_text("hello", encoding="utf-8")
        Path("../passing").unlink()

    _after_load(come_and_go)


def _deletes_what_is_not_its_own() -> None:
    """Law 2: a folder of the user's is removed from the run folder."""
    _after_load(lambda: shutil.rmtree("out/report", ignore_errors=True))


def _calls_home() -> None:
    """Law 2: a connection to somewhere else."""

    def call() -> None:
        try:
            urllib.request.urlopen("http://192.0.2.1/", timeout=0.01)
        except OSError:
            return

    _after_load(call)


def _drops_earlier_records() -> None:
    """Law 3: a run that goes on forgets its first record."""

    def forget() -> None:
        path = Path("out/records.jsonl")
        if path.exists():
            path.write_bytes(path.read_bytes().partition(b"\n")[2])

    _after_load(forget)


def _keeps_nothing_of_some_replies() -> None:
    """Law 3: of every three records one is not written."""
    from phyblock.run.store import RecordWriter

    put = RecordWriter.put
    counted = itertools.count()

    async def puts_some(self: RecordWriter, record: Any) -> None:
        if next(counted) % 3:
            await put(self, record)

    RecordWriter.put = puts_some  # type: ignore[method-assign]


def _asks_what_is_answered() -> None:
    """Law 3: no record counts as final, and no reply is found in the cache."""
    from phyblock.models.cache import ReplyCache
    from phyblock.run import execute

    init = execute.Executor.__init__

    def forgets(self: Any, *args: Any, **options: Any) -> None:
        init(self, *args, **options)
        self.settled = {}

    execute.Executor.__init__ = forgets  # type: ignore[method-assign]
    ReplyCache.get = lambda *_: None  # type: ignore[assignment, method-assign]


def _sends_twice() -> None:
    """Law 3: a transport sends each request a second time, and tells nobody."""
    from phyblock.models.openai_client import OpenAIClient

    send = OpenAIClient.complete

    async def sends_again(self: OpenAIClient, request: Any, **fields: Any) -> Any:
        await send(self, request, **fields)
        return await send(self, request, **fields)

    OpenAIClient.complete = sends_again  # type: ignore[method-assign]


SABOTAGES: dict[str, Callable[[], None]] = {
    function.__name__.strip("_").replace("_", "-"): function
    for function in (
        _raises_what_nobody_expects,
        _ends_with_a_code_of_its_own,
        _says_nothing,
        _dies,
        _hangs,
        _writes_at_home,
        _writes_and_tidies_up,
        _deletes_what_is_not_its_own,
        _calls_home,
        _drops_earlier_records,
        _keeps_nothing_of_some_replies,
        _asks_what_is_answered,
        _sends_twice,
    )
}
