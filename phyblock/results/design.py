"""The design of a run as its `run.yaml` states it: the rows and columns of every table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from pydantic_core import PydanticCustomError

from phyblock.config.suite import VarySpec
from phyblock.errors import Problem, StoreError
from phyblock.registry import known_tracks, table_names
from phyblock.types import AnswerFormat, CandidateOrder, Criterion, MissingPolicy, Outcome

OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
"""Every outcome, in the order of columns."""

FAILURES: tuple[Outcome, ...] = tuple(outcome for outcome in OUTCOMES if outcome != "ok")
"""Every outcome but `ok`."""

WITHOUT_REPLY: tuple[Outcome, ...] = ("api_error", "missing")
"""Outcomes of samples that the model said nothing about; a refusal is an answer."""

HEADINGS: dict[Outcome, str] = {
    "ok": "OK",
    "parse_failure": "Unparsed",
    "refusal": "Refusal",
    "truncated": "Truncated",
    "api_error": "API error",
    "missing": "Missing",
}
"""What heads the column of each outcome."""

NOT_RUN = "Not run"
"""What heads numbers of samples that there are not."""


SectionT = TypeVar("SectionT", bound=BaseModel)

OVERALL = "overall"
"""Name of the row that pools the scenes of all levels."""


class _Part(BaseModel):
    """A part of run.yaml of which only some keys are read here."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class _Scoring(_Part):
    matchers: tuple[str, ...] = Field(min_length=1)
    level1: Criterion
    missing: MissingPolicy


class _Candidates(_Part):
    order: CandidateOrder = "file"


class _Suite(_Part):
    name: str = ""
    description: str = ""
    tracks: tuple[str, ...] = Field(default_factory=lambda: tuple(known_tracks())[:1])
    levels: tuple[int, ...] = Field(min_length=1)
    settings: tuple[str, ...] = Field(min_length=1)
    seeds: tuple[int, ...] = Field(min_length=1)
    candidates: _Candidates = _Candidates()
    answer_format: AnswerFormat = "text"
    scoring: _Scoring
    vary: VarySpec = VarySpec()
    tables: tuple[str, ...] = Field(default_factory=table_names)


class _Model(_Part):
    name: str
    published: str | None = None
    size_b: float | None = None


class Design(_Part):
    """The plan of a run as its `run.yaml` states it; the rows and columns of every table.

    `items` counts what each track asks about; `scenes_by_level` counts the scenes of each level
    (one scene may be of several), `scenes` all distinct ones. The first matcher and the first
    setting are the headline.
    """

    suite: _Suite
    models: tuple[_Model, ...]
    items: dict[str, int]
    scenes_by_level: dict[int, int]
    scenes: int

    @field_validator("models")
    @classmethod
    def _differ(cls, models: tuple[_Model, ...]) -> tuple[_Model, ...]:
        counts = Counter(model.name for model in models)
        if twice := [name for name, count in counts.items() if count > 1]:
            raise PydanticCustomError("twice", f"names models twice: {', '.join(twice)}")
        return models

    @property
    def model_names(self) -> tuple[str, ...]:
        """Names of the models in the order of the suite."""
        return tuple(model.name for model in self.models)

    @property
    def published(self) -> dict[str, str]:
        """Names in the paper of the models that it knows; Table 1 need not have a row of it."""
        return {model.name: model.published for model in self.models if model.published}

    @property
    def of_suite(self) -> str:
        """The suite as captions of tables end in it, `, suite NAME`; "" where it has no name."""
        return f", suite {self.suite.name}" if self.suite.name else ""

    def after_suite(self, text: str, mark: str = ", ") -> str:
        """A text as figures say it, behind the suite and a mark where the suite has a name."""
        return f"Suite {self.suite.name}{mark}{text}" if self.suite.name else text

    def samples(self, track: str) -> int:
        """Samples that a complete run holds of one model in a track."""
        return self.items.get(track, 0) * self.repeats

    @property
    def all_samples(self) -> int:
        """Samples that a complete run holds."""
        return len(self.models) * sum(self.samples(track) for track in self.suite.tracks)

    @property
    def repeats(self) -> int:
        """Number of samples of an item and model: with every seed, in every way."""
        return len(self.suite.seeds) * self.suite.vary.n_variants

    @property
    def levels(self) -> tuple[str, ...]:
        """Level names in ascending order, then `overall`."""
        return (*(str(level) for level in sorted(self.suite.levels)), OVERALL)

    @property
    def matcher(self) -> str:
        """The headline matcher."""
        return self.suite.scoring.matchers[0]

    @property
    def setting(self) -> str:
        """The headline setting."""
        return self.suite.settings[0]

    @property
    def outcomes_left_out(self) -> frozenset[str]:
        """Outcomes whose samples enter no score under the policy on missing replies."""
        return frozenset(WITHOUT_REPLY) if self.suite.scoring.missing == "skip" else frozenset()

    def criterion(self, level: str) -> str:
        """The criterion that scores a level.

        Level 1 has its own. `overall` counts every scene once by `aov`, or by the Level-1
        criterion where no other level was run.
        """
        only_level1 = set(self.suite.levels) == {1}
        if level == "1" or (level == OVERALL and only_level1):
            return self.suite.scoring.level1
        return "aov"

    def matchers(self, criterion: str) -> tuple[str, ...]:
        """Matchers that a criterion distinguishes; `("",)` for those that know none."""
        return self.suite.scoring.matchers if criterion == "aov" else ("",)

    def expected(self, level: str) -> int:
        """Samples that a complete run holds of one model at a level."""
        scenes = self.scenes if level == OVERALL else self.scenes_by_level.get(int(level), 0)
        return scenes * self.repeats


def read_design(manifest: Mapping[str, Any], where: str = "run.yaml") -> Design:
    """Read the parts of a run's manifest that tables need.

    Raises StoreError naming `where` and every field that is missing or wrong.
    """
    try:
        return Design.model_validate(dict(manifest))
    except ValidationError as error:
        raise _refused(error, where) from error


def read_section(
    suite: Mapping[str, Any], key: str, model: type[SectionT], where: str = "run.yaml"
) -> SectionT:
    """Read a section of a run's suite, with the defaults of what it does not say.

    Fields that only another version knows are left out. Raises StoreError naming `where` and every
    field that is wrong.
    """
    section = suite.get(key)
    known = section if isinstance(section, Mapping) else {}
    try:
        return model.model_validate({n: known[n] for n in model.model_fields if n in known})
    except ValidationError as error:
        raise _refused(error, where, "suite", key) from error


def _refused(error: ValidationError, where: str, *above: str) -> StoreError:
    return StoreError(
        Problem(
            where=where,
            field=".".join(str(part) for part in (*above, *fault["loc"])),
            message=fault["msg"],
            hint="run.yaml is written by `phyblock run` and is never edited",
        )
        for fault in error.errors()
    )
