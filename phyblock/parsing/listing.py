"""A list of a reply: its form, the blocks that it names in order, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["Listing"]


@dataclass
class Listing:
    """One list: its form, the blocks that it names in order, and where it stands.

    `above` are the lines between it and the list before it that name nothing, `heading` the last of
    them or, where nothing stands between, that of the list before; `own` are the
    numbers that its items bear; `n_moves` of its `n_named` items say by a verb that they move.
    """

    form: str
    above: list[str]
    first_line: int
    last_line: int
    numbers: list[int] = field(default_factory=list)
    own: list[int] = field(default_factory=list)
    n_named: int = 0
    n_moves: int = 0
    label: str = ""
    heading: str = ""
    ends_named: bool = True
    leaves: bool = False
    loose: set[int] = field(default_factory=set)
    supports: set[int] = field(default_factory=set)
    denied: set[int] = field(default_factory=set)
    between: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    @property
    def is_firm(self) -> bool:
        """Whether its form says that it is a plan: steps, moves, JSON, a table with steps."""
        return self.form in ("steps", "json", "table", "layers") or 2 * self.n_moves >= self.n_named
