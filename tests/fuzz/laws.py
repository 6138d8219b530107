"""The laws of every command, and what is looked at to see whether one was broken.

1. The exit code is 0, 1, 2 or 130, there is never a traceback, and code 2 says what is wrong.
2. No file outside the run folder and the cache changes, and none of the user's in the run folder.
3. What was answered is kept, and is never asked again; what was refused for good is not asked again
   either, unless it is told to. What failed may be.
"""

import contextlib
import json
import os
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from aiohttp import web

from tests.fork_server import Done, run_forked
from tests.servers.chassis import Seen
from tests.servers.faults import WIRE_FAULTS
from tests.servers.openai_chat import OpenAIChat, answered
from tests.workspace import SHARED, Workspace, files_below, vqa_suite

_DEVICES = ("/dev/null", "/dev/tty", "/dev/shm")
_KEPT_FILES = ("records.jsonl", "calls.jsonl")
TRACKS: dict[str, tuple[int, dict[str, Any]]] = {
    "full_planning": (5, {}),
    "vqa": (12, vqa_suite(subtasks=["SH", "OR", "VP"])),
    "step_planning": (15, {"tracks": ["step_planning"], "steps": {"physics": "off"}}),
}
"""By track: at least how many requests a seed makes, and the suite."""


class Broken(NamedTuple):
    """A law that was broken, and how. `kind` is the same for what has the same cause."""

    law: int
    kind: str
    detail: str

    @property
    def name(self) -> str:
        return f"law {self.law}: {self.kind}"


def watched(
    args: Sequence[str],
    workspace: Workspace,
    may_write: Sequence[str],
    lasting: Sequence[str] = (),
    longest_s: float = 30.0,
) -> tuple[Done, list[Broken]]:
    """Run a command to its end, or for its longest time; return its end and the laws it broke.

    `may_write` are the paths that the command is to write in, beside the cache; `lasting` those of
    the user's files that stand there and must not change.
    """
    folder, may_write = workspace.root, (*may_write, "cache")
    before, lines = _tree(folder), _whole_lines(folder)
    ended = Done(None, "", "")
    with tempfile.TemporaryFile() as file:
        with contextlib.suppress(subprocess.TimeoutExpired):
            ended = run_forked(args, folder, workspace.env, timeout_s=longest_s, deeds=file)
        file.seek(0)
        deeds = [json.loads(line) for line in file]
    found, after = list(_ending_broken(ended)), _tree(folder)
    for path in sorted(before.keys() | after.keys()):
        same = before.get(path) == after.get(path)
        if not same and (path in lasting or not _lies_in(path, may_write)):
            kind = "changed" if path in before else "made"
            found.append(Broken(2, f"a file was {kind if path in after else 'deleted'}", path))
    shared = [f"cache/{name}" for name in SHARED]
    places = [os.path.realpath(folder / place) for place in (*may_write, *shared)]
    found += [broken for deed in deeds for broken in _judge(*deed, places)]
    for name, line in lines - _whole_lines(folder):
        detail = line[:300].decode("utf-8", "replace")
        found.append(Broken(3, f"a line of {Path(name).name} is lost", detail))
    return ended, found


def _tree(root: Path) -> dict[str, bool | bytes]:
    """Everything below a folder by relative path: files and links by what they hold."""
    below = {str(path.relative_to(root)): path.is_dir() for path in root.rglob("*")}
    return below | files_below(root)


def _ending_broken(ended: Done) -> Iterator[Broken]:
    if ended.code is None:
        yield Broken(1, "it hangs", "")
    elif "Traceback (most recent call last)" in ended.out + ended.err:
        last = ended.err.strip().splitlines() or ["?"]
        where = [line.strip() for line in last if line.lstrip().startswith('File "')]
        yield Broken(1, f"traceback of {last[-1][:60]} at {where[-1:]}", ended.err[-3000:])
    elif ended.code not in (0, 1, 2, 130):
        yield Broken(1, f"exit code {ended.code}", ended.err[-2000:])
    elif ended.code == 2 and "error: " not in ended.err.lower():
        yield Broken(1, "exit code 2 without a message", ended.err[-2000:])


def _judge(event: str, about: str, places: Sequence[str]) -> Iterator[Broken]:
    if event == "socket.connect":
        if not any(name in about for name in ("127.0.0.1", "localhost", "::1")):
            yield Broken(2, "a connection", about)
    elif event == "os.mkdir" and any(_lies_in(place, [about]) for place in places):
        return  # that a folder above is there is found out by trying to make it
    elif not _lies_in(about, [*places, *_DEVICES]):
        yield Broken(2, f"{event} elsewhere", about)


def _lies_in(path: str, places: Sequence[str]) -> bool:
    return any(place == "." or f"{path}/".startswith(f"{place.rstrip('/')}/") for place in places)


def _whole_lines(folder: Path) -> Counter[tuple[str, bytes]]:
    """The whole lines of the files that grow, of every run in the folder."""
    found: Counter[tuple[str, bytes]] = Counter()
    for path in (path for name in _KEPT_FILES for path in folder.glob(f"*/{name}")):
        for line in path.read_bytes().split(b"\n") if path.is_file() else ():
            with contextlib.suppress(ValueError, RecursionError):
                if isinstance(json.loads(line), dict):
                    found[str(path.relative_to(folder)), line] += 1
    return found


_COMES_TO = {
    **dict.fromkeys(("ok", "length", "filtered", "blank"), "reply"),
    **dict.fromkeys(("400", "policy"), "sample"),
    **{name: fault.ending for name, fault in WIRE_FAULTS.items()},
}


class Entry(NamedTuple):
    """A request that arrived whole: which model was asked, what, and how the server ended it."""

    model: str
    sample: str
    ending: str

    @property
    def comes_to(self) -> str:
        """ "reply", "retryable", "unavailable" or "sample" (refused for good)."""
        return _COMES_TO.get(self.ending, "retryable")

    @property
    def key(self) -> tuple[str, str]:
        """A request, and whom it was sent to."""
        return self.model, self.sample


class Ledger(list[Entry]):
    """The entries of a server in the order in which requests arrived."""

    @property
    def faults(self) -> Counter[str]:
        """Numbers of requests without an ordinary answer, by their end."""
        return Counter(entry.ending for entry in self if entry.ending != "ok")

    def that_came_to(self, end: str) -> set[tuple[str, str]]:
        """Requests that ended so."""
        return {entry.key for entry in self if entry.comes_to == end}

    def broken(self, folder: Path, *, retries_refused: bool = False) -> Iterator[Broken]:
        """Yield what was asked again though it had ended for good, and replies that a run lost."""
        ended: dict[tuple[str, str], Entry] = {}
        for entry in self:
            if entry.key in ended:
                yield Broken(3, "asked twice", f"{ended[entry.key]}, then {entry}")
            if entry.comes_to == "reply" or (entry.comes_to == "sample" and not retries_refused):
                ended[entry.key] = entry
        for lost in sorted(self.that_came_to("reply") - kept_in(folder)):
            endings = [entry.ending for entry in self if entry.key == lost]
            yield Broken(3, "a reply is lost", f"{lost}: {endings}")


def kept_in(folder: Path) -> set[tuple[str, str]]:
    """Return the entries of a run's whole lines, by model and signature of the reply."""
    paths = (folder / name for name in _KEPT_FILES)
    lines = [one for p in paths if p.exists() for one in p.read_bytes().split(b"\n")[:-1]]
    stored = [one for one in map(json.loads, lines) if one.get("reply") is not None]
    return {(one["model"], one["reply"]["reasoning"]) for one in stored}


class LedgerChat(OpenAIChat):
    """Answers every track; the digest of a request is its reply's reasoning."""

    def __init__(self, *args: Any, ledger: Ledger | None = None) -> None:
        super().__init__(*args, say=answered, think=lambda seen: seen.sample)
        self.ledger = Ledger() if ledger is None else ledger

    async def _end(self, seen: Seen, ending: str, request: web.Request) -> web.StreamResponse:
        self.ledger.append(Entry(seen.model, seen.sample, ending))
        return await super()._end(seen, ending, request)
