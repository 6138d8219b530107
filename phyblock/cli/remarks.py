"""What a log says of calls that go wrong: in plain words, and never more than a line a while."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from phyblock.run.events import ModelNotice

__all__ = ["Remarks"]

_WORDS = {
    429: "HTTP 429 (too many requests)",
    200: "unreadable replies",
    None: "no answer",
}


@dataclass
class _Trouble:
    """What happened to one model's calls since it was last said."""

    retries: Counter[int | None] = field(default_factory=Counter)
    longest_wait_s: float = 0.0
    last: str = ""

    def line(self, model: str) -> str:
        total = sum(self.retries.values())
        kinds = ", ".join(
            f"{number} for {_WORDS.get(status, f'HTTP {status}')}"
            for status, number in self.retries.most_common()
        )
        times = "once" if total == 1 else f"{total} times"
        wait = f"waiting up to {self.longest_wait_s:.0f} s"
        return f"{model}: asking again {times} ({kinds}), {wait}; last: {self.last}"


class Remarks:
    """Gathers notices and gives them out as lines: the first at once, then one a model every
    `every_s` at most.
    """

    def __init__(self, every_s: float) -> None:
        self._every_s = every_s
        self._troubles: dict[str, _Trouble] = {}
        self._last_s: dict[str, float] = {}

    def add(self, notice: ModelNotice, now_s: float) -> list[str]:
        """Take note, and give the lines that are due."""
        if notice.kind != "retry":
            return [f"{notice.model}: {notice.text}"]
        trouble = self._troubles.setdefault(notice.model, _Trouble())
        trouble.retries[notice.status] += 1
        trouble.longest_wait_s = max(trouble.longest_wait_s, notice.wait_s)
        trouble.last = notice.text
        return self.due(now_s)

    def due(self, now_s: float) -> list[str]:
        """The lines that may be given now."""
        ready = [
            model
            for model in self._troubles
            if model not in self._last_s or now_s - self._last_s[model] >= self._every_s
        ]
        self._last_s.update(dict.fromkeys(ready, now_s))
        return [self._troubles.pop(model).line(model) for model in ready]
