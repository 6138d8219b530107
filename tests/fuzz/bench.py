"""A command with its files, tried in a folder of its own, and judged by the laws."""

from __future__ import annotations

import json
import os
import shutil
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.laws import Broken, Tree, broken_laws, take_tree
from tests.fuzz.worker import Ended, Worker
from tests.workspace import Raw, shared_folders

__all__ = ["Bench", "Case", "Fifo", "Link"]

_LONGEST_SHOWN = 1500
_KEPT_FILES = ("records.jsonl", "calls.jsonl")


@dataclass(frozen=True)
class Fifo:
    """A pipe that nobody writes to."""


@dataclass(frozen=True)
class Link:
    """A symbolic link."""

    to: str


Content = bytes | Fifo | Link


@dataclass(frozen=True)
class Case:
    """A command line and what stands in the folder where it is given.

    `may_write` are the paths that the command is to write in, beside cache and scratch folder;
    `lasting` those of the user's files that stand there and must not change.
    """

    args: tuple[str, ...]
    files: Mapping[str, Content] = field(default_factory=dict)
    may_write: tuple[str, ...] = ()
    lasting: tuple[str, ...] = ()
    env: Mapping[str, str] = field(default_factory=dict)


class Bench:
    """Tries cases in copies of the folder `template`.

    `tally` counts them by exit code, `found` has the laws that were broken, by kind.
    """

    def __init__(self, worker: Worker, template: Path, pictures: Path, root: Path) -> None:
        self._worker = worker
        self._template = template
        self._pictures = pictures
        self._root = root
        self.tally: Counter[str] = Counter()
        self.found: dict[str, tuple[Case, Broken]] = {}

    def broken(self, case: Case) -> list[Broken]:
        """The laws that the case's command broke."""
        folder = self._root / "here"
        shutil.copytree(self._template, folder, symlinks=True)
        try:
            return self._broken(case, folder)
        finally:
            shutil.rmtree(folder)

    def try_out(self, case: Case) -> None:
        """Note what the case broke; of cases that broke the same, the smallest is kept."""
        for broken in self.broken(case):
            known = self.found.get(broken.name)
            if known is None or len(repr(case)) < len(repr(known[0])):
                self.found[broken.name] = case, broken

    def told(self) -> str:
        """Every way in which a law was broken, with the smallest case that does it."""
        return "\n\n".join(
            f"{name}\n{broken.detail}\n{_shown(case)}"
            for name, (case, broken) in self.found.items()
        )

    def _broken(self, case: Case, folder: Path) -> list[Broken]:
        (folder / "tmp").mkdir()
        for name, content in case.files.items():
            _put(folder / name, content)
        before, lines = take_tree(folder), _whole_lines(folder)
        ended = self._worker.phyblock(list(case.args), folder, self._environment(case, folder))
        self.tally["hangs" if ended.code is None else f"code {ended.code}"] += 1
        return self._judge(case, folder, ended, before) + _lost(lines, _whole_lines(folder))

    def _judge(self, case: Case, folder: Path, ended: Ended, before: Tree) -> list[Broken]:
        places = (*case.may_write, "cache", "tmp", *map(str, shared_folders(self._pictures)))
        after = take_tree(folder)
        return broken_laws(ended, folder, before, after, places, case.lasting)

    @staticmethod
    def _environment(case: Case, folder: Path) -> dict[str, str]:
        return {
            "PATH": os.environ["PATH"],
            "HOME": str(folder),
            "TMPDIR": str(folder / "tmp"),
            "PHYBLOCK_CACHE": str(folder / "cache"),
            "LITELLM_LOCAL_MODEL_COST_MAP": "True",
            **case.env,
        }


def _put(path: Path, content: Content) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    if isinstance(content, Fifo):
        os.mkfifo(path)
    elif isinstance(content, Link):
        path.symlink_to(content.to)
    else:
        path.write_bytes(content)


def _whole_lines(folder: Path) -> Counter[tuple[str, bytes]]:
    """The whole lines of the files that grow, of every run in the folder."""
    found: Counter[tuple[str, bytes]] = Counter()
    for name in _KEPT_FILES:
        for path in folder.glob(f"*/{name}"):
            if path.is_file():
                lines = path.read_bytes().split(b"\n")
                found.update((str(path.relative_to(folder)), line) for line in lines if _is(line))
    return found


def _is(line: bytes) -> bool:
    try:
        found: Raw = json.loads(line)
    except (ValueError, RecursionError):
        return False
    return isinstance(found, dict)


def _lost(before: Counter[tuple[str, bytes]], after: Counter[tuple[str, bytes]]) -> list[Broken]:
    return [
        Broken(3, f"a line of {Path(name).name} is lost", line[:300].decode("utf-8", "replace"))
        for name, line in (before - after)
    ]


def _shown(case: Case) -> str:
    """A case, its long parts cut."""
    parts = (f"{name}={value!r}"[:_LONGEST_SHOWN] for name, value in vars(case).items() if value)
    return "\n".join(parts)
