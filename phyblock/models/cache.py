"""The reply cache: content-addressed, in one SQLite file that processes may share.

A reply is found again when everything that determines it is the same: model, parameters, messages
with their pictures, seed and prompt version, but not the address of the server. Only complete
replies are kept: no error, no empty, truncated or refused reply, no picture, no key.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sqlite3
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from weakref import WeakValueDictionary

from phyblock.config.models import ModelConfig
from phyblock.errors import Problem, StoreError
from phyblock.files import make_folder
from phyblock.models.request import Image, Request, wire_params
from phyblock.records.record import Reply
from phyblock.text import hex_digest

SCHEMA = 1
"""Version of the file's layout and of the contents of a key."""

_BUSY_TIMEOUT_S = 2.0
_HINT = (
    "free some space, delete the file, or name another cache folder with PHYBLOCK_CACHE; answered "
    "samples of a run stay in its records"
)
_CREATE = """
CREATE TABLE IF NOT EXISTS replies (
    key TEXT PRIMARY KEY, model TEXT NOT NULL, stored_at REAL NOT NULL, reply TEXT NOT NULL
) WITHOUT ROWID
"""


def reply_key(config: ModelConfig, request: Request) -> str:
    """Return the hex digest of everything that determines the reply."""
    content = {
        "schema": SCHEMA,
        "model": {**config.identity(), "params": wire_params(config, request)},
        "messages": [
            [
                message.role,
                [{"image": p.sha256} if isinstance(p, Image) else p for p in message.parts],
            ]
            for message in request.messages
        ],
        "seed": request.seed,
        "prompt_version": request.prompt_version,
    }
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hex_digest(canonical)


class ReplyCache(contextlib.AbstractContextManager["ReplyCache"]):
    """Replies by key, in one SQLite file that several processes may have open.

    Two processes that send the same request at once may both pay for it; the later reply is kept.
    Within a process `shared` prevents that. Raises StoreError for a file that is broken, foreign or
    unusable. With `report`, which runs set, later failures are reported, and the run continues
    without the cache: replies are in its records too. An unreadable row counts as missing.
    """

    def __init__(self, path: Path, report: Callable[[str], None] | None = None) -> None:
        self.path = path
        self._report = report
        self._is_off = False
        self._locks: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        make_folder(path.parent, _HINT)
        try:
            self._db = sqlite3.connect(path, timeout=_BUSY_TIMEOUT_S, isolation_level=None)
            try:
                self._prepare()
            except BaseException:
                self._db.close()
                raise
        except sqlite3.Error as error:
            raise self._problem(f"cannot be used: {error}") from error

    def __exit__(self, *_: object) -> None:
        self.close()

    def get(self, key: str) -> Reply | None:
        """Return the reply kept under `key`, marked as cached, or None."""
        # As bytes: SQLite calls the whole file unusable if a text is not UTF-8.
        sql = "SELECT CAST(reply AS BLOB) FROM replies WHERE key = ?"
        row = None
        with self._using():
            row = self._db.execute(sql, (key,)).fetchone() if not self._is_off else None
        with contextlib.suppress(ValueError, TypeError, RecursionError):
            if row is not None:
                found = {**json.loads(row[0].decode()), "cached": True, "attempts": 0}
                return Reply.model_validate(found, strict=True)
        return None

    def put(self, key: str, model_id: str, reply: Reply) -> None:
        """Keep a reply, unless it is empty, truncated or refused."""
        if self._is_off or reply.finish in ("length", "refusal") or not reply.text.strip():
            return
        # The cost in this run does not apply to others.
        fields = reply.model_dump(exclude={"billed_usd"})
        row = (key, model_id, time.time(), json.dumps(fields, separators=(",", ":")))
        with self._using():
            self._db.execute("INSERT OR REPLACE INTO replies VALUES (?, ?, ?, ?)", row)

    def counts(self) -> dict[str, int]:
        """Return the number of replies by model id."""
        sql = "SELECT model, count(*) FROM replies GROUP BY model ORDER BY model"
        with self._using():
            return dict(self._db.execute(sql).fetchall())
        return {}

    def clear(self, model_id: str) -> None:
        """Delete the replies of a model id."""
        with self._using():
            self._db.execute("DELETE FROM replies WHERE model = ?", (model_id,))
            self._db.execute("VACUUM")

    def shared(self, key: str) -> asyncio.Lock:
        """Return the lock under which one task of this process at a time sends a request."""
        return self._locks.setdefault(key, asyncio.Lock())

    def close(self) -> None:
        """Release the file; the cache is not used afterwards."""
        self._db.close()

    def _prepare(self) -> None:
        """Open or create the file so that a committed reply survives the process (WAL)."""
        self._db.execute("BEGIN")
        version = self._db.execute("PRAGMA user_version").fetchone()[0]
        tables = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        self._db.execute("COMMIT")
        if version != SCHEMA and (version != 0 or tables != 0):
            raise self._problem("belongs to another version of phyblock, or is not a reply cache")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = NORMAL")
        if version != SCHEMA:
            self._db.execute("BEGIN IMMEDIATE")
            self._db.execute(_CREATE)
            self._db.execute(f"PRAGMA user_version = {SCHEMA}")
            self._db.execute("COMMIT")

    @contextlib.contextmanager
    def _using(self) -> Iterator[None]:
        """Explain what SQLite raises, or go on without the cache."""
        try:
            yield
        except sqlite3.Error as error:
            if self._report is None:
                raise self._problem(f"cannot be used: {error}") from error
            self._is_off = True
            self._report(f"reply cache {self.path}: cannot be used: {error}; going on without it")

    def _problem(self, message: str) -> StoreError:
        return StoreError(Problem(f"reply cache {self.path}", message, hint=_HINT))
