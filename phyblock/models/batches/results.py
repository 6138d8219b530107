"""The answers of a batch: a file of JSON lines, of which only the places are kept in memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from phyblock.files import load_json, open_regular
from phyblock.models.batches.protocol import BatchProtocol, ResultLine

__all__ = ["Results", "custom_id"]

_LONGEST_LINE_BYTES = 64 * 1024 * 1024


class Results:
    """The first whole line of every request that has one.

    `faults` counts lines that are no answer to anything, by what is wrong with them. Raises OSError
    where the file cannot be read.
    """

    def __init__(self, path: Path, protocol: BatchProtocol, token: str, requests: int) -> None:
        self._path = path
        self._protocol = protocol
        self._starts: dict[int, int] = {}
        self.faults: Counter[str] = Counter()
        with open_regular(path) as file:
            start = 0
            while data := file.readline(_LONGEST_LINE_BYTES):
                if data.strip():
                    self._take(self._read(data), start, token, requests)
                start += len(data)

    def __len__(self) -> int:
        return len(self._starts)

    def of(self, place: int) -> ResultLine | None:
        """The line of a request by its place in the batch; None where there is none."""
        start = self._starts.get(place)
        if start is None:
            return None
        with open_regular(self._path) as file:
            file.seek(start)
            return self._read(file.readline(_LONGEST_LINE_BYTES))

    @property
    def is_empty(self) -> bool:
        """Whether the file holds nothing at all."""
        return not self._starts and not self.faults

    @property
    def remark(self) -> str:
        """What is wrong with lines, in words; "" for nothing."""
        return ", ".join(f"{n} {what}" for what, n in sorted(self.faults.items()))

    def _take(self, line: ResultLine | None, start: int, token: str, requests: int) -> None:
        if line is None:
            self.faults["that cannot be read"] += 1
            return
        place = _place_of(line.custom_id, token)
        if place is None or place >= requests:
            self.faults["to what was not asked"] += 1
        elif place in self._starts:
            self.faults["to what has an answer already"] += 1
        else:
            self._starts[place] = start

    def _read(self, data: bytes) -> ResultLine | None:
        try:
            raw = load_json(data)
        except ValueError:
            return None
        return self._protocol.read(raw) if isinstance(raw, Mapping) else None


def custom_id(token: str, place: int) -> str:
    """The name of a request in a batch."""
    return f"{token}-{place}"


def _place_of(name: str, token: str) -> int | None:
    """The place of a request in the batch by its name; None for one of another batch."""
    start, _, number = name.rpartition("-")
    is_ours = start == token and number.isascii() and number.isdecimal() and len(number) < 10
    return int(number) if is_ours else None
