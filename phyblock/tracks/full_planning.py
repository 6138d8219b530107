"""Full planning: a whole plan in one reply."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np

from phyblock.config.suite import Suite
from phyblock.config.validation import PictureControls
from phyblock.data import AssemblyTask, Dataset, official_prompt
from phyblock.domain import Block, CandidateSet, Plan, Scene
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models.request import Image
from phyblock.parsing.plan import ParsedPlan, parse_plan, plan_form, reader_version
from phyblock.parsing.structured import AnswerForm
from phyblock.records.line import Line
from phyblock.records.record import Record, ShownScene
from phyblock.resources import bundled
from phyblock.scoring.counts import Floats, ratio_of
from phyblock.scoring.plan import AssemblyScorer, Score
from phyblock.stable import drawn_bytes
from phyblock.tracks.base import (
    AS_IN_FILE,
    Opening,
    TrackKind,
    WholePlanTrack,
    assembly_pictures,
    task_showing,
    template_prompt,
)
from phyblock.tracks.baselines import Picking, candidate_choices
from phyblock.tracks.goal_blind import BlindGuesses
from phyblock.tracks.items import Examples, TaskShowing, examples_of, file_plan, select_tasks
from phyblock.tracks.measures import Measure, SampleCounts, TrackReport
from phyblock.tracks.pictures import Pictures
from phyblock.tracks.prompts import OfficialPrompt, Prompt
from phyblock.types import AnswerFormat, Level1Criterion, Matcher, PlanParser, Setting


class PlanParse(Line):
    """The plan that was read in a reply."""

    parser: str
    """How replies are read."""
    rule: str | None
    """The rule that matched; null: nothing could be read."""
    plan: tuple[int, ...]
    """Candidate numbers in order, as they were shown."""
    file_plan: tuple[int, ...] | None = None
    """The same in the numbers of the file; null: those are the ones that were shown."""
    dropped: tuple[int, ...] = ()
    """Numbers that no candidate has."""
    version: int = 1
    """Version of the parser."""
    problem: str | None = None
    """Why nothing could be read."""
    truncated: bool = False
    """True where the text breaks off within the plan."""


PLAN_COLUMNS = dict.fromkeys(("parser", "plan", "file_plan", "dropped", "shown"), "object")


def plan_row(parse: PlanParse | None, shown: ShownScene | None) -> Mapping[str, Any]:
    """The values of `PLAN_COLUMNS`; `shown` is None for what was shown as the file has it."""
    order = None if shown is None else shown.fields()
    if parse is None:
        return {**dict.fromkeys(PLAN_COLUMNS), "shown": order}
    in_file = parse.plan if parse.file_plan is None else parse.file_plan
    return {
        "parser": parse.parser,
        "plan": list(parse.plan),
        "file_plan": list(in_file),
        "dropped": list(parse.dropped),
        "shown": order,
    }


def score_fields(score: Score) -> dict[str, Any]:
    """A score as records hold it."""
    return {
        "criterion": score.criterion,
        "matcher": score.matcher,
        "setting": score.setting,
        "tp": score.counts.tp,
        "fp": score.counts.fp,
        "fn": score.counts.fn,
        "errors": score.errors,
        "placed": None if score.vertices is None else list(score.vertices),
        "why": None if score.step_errors is None else list(score.step_errors),
        "blocks": score.blocks,
        "kept": score.kept,
    }


def pose_choices(
    scene: Scene, candidates: CandidateSet, steps: Sequence[int]
) -> Iterator[tuple[bool, bool]]:
    """For each kind that could be chosen wrongly and was named: whether the pose that is listed
    first is right, and whether the pose that was named first is.

    Such a kind is needed in one pose or several, and offered in a pose in which it is not. Numbers
    that no candidate has name nothing.
    """
    needed = {block.look for block in scene.blocks}
    kinds = {block.kind for block in scene.blocks}
    chosen: dict[Any, bool] = {}
    for step in steps:
        if 1 <= step <= len(candidates):
            one = candidates[step]
            chosen.setdefault(one.kind, one.look in needed)
    for kind in sorted(kinds & set(chosen)):
        right = [one.look in needed for one in candidates.candidates if one.kind == kind]
        if not all(right):
            yield right[0], chosen[kind]


def pose_counts(
    scene: Scene, candidates: CandidateSet, steps: Sequence[int]
) -> tuple[int, int, int, int]:
    """The numbers of `POSE_COUNTS`."""
    choices = list(pose_choices(scene, candidates, steps))
    first = [is_right for is_first, is_right in choices if is_first]
    later = [is_right for is_first, is_right in choices if not is_first]
    return sum(first), len(first), sum(later), len(later)


def _count(item: Any, judged: Any) -> tuple[int, int, int, int]:
    return pose_counts(item.scene, item.candidates, judged.steps)


def _first(sums: Floats) -> Floats:
    return ratio_of(sums[..., :2])


def _later(sums: Floats) -> Floats:
    return ratio_of(sums[..., 2:])


def _gap(sums: Floats) -> Floats:
    return np.asarray(_first(sums) - _later(sums))


POSE_COUNTS = SampleCounts(
    "poses", ("first_right", "first_n", "later_right", "later_n"), sample=_count
)
POSE_MEASURES = (
    Measure(
        "pose_first",
        "Right pose, listed first",
        POSE_COUNTS,
        _first,
        "kinds named in the right pose, of those whose right pose is listed first among others",
        over="kinds",
    ),
    Measure(
        "pose_later",
        "Right pose, listed later",
        POSE_COUNTS,
        _later,
        "the same, of those of which a wrong pose is listed first",
        over="kinds",
    ),
    Measure(
        "pose_gap",
        "Listed first less later",
        POSE_COUNTS,
        _gap,
        "what is won by the place in the list: nothing, for a model that goes by the picture",
        better="lower",
        over="kinds",
        is_difference=True,
    ),
)


class PlanningSpec(PictureControls):
    """Presentation of scenes in the full_planning track, beside `images` and `candidates`."""


class PlanRecord(Record):
    """A plan for a scene."""

    track: Literal["full_planning"]
    """`full_planning`."""
    parse: PlanParse | None = None
    """The plan that was read."""

    columns: ClassVar[Mapping[str, str]] = PLAN_COLUMNS

    def row(self) -> Mapping[str, Any]:
        """The plan in both numberings, and by which parser it was read."""
        return plan_row(self.parse, self.shown)


_RANDOM_STEPS = 4
"""As in the paper's Random row."""


@dataclass(frozen=True)
class PlanSubject:
    """A whole plan is asked for; `guess` gives one that was learned without the goal."""

    scene: Scene
    candidates: CandidateSet
    guess: Callable[[], Plan] = field(default=Plan, compare=False)


def plan_text(steps: Iterable[int]) -> str:
    """A plan in the benchmark's own reply form."""
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


def _random_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    return plan_text(int(n) for n in rng.integers(1, len(subject.candidates) + 1, _RANDOM_STEPS))


def _all_candidates(subject: PlanSubject, _: np.random.Generator) -> str:
    return plan_text(range(1, len(subject.candidates) + 1))


def _oracle_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    blocks = subject.scene.blocks
    return plan_text(_needed(subject, blocks[v]) for v in subject.scene.graph.random_order(rng))


def _unoriented_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    """A valid order in which every block stands wrongly, wherever a wrong one can be chosen."""
    blocks = subject.scene.blocks
    order = subject.scene.graph.random_order(rng)
    return plan_text(
        _turned(subject.candidates, blocks[v], rng) or _needed(subject, blocks[v]) for v in order
    )


def _first_poses(subject: PlanSubject, rng: np.random.Generator) -> str:
    """A valid order of the right kinds, of each kind the pose that is listed first."""
    blocks = subject.scene.blocks
    order = subject.scene.graph.random_order(rng)
    first = subject.candidates.first_of
    return plan_text(first(blocks[v].kind) or _needed(subject, blocks[v]) for v in order)


def _goal_blind(subject: PlanSubject, _: np.random.Generator) -> str:
    return plan_text(subject.guess().steps)


def _needed(subject: PlanSubject, block: Block) -> int:
    index = subject.candidates.index_of(block.look)
    if index is None:
        found = f"{block.color} {block.type} turned {block.euler_deg}"
        where = f"scene {subject.scene.id}"
        message = "no candidate looks like this block"
        raise DataError(Problem(where, message, f"blocks[order={block.order}]", found))
    return index


def _turned(candidates: CandidateSet, block: Block, rng: np.random.Generator) -> int | None:
    """Number of a candidate of the block's kind that looks otherwise, or None."""
    numbers = range(1, len(candidates) + 1)
    wrong = [
        n for n in numbers if candidates[n].kind == block.kind and candidates[n].look != block.look
    ]
    return wrong[int(rng.integers(len(wrong)))] if wrong else None


PLAN_RULES = {
    "random": _random_plan,
    "all-candidates": _all_candidates,
    "goal-blind": _goal_blind,
    "first-pose": _first_poses,
    "oracle": _oracle_plan,
    "oracle-no-orientation": _unoriented_plan,
}
"""Rules by name of the baseline."""
PLAN_FLOORS = ("goal-blind", "all-candidates", "random")
"""Those that never see the goal."""


_MOST_STEPS = 99
"""Far above what any goal has."""


def pick_plan(subject: PlanSubject) -> Picking:
    """Any candidates, each as often as needed."""
    return Picking(
        candidate_choices(len(subject.candidates)),
        least=1,
        most=_MOST_STEPS,
        repeats=True,
        noun="step",
        write=lambda picks: plan_text(pick.place + 1 for pick in picks),
    )


def can_be_worked(task: AssemblyTask) -> bool:
    """True if every block of the goal is among the candidates."""
    return all(task.candidates.index_of(block.look) is not None for block in task.scene.blocks)


def worked_plan(task: AssemblyTask, form: AnswerForm[list[int]] | None) -> str:
    """A right answer in the form that is asked for, None for text.

    Blocks are placed in a valid order that does not follow that of the file.
    """
    looks = [task.scene.blocks[vertex].look for vertex in _drawn_order(task.scene)]
    numbers = [task.candidates.index_of(look) for look in looks]
    steps = [number for number in numbers if number is not None]
    if form is None:
        return plan_text(steps)
    reasoning = f"The goal has {len(steps)} blocks. Each is placed once all it rests on is there."
    return form.write(steps, reasoning)


def _drawn_order(scene: Scene) -> list[int]:
    """Vertices in a valid order: the next is the ready one whose digest is the least."""

    def place(vertex: int) -> bytes:
        return drawn_bytes("example plan", scene.id, vertex)

    order: list[int] = []
    while ready := scene.graph.ready(sum(1 << vertex for vertex in order)):
        order.append(min(ready, key=place))
    return order


@dataclass(frozen=True)
class PlanningRules:
    """Rules of parsing and scoring; the first matcher is the headline."""

    parser: PlanParser
    settings: tuple[Setting, ...]
    matchers: tuple[Matcher, ...]
    level1: Level1Criterion | None
    answer_format: AnswerFormat = "text"

    def form(self, item: AssemblyTask) -> AnswerForm[list[int]] | None:
        """The form in which a plan for a scene is asked for; None where that is text."""
        return None if self.answer_format == "text" else plan_form(len(item.candidates))

    def read(self, item: AssemblyTask, text: str) -> ParsedPlan:
        """The plan that a reply holds."""
        return parse_plan(text, len(item.candidates), self.parser)


@dataclass(frozen=True)
class PlanJudgement:
    """A reply as it was parsed and scored."""

    parser: PlanParser
    parsed: ParsedPlan
    scores: tuple[Score, ...]
    in_file: tuple[int, ...] | None = None
    """The plan in the numbers of the file, where others were shown."""

    @property
    def steps(self) -> tuple[int, ...]:
        """The candidates that were named, in order."""
        return self.parsed.plan.steps

    @property
    def is_read(self) -> bool:
        """True if a rule matched."""
        return self.parsed.rule is not None

    def fields(self) -> dict[str, Any]:
        """`parse` and `scores` of the record (docs/results.md)."""
        return {
            "parse": {
                "parser": self.parser,
                "rule": self.parsed.rule,
                "plan": list(self.parsed.plan.steps),
                "file_plan": self.in_file,
                "dropped": list(self.parsed.dropped),
                "version": reader_version(self.parser),
                "problem": self.parsed.problem,
                "truncated": self.parsed.truncated,
            },
            "scores": [score_fields(score) for score in self.scores],
        }


class FullPlanning(WholePlanTrack[PlanningRules, Pictures]):
    """Prompt, parse and score of the track; pure but for the pictures it asks for."""

    name = "full_planning"

    def __init__(
        self,
        rules: PlanningRules,
        prompt: Prompt | None = None,
        pictures: Pictures | None = None,
        items: Sequence[AssemblyTask] = (),
        showing: TaskShowing = AS_IN_FILE,
        pool: Sequence[AssemblyTask] = (),
        examples: Examples[AssemblyTask] | None = None,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording; from `pool`, else
        `items`, baselines learn. `examples` are in the form in which they are shown.
        """
        super().__init__(rules, prompt, pictures, items, showing, examples)
        self._guesses = BlindGuesses(showing, pool or items, rules.settings[0])
        self._scorers: dict[object, AssemblyScorer] = {}

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """Return the variables of templates; nothing in it gives an answer away."""
        scale = None if self._pictures is None else self._pictures.candidate_scale
        return {**super().facts(item, pictures), "candidate_scale": scale}

    def _right_answer(self, item: AssemblyTask) -> str:
        return worked_plan(item, self._form(item))

    def _subject(self, item: AssemblyTask) -> PlanSubject:
        guess = partial(self._guesses.plan, item)
        return PlanSubject(item.scene, item.candidates, guess)

    def judge(self, item: AssemblyTask, text: str | None) -> PlanJudgement:
        """Read and score a reply; None, where there is no reply, is scored as an empty plan."""
        parsed = ParsedPlan(Plan(), None) if text is None else self.rules.read(item, text)
        key = (item.key, item.candidates)
        scorer = self._scorers.get(key)
        if scorer is None:
            scorer = AssemblyScorer(item.scene, item.candidates, self.rules.settings)
            self._scorers[key] = scorer
        scores = scorer.score(parsed.plan, self.rules.matchers, self.rules.level1)
        in_file = file_plan(item, parsed.plan.steps)
        return PlanJudgement(self.rules.parser, parsed, scores, in_file)


def open_full_planning(opening: Opening) -> FullPlanning:
    """The track; SpecError, DataError or PromptError with what is wrong."""
    suite = opening.suite
    tasks = select_tasks(opening.dataset.tasks, suite.levels, opening.limit)
    pool = opening.dataset.tasks
    showing = task_showing(suite, PlanningSpec, FullPlanning.name, tasks, pool)
    if not opening.with_prompts:
        return FullPlanning(_rules(suite), items=tasks, showing=showing, pool=pool)
    if suite.images.source == "dataset":
        _check_composites(opening.dataset, tasks)
    prompt, pictures = _prompt(opening.suite), assembly_pictures(suite, opening.shop)
    as_shown = TaskShowing(replace(showing.how, wrong_image=False))
    able = [
        as_shown.of(task, suite.seeds[0])
        for task in pool
        if can_be_worked(task) and (task.composite or suite.images.source == "render")
    ]
    examples = examples_of(opening.suite, able, tasks, "scene", stand_ins=showing.stand_ins)
    return FullPlanning(_rules(suite), prompt, pictures, tasks, showing, pool, examples)


def _rules(suite: Suite) -> PlanningRules:
    """Return the rules by which a suite parses and scores plans."""
    level1 = suite.scoring.level1
    criterion = None if level1 == "aov" else level1
    matchers, asked = suite.scoring.matchers, suite.answer_format
    return PlanningRules(suite.parser, suite.settings, matchers, criterion, asked)


def _prompt(suite: Suite) -> Prompt:
    if suite.prompt != "official":
        return template_prompt(suite, FullPlanning.name)
    if suite.dataset.format != "official":
        message = "the official prompt is read from the official data set"
        hint = "set dataset.format to official and dataset.path to its checkout"
        raise SpecError(Problem(str(suite.files.path), message, "prompt", "official", hint=hint))
    return OfficialPrompt(official_prompt(suite.files.dataset))


def _check_composites(dataset: Dataset, tasks: Sequence[AssemblyTask]) -> None:
    """Raise DataError when the data set has no picture of a scene."""
    lacking = [task.key for task in tasks if task.composite is None]
    if lacking:
        message = f"has no picture of {len(lacking)} of {len(tasks)} scenes"
        found = ", ".join(lacking[:8]) + (", ..." if len(lacking) > 8 else "")
        hint = "render them: --set images.source=render"
        raise DataError(Problem(str(dataset.root), message, "images.source", found, hint=hint))


def _report() -> TrackReport:
    from phyblock.tracks.full_planning_results import REPORT

    return REPORT


TRACK = TrackKind(
    name=FullPlanning.name,
    title="Full planning",
    item="scene",
    about="a whole plan in one reply",
    open=open_full_planning,
    report=_report,
    subject=PlanSubject,
    baselines=PLAN_RULES,
    by_hand=pick_plan,
    section=("full_planning", PlanningSpec, "How scenes are shown in the full_planning track."),
    record=PlanRecord,
    template=bundled("prompts", "full_planning.j2"),
    json_template=bundled("prompts", "full_planning_json.j2"),
    counted=(POSE_COUNTS,),
    tables=("table1", "errors", "losses"),
    rescored=True,
    no_examples="",
    varies=("prompt", "background", "view", "candidate_order", "layout", "examples", "repeats"),
)
