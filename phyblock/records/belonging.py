"""Which records are a run's own: only they are counted, and only they go on in its folder."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from phyblock.errors import Problem
from phyblock.records.line import Line
from phyblock.records.manifest import Manifest
from phyblock.records.others import Turn
from phyblock.records.record import Record

__all__ = ["Belonging"]

_MESSAGE = "is of another run"
_HINT = (
    "records of different runs are never counted together: take out the lines that are not of "
    "this run, or restore the file from a copy; nothing was changed"
)


@dataclass
class Belonging:
    """What lines must agree with; `samples` are all ids of the run where its plan is known.

    Lines of older versions do not say which run they are of. They are known by what they do say:
    track, model, seed, version of the prompt, and that pictures of one item do not change.

    Where the run had other identities under other readers, lines of these are its own, too, but
    do not count.
    """

    identity: str
    tracks: Collection[str]
    models: Collection[str]
    seeds: Collection[int]
    prompts: Mapping[str, str | None]
    variants: Mapping[str, Mapping[str, Mapping[str, Any]]] = field(default_factory=dict)
    samples: Collection[str] | None = None
    identities: Sequence[str] = ()
    _pictures: dict[tuple[str, str, int], tuple[str, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, manifest: Manifest, samples: Collection[str] | None = None) -> Belonging:
        """What a manifest says of its records; what it does not say is not asked for."""
        suite = manifest.suite
        return cls(
            manifest.identity,
            suite.get("tracks") or (),
            [model.name for model in manifest.models],
            suite.get("seeds") or (),
            {track: _version(about) for track, about in manifest.tracks.items()},
            manifest.variants,
            samples,
            manifest.identities,
        )

    def counts(self, line: Line) -> bool:
        """Whether a line is what readers of the run's own version made of a reply."""
        run = line.run if isinstance(line, Record | Turn) else ""
        # Lines that name no run were the first in the folder.
        return self.identity.startswith(run or next(iter(self.identities), ""))

    def problem(self, where: str, line: Line) -> Problem | None:
        """What shows that a record or turn is of another run, or None."""
        comparisons: Iterator[tuple[str, object, str, bool]] = iter(())
        if isinstance(line, Record):
            comparisons = self._of_record(line)
        elif isinstance(line, Turn):
            comparisons = self._of_turn(line)
        for name, found, allowed, is_alike in comparisons:
            if not is_alike:
                return Problem(where, _MESSAGE, name, str(found), allowed, _HINT)
        return None

    def _of_turn(self, turn: Turn) -> Iterator[tuple[str, object, str, bool]]:
        yield self._run(turn.run)
        yield self._sample(turn.sample)

    def _of_record(self, record: Record) -> Iterator[tuple[str, object, str, bool]]:
        yield self._run(record.run)
        for name, value, known in (
            ("track", record.track, self.tracks),
            ("model", record.model, self.models),
            ("seed", record.seed, self.seeds),
        ):
            yield name, value, _listed(known), not known or value in known
        variant = record.way.key
        begin = f"{record.track}/{record.model}/"
        end = f"/s{record.seed}/{variant}" if variant else f"/s{record.seed}"
        named = f"{begin}{record.item}{end}"
        # An older record without a key may name a question, which only its id tells.
        is_alike = record.sample.startswith(begin) and record.sample.endswith(end)
        is_named = is_alike if not record.key else record.sample == named
        yield "sample", record.sample, named, is_named
        yield self._sample(record.sample)
        if record.prompt is not None:
            of_variant = self.variants.get(record.way.shown.key, {}).get(record.track)
            wanted = self.prompts.get(record.track) if of_variant is None else _version(of_variant)
            version = record.prompt.version
            yield "prompt.version", version, str(wanted), wanted in (None, version)
        if not record.run:
            yield self._shown(record)

    def _run(self, run: str) -> tuple[str, object, str, bool]:
        # A run that was scored again has the identity of the first and says how.
        known = (self.identity, *self.identities)
        return "run", run, self.identity[: len(run)], any(one.startswith(run) for one in known)

    def _sample(self, sample: str) -> tuple[str, object, str, bool]:
        allowed = "a sample of the suite as it is run"
        return "sample", sample, allowed, self.samples is None or sample in self.samples

    def _shown(self, record: Record) -> tuple[str, object, str, bool]:
        """Whether other models were shown the same pictures of this item."""
        images = () if record.prompt is None else record.prompt.images
        digests = tuple(image.sha256 for image in images)
        key = (record.track, record.item, record.seed)
        earlier = self._pictures.setdefault(key, digests) if digests else digests
        return "prompt.images", ", ".join(digests), ", ".join(earlier), digests == earlier


def _version(about: Mapping[str, Any]) -> str | None:
    prompt = about.get("prompt")
    return prompt.get("version") if isinstance(prompt, dict) else None


def _listed(values: Collection[object]) -> str:
    return ", ".join(map(str, list(values)[:8])) + (", ..." if len(values) > 8 else "")
