"""Questions that are being asked right now, in a table beside the replies of the cache.

A lease is held while a request is under way and renewed until it ends, so that no other process
asks the same. It ends with its process where that can be told, by those on the same machine, and
else runs out soon after its holder died or hangs. The clock of the machine may be set: a lease that
would last longer than any can is none.

Many questions that are asked together stand under one lease, so that one row is renewed for all.
Where its holder was silent for so long that others cleared it away, it brings back what it has.
"""

from __future__ import annotations

import contextlib
import sqlite3
import time
import uuid
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from phyblock.models.holder import holder_name, is_holder_gone

__all__ = ["LEASE_S", "Asking", "Lease", "LeaseGroup", "Leases"]

LEASE_S = 30.0
"""How long a lease holds that is not renewed."""

_CREATE = """
CREATE TABLE IF NOT EXISTS leases (
    key TEXT PRIMARY KEY,
    owner TEXT NOT NULL,
    until REAL NOT NULL
) WITHOUT ROWID
"""
_CREATE_GROUPED = """
CREATE TABLE IF NOT EXISTS grouped_leases (
    key TEXT PRIMARY KEY,
    lease TEXT NOT NULL
) WITHOUT ROWID
"""
_EXISTS = "SELECT count(*) FROM sqlite_master WHERE name IN ('leases', 'grouped_leases')"
_ASKING = (
    "SELECT until, owner, NULL FROM leases WHERE key = ?1 UNION ALL "
    "SELECT until, owner, leases.key FROM grouped_leases "
    "JOIN leases ON leases.key = grouped_leases.lease WHERE grouped_leases.key = ?1"
)


class Lease(NamedTuple):
    """One lease that was taken; `owner` differs from that of every other, and names the process
    behind its first word, where the process has a name.
    """

    key: str
    owner: str


@dataclass(eq=False)
class LeaseGroup:
    """A lease with the questions that stand under it, as its holder knows them; `is_whole` is
    whether the file knows the same.
    """

    lease: Lease
    keys: set[str] = field(default_factory=set)
    is_whole: bool = True


class Asking(NamedTuple):
    """Whether a question is being asked: by itself, and together with others."""

    alone: bool
    together: bool


class Leases:
    """The leases in one database; sqlite3's errors come out."""

    def __init__(self, db: sqlite3.Connection, now: Callable[[], float] = time.time) -> None:
        """Makes the table where an older file lacks it."""
        self._db = db
        self._now = now
        self._held: set[Lease] = set()
        self._holder = holder_name()
        if db.execute(_EXISTS).fetchone() != (2,):
            db.execute(_CREATE)
            db.execute(_CREATE_GROUPED)

    def asking(self, key: str, but: LeaseGroup | None = None) -> Asking:
        """How the question is being asked, otherwise than under the lease of `but`."""
        rows = self._db.execute(_ASKING, (key,)).fetchall()
        held = {lease for until, owner, lease in rows if self._holds(until, owner)}
        alone = None in held
        return Asking(alone, bool(held - {None, but and but.lease.key}))

    def is_taken(self, key: str, but: LeaseGroup | None = None) -> bool:
        """Whether the question is being asked; see `asking`."""
        return any(self.asking(key, but))

    def _holds(self, until: float, owner: str) -> bool:
        now = self._now()
        return now < until <= now + LEASE_S and not is_holder_gone(owner.partition(" ")[2])

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """While nobody else changes the table; what fails is undone."""
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise

    def take(self, key: str, *, by_force: bool = False) -> Lease | None:
        """Take the lease, or None where another holds it. `by_force` takes it from the other."""
        lease = Lease(key, f"{uuid.uuid4().hex} {self._holder}".rstrip())
        with self._alone():
            is_free = by_force or not self.is_taken(key)
            if is_free:
                self._write(lease)
        if not is_free:
            return None
        self._held.add(lease)
        return lease

    def _write(self, lease: Lease) -> None:
        row = (*lease, self._now() + LEASE_S)
        self._db.execute("INSERT OR REPLACE INTO leases VALUES (?, ?, ?)", row)

    def take_group(self) -> LeaseGroup:
        """A lease that questions can stand under."""
        lease = self.take(f"group {uuid.uuid4().hex}")
        assert lease is not None, "nobody else has this name"
        return LeaseGroup(lease)

    def add(self, group: LeaseGroup, keys: Collection[str], *, by_force: bool = False) -> bool:
        """Have questions stand under a lease, if nobody else asks any of them, or `by_force`."""
        with self._alone():
            # Or they would stand under a lease that is not there.
            self._hold(group)
            is_free = by_force or not any(self.is_taken(key, group) for key in keys)
            if is_free:
                self._place(group, keys)
        if is_free:
            group.keys.update(keys)
        return is_free

    def _place(self, group: LeaseGroup, keys: Collection[str]) -> None:
        rows = [(key, group.lease.key) for key in keys]
        self._db.executemany("INSERT OR REPLACE INTO grouped_leases VALUES (?, ?)", rows)

    def remove(self, group: LeaseGroup, key: str) -> None:
        """The question is no longer being asked by those who hold the lease."""
        group.keys.discard(key)
        sql = "DELETE FROM grouped_leases WHERE key = ? AND lease = ?"
        self._db.execute(sql, (key, group.lease.key))

    def hold(self, group: LeaseGroup) -> None:
        """Let the lease hold for another while; what the file has lost of it is brought back,
        whoever else asks it by now.
        """
        with self._alone():
            self._hold(group)

    def _hold(self, group: LeaseGroup) -> None:
        if self.renew(group.lease) and group.is_whole:
            return
        self._write(group.lease)
        self._held.add(group.lease)
        self._clear(group)
        self._place(group, tuple(group.keys))
        group.is_whole = True

    def _clear(self, group: LeaseGroup) -> None:
        self._db.execute("DELETE FROM grouped_leases WHERE lease = ?", (group.lease.key,))

    def give_group_back(self, group: LeaseGroup) -> None:
        """Nothing that stood under the lease is being asked any more."""
        self.give_back(group.lease)
        self._clear(group)

    def renew(self, lease: Lease) -> bool:
        """Let the lease hold for another while; False where it is held no more."""
        sql = "UPDATE leases SET until = ? WHERE key = ? AND owner = ?"
        is_held = self._db.execute(sql, (self._now() + LEASE_S, *lease)).rowcount > 0
        if not is_held:
            self._held.discard(lease)
        return is_held

    def give_back(self, lease: Lease) -> None:
        """The question is no longer being asked, at least not by the one who took the lease."""
        self._held.discard(lease)
        self._db.execute("DELETE FROM leases WHERE key = ? AND owner = ?", lease)

    def give_all_back(self) -> None:
        """Nothing is being asked any more; what dead processes left behind goes too."""
        if self._held:
            for lease in tuple(self._held):
                self.give_back(lease)
            self._db.execute("DELETE FROM leases WHERE until < ?", (self._now(),))
            self._db.execute(
                "DELETE FROM grouped_leases WHERE lease NOT IN (SELECT key FROM leases)"
            )
