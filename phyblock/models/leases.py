"""Questions that are being asked right now, in a table beside the replies of the cache.

A lease is held while a request is under way and renewed until it ends, so that no other process
asks the same. It runs out soon after its holder died or hangs. Nothing but time tells that, and the
clock of the machine may be set: a lease that would last longer than any can is none.
"""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable

__all__ = ["LEASE_S", "Leases"]

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


class Leases:
    """The leases in one database, as `owner` sees and takes them; sqlite3's errors come out."""

    def __init__(
        self, db: sqlite3.Connection, owner: str, now: Callable[[], float] = time.time
    ) -> None:
        """Makes the table where an older file lacks it."""
        self._db = db
        self._owner = owner
        self._now = now
        self._held: set[str] = set()
        if db.execute(_EXISTS).fetchone() is None:
            db.execute(_CREATE)

    def is_taken(self, key: str) -> bool:
        """Whether the question is being asked."""
        now = self._now()
        row = self._db.execute("SELECT until FROM leases WHERE key = ?", (key,)).fetchone()
        return row is not None and now < row[0] <= now + LEASE_S

    def take(self, key: str, *, by_force: bool = False) -> bool:
        """Take the lease; whether it was free. `by_force` takes it from whoever holds it."""
        self._db.execute("BEGIN IMMEDIATE")
        try:
            is_free = by_force or not self.is_taken(key)
            if is_free:
                self._put(key)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        return is_free

    def renew(self, key: str) -> None:
        """Let the lease hold for another while, if it is still held."""
        if key in self._held:
            self._put(key)

    def give_back(self, key: str) -> None:
        """The question is no longer being asked."""
        if key in self._held:
            self._held.discard(key)
            sql = "DELETE FROM leases WHERE key = ? AND owner = ?"
            self._db.execute(sql, (key, self._owner))

    def give_all_back(self) -> None:
        """Nothing is being asked any more; what dead processes left behind goes too."""
        if self._held:
            self._held.clear()
            sql = "DELETE FROM leases WHERE owner = ? OR until < ?"
            self._db.execute(sql, (self._owner, self._now()))

    def _put(self, key: str) -> None:
        row = (key, self._owner, self._now() + LEASE_S)
        self._db.execute("INSERT OR REPLACE INTO leases VALUES (?, ?, ?)", row)
        self._held.add(key)
