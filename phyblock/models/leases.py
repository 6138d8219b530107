"""Questions that are being asked right now, in a table beside the replies of the cache.

A lease is held while a request is under way and renewed until it ends, so that no other process
asks the same. It ends with its process where that can be told, by those on the same machine, and
else runs out soon after its holder died or hangs. The clock of the machine may be set: a lease that
would last longer than any can is none.

Many questions that are asked together stand under one lease, so that one row is renewed for all.
"""

from __future__ import annotations

import sqlite3
import time
import uuid
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from phyblock.models.holder import holder_name, is_holder_gone

__all__ = ["LEASE_S", "Lease", "Leases"]

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
_GROUPED = (
    "SELECT until, owner, leases.key FROM grouped_leases "
    "JOIN leases ON leases.key = grouped_leases.lease WHERE grouped_leases.key = ?"
)


class Lease(NamedTuple):
    """One lease that was taken; `owner` differs from that of every other, and names the process
    behind its first word, where the process has a name.
    """

    key: str
    owner: str


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

    def is_taken(self, key: str, but: Lease | None = None) -> bool:
        """Whether the question is being asked, otherwise than under the lease `but`."""
        row = self._db.execute("SELECT until, owner FROM leases WHERE key = ?", (key,)).fetchone()
        return self._holds(row) or self.is_grouped(key, but)

    def is_grouped(self, key: str, but: Lease | None = None) -> bool:
        """Whether the question is being asked together with others; see `is_taken`."""
        row = self._db.execute(_GROUPED, (key,)).fetchone()
        return self._holds(row) and (but is None or row[2] != but.key)

    def _holds(self, row: tuple[Any, ...] | None) -> bool:
        now = self._now()
        if row is None or not now < row[0] <= now + LEASE_S:
            return False
        return not is_holder_gone(row[1].partition(" ")[2])

    def take(self, key: str, *, by_force: bool = False) -> Lease | None:
        """Take the lease, or None where another holds it. `by_force` takes it from the other."""
        lease = Lease(key, f"{uuid.uuid4().hex} {self._holder}".rstrip())
        self._db.execute("BEGIN IMMEDIATE")
        try:
            is_free = by_force or not self.is_taken(key)
            if is_free:
                row = (*lease, self._now() + LEASE_S)
                self._db.execute("INSERT OR REPLACE INTO leases VALUES (?, ?, ?)", row)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        if not is_free:
            return None
        self._held.add(lease)
        return lease

    def take_group(self) -> Lease:
        """A lease that questions can stand under."""
        lease = self.take(f"group {uuid.uuid4().hex}")
        assert lease is not None, "nobody else has this name"
        return lease

    def add(self, group: Lease, keys: Iterable[str], *, by_force: bool = False) -> bool:
        """Have questions stand under a lease, if nobody else asks any of them, or `by_force`."""
        rows = [(key, group.key) for key in keys]
        self._db.execute("BEGIN IMMEDIATE")
        try:
            is_free = by_force or not any(self.is_taken(key, group) for key, _ in rows)
            if is_free:
                self._db.executemany("INSERT OR REPLACE INTO grouped_leases VALUES (?, ?)", rows)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        return is_free

    def remove(self, group: Lease, key: str) -> None:
        """The question is no longer being asked by those who hold the lease."""
        sql = "DELETE FROM grouped_leases WHERE key = ? AND lease = ?"
        self._db.execute(sql, (key, group.key))

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
