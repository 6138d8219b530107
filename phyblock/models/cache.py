"""The reply cache: content-addressed, in one SQLite file that processes may share.

A reply is found again when everything that decided it is the same: model, parameters, messages with
their pictures, seed and prompt version. Where the model is served decides nothing: a server that
comes up on another port is not asked everything again. Only whole answers are kept: no error, no
empty, truncated or refused reply, no picture, no key.
"""

from __future__ import annotations

import contextlib
import json
import re
import sqlite3
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from phyblock.errors import Problem, StoreError
from phyblock.models.base import Image, Message, Request
from phyblock.models.config import ModelConfig
from phyblock.models.events import Tell, ignore_text
from phyblock.models.leases import Leases
from phyblock.models.payload import wire_params
from phyblock.models.raw_replies import token_count
from phyblock.records.reply import Reply
from phyblock.stable import hex_digest

__all__ = ["CacheBusyError", "CacheStats", "ReplyCache", "reply_key"]

SCHEMA = 1
"""Version of the file's layout and of what enters a key."""

_LATER_FIELDS = frozenset({"batched", "cached_tokens", "cache_write_tokens"})
"""Fields of a reply and its usage that came after the first files."""

_BUSY_TIMEOUT_S = 5.0
_BUSY = re.compile(r"\b(locked|busy)\b")
_FOREIGN = "belongs to another version of phyblock, or is no reply cache"
_HINT = (
    "delete the file, or name another cache folder; answered samples of a run stay in its records"
)
_WAIT = "wait until the process that holds it has ended, or name another cache folder"
_ELSEWHERE = "free some space, or name another cache folder with PHYBLOCK_CACHE"
_CREATE = """
CREATE TABLE IF NOT EXISTS replies (
    key TEXT PRIMARY KEY,
    model TEXT NOT NULL,
    stored_at REAL NOT NULL,
    reply TEXT NOT NULL
) WITHOUT ROWID
"""


class CacheBusyError(StoreError):
    """Another process holds the file: it may be free in a moment."""


@dataclass(frozen=True)
class CacheStats:
    """Number of replies, by model id too; size of the file; when the first and last came [s]."""

    path: Path
    replies: int
    by_model: dict[str, int]
    size_bytes: int
    oldest_s: float | None
    newest_s: float | None


def reply_key(config: ModelConfig, request: Request) -> str:
    """Hex digest of everything that decides the reply."""
    content = {
        "schema": SCHEMA,
        "model": {**config.identity(), "params": wire_params(config, request)},
        "messages": [_message(message) for message in request.messages],
        "seed": request.seed,
        "prompt_version": request.prompt_version,
    }
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hex_digest(canonical)


def _message(message: Message) -> list[object]:
    parts = [{"image": p.sha256} if isinstance(p, Image) else p for p in message.parts]
    return [message.role, parts]


class ReplyCache:
    """Replies by key, and the questions that are being asked.

    Every method raises StoreError when the file is broken or cannot be used, CacheBusyError when
    another process held it for `busy_timeout_s`. A single row that cannot be read is as good as
    missing; `tell` hears of the first. To be used in the thread that made it.
    """

    def __init__(
        self, path: Path, busy_timeout_s: float = _BUSY_TIMEOUT_S, tell: Tell = ignore_text
    ) -> None:
        self.path = path
        self._tell = tell
        self._is_told = False
        self._leases: Leases | None = None
        with self._explained():
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise self._problem(f"cannot be made: {error.strerror}", hint=_ELSEWHERE) from error
            self._db = sqlite3.connect(path, timeout=busy_timeout_s, isolation_level=None)
            try:
                self._prepare()
            except BaseException:
                self._db.close()
                raise

    def __enter__(self) -> ReplyCache:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def get(self, key: str) -> Reply | None:
        """The reply kept under `key`, marked as cached, or None."""
        # As bytes: SQLite calls the whole file unusable where a text is no UTF-8.
        sql = "SELECT CAST(reply AS BLOB) FROM replies WHERE key = ?"
        with self._explained():
            row = self._db.execute(sql, (key,)).fetchone()
        if row is None:
            return None
        try:
            return _reply(json.loads(row[0]))
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            if not self._is_told:
                self._is_told = True
                why = f"{type(error).__name__}: {error}"
                self._tell(f"reply cache {self.path}: holds a broken reply, asked anew ({why})")
            return None

    def __contains__(self, key: object) -> bool:
        return isinstance(key, str) and self.get(key) is not None

    def put(self, key: str, model_id: str, reply: Reply) -> bool:
        """Keep a reply, unless it is empty, truncated or refused; whether it was kept."""
        if reply.finish in ("length", "refusal") or not reply.text.strip():
            return False
        # What this run paid is no part of what another finds.
        reply = reply.model_copy(update={"billed_usd": None})
        text = json.dumps(_fields(reply), ensure_ascii=True, separators=(",", ":"))
        with self._explained():
            self._db.execute(
                "INSERT OR REPLACE INTO replies VALUES (?, ?, ?, ?)",
                (key, model_id, time.time(), text),
            )
        return True

    @contextlib.contextmanager
    def leases(self) -> Iterator[Leases]:
        """What is being asked now, by all who share the file."""
        with self._explained():
            if self._leases is None:
                self._leases = Leases(self._db)
            yield self._leases

    def stats(self) -> CacheStats:
        """What the cache holds."""
        with self._explained():
            rows = self._db.execute(
                "SELECT model, count(*), min(stored_at), max(stored_at) FROM replies "
                "GROUP BY model ORDER BY model"
            ).fetchall()
        files = (self.path.with_name(self.path.name + end) for end in ("", "-wal"))
        return CacheStats(
            self.path,
            sum(row[1] for row in rows),
            {row[0]: row[1] for row in rows},
            sum(file.stat().st_size for file in files if file.exists()),
            min((row[2] for row in rows), default=None),
            max((row[3] for row in rows), default=None),
        )

    def clear(self, model_id: str | None = None) -> int:
        """Drop all replies, or those of one model id; returns how many."""
        with self._explained():
            if model_id is None:
                dropped = self._db.execute("DELETE FROM replies").rowcount
            else:
                sql = "DELETE FROM replies WHERE model = ?"
                dropped = self._db.execute(sql, (model_id,)).rowcount
            self._db.execute("VACUUM")
        return dropped

    def close(self) -> None:
        """Release the file; the cache is not used afterwards."""
        self._db.close()

    def _prepare(self) -> None:
        """Open the file, or make it.

        In WAL mode a committed reply survives the death of the process, and readers do not wait
        for a writer.
        """
        self._db.execute("BEGIN")
        version = self._db.execute("PRAGMA user_version").fetchone()[0]
        tables = self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        self._db.execute("COMMIT")
        if version != SCHEMA and (version != 0 or tables != 0):
            raise self._problem(_FOREIGN, found=f"schema {version}", allowed=f"schema {SCHEMA}")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = NORMAL")
        if version != SCHEMA:
            self._db.execute("BEGIN IMMEDIATE")
            self._db.execute(_CREATE)
            self._db.execute(f"PRAGMA user_version = {SCHEMA}")
            self._db.execute("COMMIT")

    @contextlib.contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            if _BUSY.search(str(error)):
                raise CacheBusyError(self._said(f"cannot be used: {error}", hint=_WAIT)) from error
            # The disk or the place, not the content: to delete paid replies would be no help.
            raise self._problem(f"cannot be used: {error}", hint=_ELSEWHERE) from error
        except sqlite3.Error as error:
            raise self._problem(f"cannot be used: {error}") from error

    def _problem(
        self, message: str, found: str = "", allowed: str = "", hint: str = _HINT
    ) -> StoreError:
        return StoreError(self._said(message, found, allowed, hint))

    def _said(self, message: str, found: str = "", allowed: str = "", hint: str = _HINT) -> Problem:
        where = f"reply cache {self.path}"
        return Problem(where, message, found=found, allowed=allowed, hint=hint)


def _fields(reply: Reply) -> dict[str, Any]:
    """What is kept of a reply, without later fields that say nothing: earlier versions share the
    file, and take a reply with a field that they do not know for broken.
    """
    fields = reply.model_dump()
    for place in (fields, fields["usage"]):
        for name in _LATER_FIELDS & place.keys():
            if place[name] is None or place[name] is False:
                del place[name]
    return fields


def _reply(stored: dict[str, Any]) -> Reply:
    # Older files may hold counts that a server made up.
    usage = {name: token_count(number) for name, number in stored["usage"].items()}
    found = {**stored, "usage": usage, "cached": True, "attempts": 0}
    return Reply.model_validate(found, strict=True)
