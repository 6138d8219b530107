"""Suites: models, scenes, presentation and scoring of runs.

The descriptions below become those of the JSON Schema, which editors show beside each key.
"""

from __future__ import annotations

import filecmp
import functools
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BaseModel, Field, PrivateAttr, create_model

from phyblock import types
from phyblock.config import validation
from phyblock.config.models import RECORDED, SamplingSpec
from phyblock.config.validation import Count, Fault, Section, Unique, UniqueSome, checked, form
from phyblock.config.yaml import FieldPath, YamlSource, apply_overrides, dotted, read_yaml
from phyblock.errors import Problem, SpecError
from phyblock.files import bundled
from phyblock.registry import baseline_names, known_track, known_tracks
from phyblock.text import did_you_mean

SectionT = TypeVar("SectionT", bound=BaseModel)
LevelT = TypeVar("LevelT")

BUILTIN_DATASET = "phyblock-400"
"""The data set of suites that name none."""
PROMPT_WORDS = ("default", "official")
REPEAT = "repeats"
"""The factor that changes nothing in requests: its levels repeat them."""
FACTORS: Mapping[str, tuple[str, ...]] = {
    "prompt": (),
    "background": ("images", "background"),
    "view": ("images", "view"),
    "candidate_order": ("candidates", "order"),
    "layout": ("images", "layout"),
    REPEAT: (),
}
"""Factors of `vary` with the path of the field they set; the prompt's depends on the track."""

Prompt = Literal["default", "official"] | validation.Template
Seed = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]
_Order = Annotated[Unique[Literal["goal", "candidates"]], Field(min_length=2, max_length=2)]
Level = Annotated[int, Field(strict=True), validation.OneOf(lambda: (1, 2, 3, 4, 5))]


def _falling(value: tuple[float, float]) -> Iterator[Fault]:
    if value[0] > value[1]:
        yield Fault("begins above its end", "the least and the most, as in [23, 40]")


Range = Annotated[tuple[float, float], checked(_falling)]
"""The least and the most."""


class DifficultySpec(Section):
    """Ranges of difficulty measures, [least, most], that select scenes; null: any."""

    blocks: Range | None = None
    """Number of blocks."""
    depth: Range | None = None
    """Layers: the longest path of dependencies."""
    orders: Range | None = None
    """Decimal logarithm of a lower bound on the number of valid orders."""
    blind: Range | None = None
    """F1 in setting A, 0 to 1, of naming every candidate once."""
    distractor: Range | None = None
    """In how many of type, color and orientation the nearest distractor differs from a needed
    block, on average: 1 to 3."""

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """The ranges that are set."""
        return self.model_dump(exclude_none=True)


class DatasetSpec(Section):
    """The scenes of a run."""

    format: types.DataFormat = "builtin"
    """builtin: the project's format. official: a checkout of the official PhyBlock repository."""
    path: validation.Text | None = None
    """builtin: the name of a bundled data set (default: phyblock-400) or a folder that holds
    scenes.jsonl (./name if it is beside the suite). official: the checkout's folder. Relative to
    the suite file, or with --set to the working directory; ~ and $VARIABLES are expanded."""
    difficulty: DifficultySpec = DifficultySpec()
    """Ranges of difficulty measures that select scenes."""


class ImagesSpec(Section):
    """The pictures that a model is shown."""

    source: Literal["render", "dataset"] = "render"
    """render: drawn from the scene. dataset: the official composites, whole or cut into halves; a
    scene without one is an error."""
    layout: Literal["composite", "separate"] = "composite"
    """composite: goal and candidates in one picture. separate: two pictures."""
    order: _Order = ("goal", "candidates")
    """Order in which separate pictures are sent."""
    size_px: Annotated[int, Field(strict=True, ge=128, le=2048)] = 512
    """Edge of a rendered picture [pixels]."""
    view: types.View = "oblique"
    """View of rendered scenes and candidates; questions have their own views."""
    background: validation.BackgroundName | None = None
    """One of the paper's six backgrounds. null: each question's own, else the dark checkerboard."""


class CandidatesSpec(Section):
    """The presentation of candidates."""

    order: types.CandidateOrder = "file"
    """file: numbered as in the data. shuffled: each seed gives every scene another random order,
    the same for all models; numbers in pictures, prompts and replies follow it."""


class ScoringSpec(Section):
    """The rules of scoring."""

    matchers: UniqueSome[types.Matcher] = ("optimal", "paper")
    """optimal: interchangeable blocks are matched so that as many steps as possible count. paper:
    greedy, the paper's Algorithm 1. The first in the list gives the headline numbers."""
    level1: types.Criterion = "selection"
    """Criterion of Level 1. selection: one-to-one, any order. membership: that of the paper's
    Level-1 columns. aov: as at the other levels."""
    missing: Literal["count", "skip"] = "count"
    """count: a missing reply placed no block. skip: its scene is excluded, as in the paper."""


class LimitsSpec(Section):
    """Limits of a run, which change its speed and not its results."""

    max_concurrency: Count = 64
    """Maximum number of concurrent calls, over all models."""
    max_attempts: Count = 8
    """Number of failed requests after which a sample is given up. Until retry_for_s is over, more
    are sent, except after paid answers that cannot be read."""
    retry_for_s: Annotated[float, Field(strict=True, ge=0)] = 300.0
    """Longest outage that a run waits out [s]: a sample is not given up sooner after its first
    failure, and a model whose server cannot be reached for longer is stopped."""
    timeout_s: validation.TimeoutS = 300.0
    """Maximum wait for one reply [s]."""
    batch_poll_s: validation.TimeoutS = 60.0
    """Maximum time between two polls of a batch [s], for models with batch: true."""
    max_cost_usd: validation.Cost | None = None
    """The run stops before it costs more than this [USD]; null: no limit."""


@dataclass(frozen=True)
class Variant:
    """One combination of levels of the varied factors, without those at the reference level.

    Runs may have different references: names are comparable only if two suites vary the same.
    """

    levels: tuple[tuple[str, str], ...] = ()

    @property
    def key(self) -> str:
        """Its name in a run: `background=lawn,repeats=2`, "" for the reference."""
        return ",".join(f"{factor}={level}" for factor, level in self.levels)

    @property
    def repeat(self) -> int:
        """The number of the repeat, from 1."""
        return int(dict(self.levels).get(REPEAT, "1"))

    @property
    def shown(self) -> Variant:
        """The part of it that changes requests, the same for all repeats."""
        return Variant(tuple(pair for pair in self.levels if pair[0] != REPEAT))


def _lone_level(levels: tuple[object, ...]) -> Iterator[Fault]:
    if len(levels) == 1:
        yield Fault("needs levels to compare", "two or more, the reference first")


Levels = Annotated[Unique[LevelT], checked(_lone_level)]


class VarySpec(Section):
    """Varied conditions of presentation; the first level of each factor is the reference."""

    prompt: Levels[Prompt] = ()
    """Prompts, as in the track's own field; for suites of one track."""
    background: Levels[validation.BackgroundName] = ()
    """Backgrounds of rendered pictures, as images.background."""
    view: Levels[types.View] = ()
    """Views of rendered scenes, as images.view."""
    candidate_order: Levels[types.CandidateOrder] = ()
    """Orders of the candidates, as candidates.order."""
    layout: Levels[Literal["composite", "separate"]] = ()
    """Layouts of pictures, as images.layout."""
    repeats: Annotated[int, Field(strict=True, ge=1, le=100)] = 1
    """Times that each request is sent, with other seeds; only the first may come from the cache."""

    def faults(self) -> Iterator[Fault]:
        """Yield a fault if two templates would have the same name in tables."""
        names = self.names("prompt")
        if twice := sorted({name for name in names if names.count(name) > 1}):
            allowed = "templates of different names"
            yield Fault(f"has two templates called {twice[0]}", allowed, at=("prompt",))

    @property
    def factors(self) -> tuple[str, ...]:
        """The factors that have several levels."""
        return tuple(name for name in FACTORS if len(self.values(name)) > 1)

    def values(self, factor: str) -> tuple[Any, ...]:
        """Return the levels of a factor as values of the suite's field."""
        levels = getattr(self, factor)
        return tuple(range(1, levels + 1)) if factor == REPEAT else tuple(levels)

    def names(self, factor: str) -> tuple[str, ...]:
        """Return the names of a factor's levels in records and tables: a template by its file."""
        texts = map(str, self.values(factor))
        return tuple(PurePath(text).stem if text.endswith(".j2") else text for text in texts)

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All combinations of levels, the reference first, repeats of each in sequence."""
        shown = [name for name in self.factors if name != REPEAT]
        levels = [[(name, level) for level in self.names(name)] for name in shown]
        first = tuple(of_factor[0] for of_factor in levels)
        again = [((REPEAT, name),) if n else () for n, name in enumerate(self.names(REPEAT))]
        return tuple(
            Variant((*(pair for pair in one if pair not in first), *repeat))
            for one in product(*levels)
            for repeat in again
        )


@dataclass(frozen=True)
class SuiteFiles:
    """The file of a suite, and the files that it names.

    `path` is the suite's own, `dataset` the data set's absolute folder, `folders` those of tracks
    with their own data, and `templates` prompt files by track and the prompt's text in the suite.
    """

    path: Path
    dataset: Path
    source: YamlSource = field(repr=False, compare=False)
    folders: Mapping[str, Path] = field(default_factory=dict)
    templates: Mapping[tuple[str, str], Path] = field(default_factory=dict)


class Suite(Section):
    """A suite: models, scenes, presentation and scoring."""

    name: Annotated[str, form(r"^[a-z0-9][a-z0-9-]{0,63}$", f"up to 64 {validation.HYPHENATED}")]
    """Short name: small letters, digits and hyphens. Run folders begin with it."""
    description: str = ""
    """One line on the purpose of the suite."""
    tracks: UniqueSome[Annotated[str, validation.OneOf(known_tracks)]] = ("full_planning",)
    """The tracks to run."""
    dataset: DatasetSpec = DatasetSpec()
    levels: UniqueSome[Level] = (1, 2, 3, 4)
    """Difficulty levels; only generated scenes have level 5."""
    limit: Count | None = None
    """Maximum items per track, spread over levels or subtasks; null: all. --limit overrides it."""
    settings: UniqueSome[types.Setting] = ("A", "B")
    """A compares type, color and orientation, B type and color. Each reply is scored under all."""
    seeds: UniqueSome[Seed] = (0,)
    """Each seed repeats every question."""
    models: Literal["recorded"] | UniqueSome[validation.ModelName]
    """Names from models.yaml or built-in baselines, group:NAME for all models of a group; or
    `recorded` for every folder of recorded replies in the official data."""
    baselines: Unique[Annotated[str, validation.OneOf(baseline_names)]] = ("goal-blind", "random")
    """Built-in baselines that are scored with the models of full_planning, if every track of the
    suite has them; they cost nothing. []: none. A run with only baselines has those it names."""
    prompt: Prompt = "default"
    """default, official (from the official checkout), or a .j2 template, relative to the suite."""
    answer_format: types.AnswerFormat = "text"
    """text: lines of text. json_schema: one JSON object, whose schema the prompt describes; it is
    also sent as response_format if the provider accepts one."""
    images: ImagesSpec = ImagesSpec()
    candidates: CandidatesSpec = CandidatesSpec()
    parser: types.PlanParser = "steps"
    """steps: reads the step list. official: the official expression over the whole reply."""
    scoring: ScoringSpec = ScoringSpec()
    sampling: SamplingSpec = SamplingSpec()
    limits: LimitsSpec = LimitsSpec()
    vary: VarySpec = VarySpec()
    """Conditions of presentation to vary, to measure how much each changes a model's score."""

    _files: SuiteFiles = PrivateAttr()

    def faults(self) -> Iterator[Fault]:
        """Yield the broken rules between fields."""
        conflicts = list(self._conflicts())
        yield from conflicts
        for factor in self.vary.factors if not conflicts else ():
            # The tracks must support a factor, and other fields allow it.
            at, path = ("vary", factor), self._field(factor)
            message = allowed = hint = ""
            for kind in map(known_track, self.tracks):
                if factor not in kind.varies:
                    message, allowed = f"does not apply to {kind.name}", ", ".join(kind.varies)
            if not message and factor == "prompt" and len(self.tracks) > 1:
                message = "is varied in a suite of several tracks, each of which has its own"
                hint = "run one track at a time"
            elif factor in ("background", "view") and self.images.source == "dataset":
                message = "cannot be varied in the data set's own pictures"
                hint = "use images.source: render"
            if message:
                yield Fault(message, allowed, at=at, hint=hint, key=True)
                continue
            first, around = self.vary.values(factor)[0], functools.reduce(getattr, path[:-1], self)
            if path and path[-1] in around.model_fields_set and getattr(around, path[-1]) != first:
                message = f"is varied by vary.{factor}, whose first level is the reference"
                yield Fault(message, str(first), at=path, hint="remove it, or change vary")
            for place, level in enumerate(self.vary.names(factor)):
                for conflict in self.at(Variant(((factor, level),)))._conflicts():
                    yield conflict._replace(at=(*at, place))

    @property
    def files(self) -> SuiteFiles:
        """The files of the suite; only one that was read from a file has them."""
        return self._files

    def with_files(self, files: SuiteFiles) -> Self:
        """Return the suite as if read from these files."""
        suite = self.model_copy()
        suite._files = files
        return suite

    def where(self, *path: str | int) -> str:
        """Return the place ("file:line:col" or "--set ...") of a field, for errors found later."""
        return self.files.source.where(path)

    def section(self, model: type[SectionT]) -> SectionT:
        """Return the section of a track, which the suite must have."""
        return next(value for _, value in self if isinstance(value, model))

    def template(self, track: str) -> Path | None:
        """Return the file of a track's prompt, or None if it is bundled."""
        text = functools.reduce(getattr, known_track(track).prompt_field(), self)
        return self.files.templates.get((track, str(text)))

    def at(self, variant: Variant) -> Self:
        """Return the suite of a variant, with other factors at their reference."""
        suite = self
        levels = {name: self.vary.names(name)[0] for name in self.vary.factors}
        for factor, level in {**levels, **dict(variant.levels)}.items():
            value = self.vary.values(factor)[self.vary.names(factor).index(level)]
            path = self._field(factor)
            for end in range(len(path) - 1, -1, -1):
                around = functools.reduce(getattr, path[:end], suite)
                value = around.model_copy(update={path[end]: value})
            suite = value if path else suite
        return suite

    def _field(self, factor: str) -> tuple[str, ...]:
        """Return the path of the field that a factor sets, () for repeats."""
        return known_track(self.tracks[0]).prompt_field() if factor == "prompt" else FACTORS[factor]

    def identity(self) -> dict[str, Any]:
        """Return everything that determines the results as JSON data, whatever the order of lists.

        Excludes name, description and limits, sections of tracks that are not run, models,
        baselines, seeds, limit and paths (of data and templates): a run stores its models and
        items, and digests of the files, which are more precise and survive a move.
        """
        sections = {kind.section: name for name, kind in known_tracks().items() if kind.section}
        idle = {key for key, track in sections.items() if track not in self.tracks}
        unsaid = {"name", "description", "limit", "limits", "models", "baselines", "seeds", *idle}
        spec = self.model_dump(mode="json", exclude=unsaid)
        for name in ("levels", "settings", "tracks"):
            spec[name].sort()
        for section in ("dataset", *sections):
            spec.get(section, {}).pop("path", None)
        spec["dataset"]["difficulty"] = self.dataset.difficulty.ranges
        if not spec["dataset"]["difficulty"]:
            del spec["dataset"]["difficulty"]
        for part in (spec, *(spec[key] for key in sections if key in spec)):
            if part.get("prompt", PROMPT_WORDS[0]) not in PROMPT_WORDS:
                part["prompt"] = "template"
        spec["vary"]["prompt"] = list(self.vary.names("prompt"))
        return spec

    def _conflicts(self) -> Iterator[Fault]:
        """Yield each broken rule between fields, at the field to change."""
        official, recorded = self.dataset.format == "official", self.models == RECORDED
        as_json, shuffled = self.answer_format == "json_schema", self.candidates.order == "shuffled"
        official_prompt, own_pictures = self.prompt == "official", self.images.source == "dataset"
        if official and self.dataset.path is None:
            message = "must be the folder of a checkout of the official repository"
            hint = "give it on the command line: --set dataset.path=FOLDER"
            yield Fault(message, found="", at=("dataset", "path"), hint=hint)
        other = "set dataset.format to official and dataset.path to a checkout, or this to another"
        clashes = (
            (recorded and not official, "models",
             "only the official data set has recorded replies", other),
            (official_prompt and not official, "prompt",
             "the official prompt is read from an official checkout", other),
            (own_pictures and not official, "images.source",
             "only the official data set has its own pictures", other),
            (as_json and recorded, "answer_format", "recorded replies are text", ""),
            (as_json and official_prompt, "answer_format", "the official prompt asks for text", ""),
            (as_json and self.parser == "official", "parser", "this parser reads no JSON", ""),
            (shuffled and own_pictures, "candidates.order",
             "the data set's own pictures show the candidates in the order of the file", ""),
            (shuffled and recorded, "candidates.order",
             "recorded replies name candidates by the numbers of the file", ""),
        )  # fmt: skip
        for is_broken, name, message, hint in clashes:
            if is_broken:
                yield Fault(message, at=tuple(name.split(".")), hint=hint)


def suite_model() -> type[Suite]:
    """Return the model of a suite file: `Suite` with the sections of all tracks."""
    kinds = known_tracks().values()
    return _composed(tuple((one.section, one.options) for one in kinds if one.options is not None))


@functools.cache
def _composed(sections: tuple[tuple[str, type[BaseModel]], ...]) -> type[Suite]:
    fields: dict[str, Any] = {key: (model, model()) for key, model in sections}
    return create_model("Suite", __base__=Suite, __doc__=Suite.__doc__, **fields)


def load_suite(
    path: Path, overrides: Sequence[str] = (), *, prompt_dirs: Sequence[Path] = ()
) -> Suite:
    """Read, override and validate a suite.

    `overrides` are "key=value" texts. A file in `prompt_dirs` with the name of a bundled prompt
    replaces it for `default`. Raises SpecError with all problems, in the order of the file.
    """
    source = read_yaml(path)
    apply_overrides(source, overrides)
    if source.data is None:
        raise SpecError(Problem(str(path), "is empty", allowed="a suite"))
    # Varied fields have the values of the reference, wherever a single value is needed.
    suite = validation.read_section(suite_model(), source).at(Variant())
    problems: list[Problem] = []

    def existing(text: str, at: FieldPath, *, is_folder: bool = False) -> Path:
        try:
            found = source.file(text, at)
        except SpecError as error:
            problems.extend(error.problems)
            return path
        if not (os.path.isdir if is_folder else os.path.isfile)(found):
            message = f"no such {'folder' if is_folder else 'file'}"
            problems.append(Problem(source.where(at), message, dotted(at), str(found)))
        return found

    def data(text: str, at: FieldPath, may_be_bundled: bool) -> Path:
        if not (may_be_bundled and re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", text)):
            return existing(text, at, is_folder=True)
        folder = bundled("benchmarks", "data", text)
        if not os.path.isdir(folder):
            names = sorted(known.name for known in folder.parent.glob("*/"))
            message = "is not a bundled data set"
            allowed = f"a bundled data set ({', '.join(names)}), or the path of a folder"
            hint = did_you_mean(text, names) or f"for a folder beside the suite write ./{text}"
            problems.append(Problem(source.where(at), message, dotted(at), text, allowed, hint))
        return folder

    is_builtin = suite.dataset.format == "builtin"
    dataset = data(suite.dataset.path or BUILTIN_DATASET, ("dataset", "path"), is_builtin)
    folders: dict[str, Path] = {}
    templates: dict[tuple[str, str], Path] = {}
    for name in suite.tracks:
        kind = known_track(name)
        if kind.has_own_data():
            own = getattr(suite, kind.section)
            folders[name] = data(own.path, (kind.section, "path"), own.format == "builtin")
        varied = enumerate(suite.vary.prompt)
        prompts: dict[str, FieldPath] = {text: ("vary", "prompt", n) for n, text in varied}
        own_prompt = str(functools.reduce(getattr, kind.prompt_field(), suite))
        for text, at in (prompts or {own_prompt: kind.prompt_field()}).items():
            template = kind.template_for(suite.answer_format)
            if text not in PROMPT_WORDS:
                templates[name, text] = existing(text, at)
            elif text == "default" and template is not None:
                near = (folder.absolute() / template.name for folder in prompt_dirs)
                custom = next((file for file in near if os.path.isfile(file)), None)
                if custom and not filecmp.cmp(custom, str(template), shallow=False):
                    templates[name, text] = custom
    if problems:
        raise SpecError(source.in_order(problems))
    return suite.with_files(SuiteFiles(path, dataset, source, folders, templates))
