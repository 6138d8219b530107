"""Recorded replies in the place of a model: a folder of raw replies, or a run of our own."""

from __future__ import annotations

from pathlib import Path

from phyblock.config.models import ModelConfig
from phyblock.errors import DataError, Problem, RefusedError, SampleError, reason_of
from phyblock.files import load_json, read_text
from phyblock.models.base import Request
from phyblock.models.raw_replies import RawReply, read_raw_reply
from phyblock.records import RECORDS, Recorded, RecordedLines
from phyblock.records.reply import Reply

__all__ = ["ReplayModel", "open_replay"]


class ReplayModel:
    """Raw provider replies, one file a request: `<key>.json`, or one `<key>_*.json`."""

    needs_messages = False

    def __init__(self, config: ModelConfig, folder: Path) -> None:
        self.name = config.name
        self._folder = folder

    async def ask(self, request: Request) -> Reply | None:
        """The reply recorded for the request's key, whatever its seed, or None.

        Raises DataError when the file is no JSON, or a reply of no known shape.
        """
        path = self._file(request.key)
        if path is None:
            return None
        raw = read_raw_reply(_read_json(path), str(path))
        return _replayed(raw)

    async def aclose(self) -> None:
        """Nothing is held open."""

    def _file(self, key: str) -> Path | None:
        path = self._folder / f"{key}.json"
        if path.is_file():
            return path
        others = sorted(p for p in self._folder.glob(f"{_escaped(key)}_*.json") if p.is_file())
        if len(others) > 1:
            names = ", ".join(p.name for p in others)
            message = "holds more than one recording of a scene"
            raise DataError(Problem(str(self._folder), message, key, names, f"one {key}*.json"))
        return others[0] if others else None


class RunReplayModel:
    """The replies in a run folder's records, matched by track, key and seed."""

    needs_messages = False

    def __init__(self, config: ModelConfig, path: Path) -> None:
        self.name = config.name
        self._records = _read_records(path, config.name)

    async def ask(self, request: Request) -> Reply | None:
        """The reply recorded for the request's track, key and seed, or None.

        Raises SampleError or RefusedError where that is what was recorded.
        """
        known, what = self._records, (request.key, request.seed)
        record = known.get((request.track, *what)) or known.get(("", *what))
        if record is None:
            return None
        error = record.error
        if error is not None and error.kind in ("sample", "refused"):
            cls = RefusedError if error.kind == "refused" else SampleError
            raise cls(error.message, status=error.status)
        if record.reply is None:
            return None
        return record.reply.model_copy(update={"cost_usd": 0.0, "attempts": 0, "cached": False})

    async def aclose(self) -> None:
        """Nothing is held open."""


def open_replay(config: ModelConfig) -> ReplayModel | RunReplayModel:
    """The recording that a configuration names.

    A folder with `records.jsonl` is a run of our own, any other a folder of raw replies. Raises
    DataError when there is no such folder, or no JSON in it.
    """
    folder = config.recording
    where = f"model {config.name}"
    if folder is None or not folder.is_dir():
        hint = "check the path; it is taken relative to the file that names it"
        problem = Problem(where, "recordings not found", "replay", str(folder), "a folder", hint)
        raise DataError(problem)
    if (folder / RECORDS).is_file():
        return RunReplayModel(config, folder / RECORDS)
    if not any(folder.glob("*.json")):
        allowed = f"a file a scene such as 000.json, or {RECORDS}"
        raise DataError(Problem(str(folder), "holds no recorded replies", allowed=allowed))
    return ReplayModel(config, folder)


def _replayed(raw: RawReply) -> Reply:
    return Reply(
        text=raw.text,
        reasoning=raw.reasoning,
        finish=raw.finish,
        usage=raw.usage,
        cost_usd=0.0,
        provider_model=raw.model,
        attempts=0,
    )


def _read_json(path: Path) -> object:
    try:
        return load_json(read_text(path), finite=False)
    except OSError as error:
        raise DataError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    except ValueError as error:
        where = f"{path}:{getattr(error, 'lineno', 1)}:{getattr(error, 'colno', 1)}"
        raise DataError(Problem(where, f"is not JSON: {error}")) from error


def _read_records(path: Path, model: str) -> dict[tuple[str, str, int], Recorded]:
    """Records of one model by track, key and seed; the last one counts where a sample has several.

    An unfinished last line, which a killed run leaves, is not there yet. A run of one model is
    that model's whatever its name. Of a varied run the reference alone counts.
    """
    found: dict[str, dict[tuple[str, str, int], Recorded]] = {}
    for _, record in RecordedLines(path):
        if record.variant:
            continue
        found.setdefault(record.model, {})[record.track, record.key, record.seed] = record
    if model in found:
        return found[model]
    if len(found) == 1:
        return next(iter(found.values()))
    raise DataError(
        Problem(str(path), "has no records of this model", "model", model, ", ".join(found))
    )


def _escaped(key: str) -> str:
    return "".join(f"[{char}]" if char in "*?[" else char for char in key)
