"""Questions that are being asked right now, in a table beside the replies of the cache.

A lease is held while a request is under way and renewed until it ends, so that no other process
asks the same. It ends with its process where that can be told, by those on the same machine, and
else runs out soon after its holder died or hangs. The clock of the machine may be set: a lease that
would last longer than any can is none.
"""

from __future__ import annotations

import sqlite3
import time
import uuid
from collections.abc import Callable
from typing import NamedTuple

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
_EXISTS = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'leases'"


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
        if db.execute(_EXISTS).fetchone() is None:
            db.execute(_CREATE)

    def is_taken(self, key: str) -> bool:
        """Whether the question is being asked."""
        now = self._now()
        row = self._db.execute("SELECT until, owner FROM leases WHERE key = ?", (key,)).fetchone()
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
