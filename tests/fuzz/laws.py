"""The laws of every command, and what is looked at to see whether one was broken.

1. The exit code is 0, 1, 2 or 130, there is never a traceback, and code 2 says what is wrong.
2. No file outside the run folder and the cache changes, and none of the user's in the run folder.
3. What was answered is kept, and is never asked again (the server's own `Ledger` tells exactly);
   what was refused for good is not asked again either, unless it is told to. What failed may be.
"""

import contextlib
import json
import os
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from aiohttp import web

from tests.fork_server import Done, run_forked
from tests.servers.chassis import Seen
from tests.servers.faults import WIRE_FAULTS
from tests.servers.openai_chat import OpenAIChat, answered
from tests.workspace import SHARED, Workspace, files_below

CODES = (0, 1, 2, 130)
_COMPLAINTS = ("error: ", "Error: ")
_DEVICES = ("/dev/null", "/dev/tty", "/dev/shm")
_LOCAL = ("127.0.0.1", "localhost", "::1")
_LONGEST_S = 30.0
"""A command on small files that is not done by then hangs [s]."""
_LONGEST_SHOWN = 1500
_KEPT_FILES = ("records.jsonl", "calls.jsonl")


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
    longest_s: float = _LONGEST_S,
) -> tuple[Done, list[Broken]]:
    """Run a command to its end, or for its longest time; return its end and the laws it broke.

    `may_write` are the paths that the command is to write in, beside the cache, and `lasting` those
    of the user's files that stand there all the same.
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
    elif ended.code not in CODES:
        yield Broken(1, f"exit code {ended.code}", ended.err[-2000:])
    elif ended.code == 2 and not any(word in ended.err for word in _COMPLAINTS):
        yield Broken(1, "exit code 2 without a message", ended.err[-2000:])


def _judge(event: str, about: str, places: Sequence[str]) -> Iterator[Broken]:
    if event == "socket.connect":
        if not any(name in about for name in _LOCAL):
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


@dataclass(frozen=True)
class Case:
    """A command line and what stands in the folder where it is given: bytes in a file, a text that
    a link points to, or None for a pipe that nobody writes to.

    `may_write` are the paths that the command is to write in, beside cache and scratch folder;
    `lasting` those of the user's files that stand there and must not change.
    """

    args: tuple[str, ...]
    files: Mapping[str, bytes | str | None] = field(default_factory=dict)
    may_write: tuple[str, ...] = ()
    lasting: tuple[str, ...] = ()


class Bench:
    """Tries cases in a copy of the workspace `template`.

    `tally` counts them by exit code, `found` has the laws that were broken, by kind.
    """

    def __init__(self, template: Workspace, folder: Path, tally: Counter[str]) -> None:
        self._template, self._folder, self.tally = template, folder / "here", tally
        self.found: dict[str, tuple[Case, Broken]] = {}

    def try_out(self, case: Case) -> None:
        """Note what the case broke; of cases that broke the same, the smallest is kept."""
        made = self._template.copied(self._folder)
        try:
            (made.root / "tmp").mkdir()
            made.env["TMPDIR"] = str(made.root / "tmp")
            for name, content in case.files.items():
                _put(made.root / name, content)
            ended, found = watched(case.args, made, (*case.may_write, "tmp"), case.lasting)
            self.tally["hangs" if ended.code is None else f"code {ended.code}"] += 1
            for broken in found:
                known = self.found.get(broken.name)
                if known is None or len(repr(case)) < len(repr(known[0])):
                    self.found[broken.name] = case, broken
        finally:
            shutil.rmtree(made.root)

    def told(self) -> str:
        """Every way in which a law was broken, with the smallest case that does it."""
        lines = []
        for name, (case, broken) in self.found.items():
            parts = (f"{key}={value!r}"[:_LONGEST_SHOWN] for key, value in vars(case).items())
            lines += ["", name, broken.detail, *parts]
        return "\n".join(lines)


def _put(path: Path, content: bytes | str | None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    if content is None:
        os.mkfifo(path)
    elif isinstance(content, str):
        path.symlink_to(content)
    else:
        path.write_bytes(content)


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


class Ledger:
    """The entries of a server in the order in which requests arrived."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []

    @property
    def faults(self) -> Counter[str]:
        """Numbers of requests without an ordinary answer, by their end."""
        return Counter(entry.ending for entry in self.entries if entry.ending != "ok")

    def that_came_to(self, end: str) -> set[tuple[str, str]]:
        """Requests that ended so."""
        return {entry.key for entry in self.entries if entry.comes_to == end}

    def broken(self, folder: Path, *, retries_refused: bool = False) -> Iterator[Broken]:
        """Yield what was asked again after it was answered or refused for good, and what was
        answered and is not in a run.
        """
        ended: dict[tuple[str, str], Entry] = {}
        for entry in self.entries:
            if entry.key in ended:
                yield Broken(3, "asked twice", f"{ended[entry.key]}, then {entry}")
            if entry.comes_to == "reply" or (entry.comes_to == "sample" and not retries_refused):
                ended[entry.key] = entry
        for lost in sorted(self.that_came_to("reply") - kept_in(folder)):
            endings = [entry.ending for entry in self.entries if entry.key == lost]
            yield Broken(3, "a reply is lost", f"{lost}: {endings}")


def kept_in(folder: Path) -> set[tuple[str, str]]:
    """Return the entries of a run's records or calls, by model and signature of the reply.

    A last line that a kill cut short does not count.
    """
    paths = (folder / name for name in _KEPT_FILES)
    lines = [one for p in paths if p.exists() for one in p.read_bytes().split(b"\n")[:-1]]
    stored = [one for one in map(json.loads, lines) if one.get("reply") is not None]
    return {(one["model"], one["reply"]["reasoning"]) for one in stored}


class LedgerChat(OpenAIChat):
    """Answers every track; the digest of a request is its reply's reasoning.

    Several that serve the same model may share a `ledger`.
    """

    def __init__(self, *args: Any, ledger: Ledger | None = None) -> None:
        super().__init__(*args, say=answered, think=lambda seen: seen.sample)
        self.ledger = ledger or Ledger()

    async def _end(self, seen: Seen, ending: str, request: web.Request) -> web.StreamResponse:
        self.ledger.entries.append(Entry(seen.model, seen.sample, ending))
        return await super()._end(seen, ending, request)
