"""Step planning: one block at a time, in a simulator."""

from __future__ import annotations

import asyncio
import json
from collections import Counter, OrderedDict
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field

from phyblock.config.suite import Suite
from phyblock.config.validation import Count, Flag, PictureControls, TemplateName
from phyblock.data import AssemblyTask
from phyblock.domain import Block, CandidateSet, Plan, Scene
from phyblock.models.request import Image, Message, Request
from phyblock.parsing.move import MoveProblem, ParsedMove, move_form, parse_move
from phyblock.parsing.structured import AnswerForm
from phyblock.records.line import Line, Whole
from phyblock.records.record import AskedTurn, Course, Record
from phyblock.records.reply import Reply
from phyblock.resources import bundled
from phyblock.scoring.counts import Counts
from phyblock.scoring.plan import ERROR_TYPES, ErrorType
from phyblock.scoring.steps import Assembly, MoveOutcome, attempted_counts, placed_counts
from phyblock.sim.dynamics import DEFAULT_TRIAL, ONE_SETTING, Settled, settle
from phyblock.sim.engine import described_engine
from phyblock.sim.pictures import PictureStyle, goal_style
from phyblock.sim.question_pictures import question_key, question_png, state_picture
from phyblock.stable import hex_digest
from phyblock.tracks.base import (
    Opening,
    TrackKind,
    assembly_pictures,
    check_drawn,
    engine_identity,
    task_showing,
    template_prompt,
)
from phyblock.tracks.baselines import Choice, Pick, Picking, candidate_choices
from phyblock.tracks.full_planning import PLAN_COLUMNS, POSE_COUNTS, PlanParse, plan_row
from phyblock.tracks.goal_blind import BlindGuesses
from phyblock.tracks.items import Showing, TaskShowing, file_plan, select_tasks, showing_fields
from phyblock.tracks.measures import TrackReport
from phyblock.tracks.pictures import Drawing, Pictures
from phyblock.tracks.prompts import TemplatePrompt, form_facts, response_format
from phyblock.types import AnswerFormat, CandidateScale, Gating, Physics, Setting

PositiveUsd = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]


class StepsSpec(PictureControls):
    """The rules of the step_planning track: the simulator, what is shown, when it ends."""

    setting: Setting | None = Field(
        default=None,
        description="By which the simulator lets a step succeed; null: by the first of settings. "
        "With B, blocks that are turned wrongly are placed, and count as wrong in A.",
    )
    gating: Gating = Field(
        default="aov",
        description="aov: a block can be placed when all it rests on is. layer: when all lower "
        "layers are complete, as in the official code.",
    )
    physics: Physics = Field(
        default="settle",
        description="off: placed blocks stay where they are. settle: every new state is simulated; "
        "what would fall is recorded and held. strict: a structure that collapses ends the "
        "episode.",
    )
    feedback: Feedback = Field(
        default="success", description="What the model is told of each of its steps."
    )
    history: History = Field(
        default="text",
        description="Earlier steps as a text in one message, or as the turns of a conversation.",
    )
    memory: Count | None = Field(
        default=None, description="Earlier steps that are shown; null: all."
    )
    cot: Flag = Field(default=True, description="Ask for reasoning before the step.")
    samples: Count = Field(default=1, description="Replies asked for each step.")
    vote: Literal["majority"] = Field(
        default="majority", description="How several replies become one step."
    )
    max_steps: Count | None = Field(
        default=None, description="Steps at most; null: twice the number of blocks."
    )
    max_failures: Count | None = Field(
        default=5, description="Failed steps in a row that end an episode; null: no bound."
    )
    max_repeats: Count | None = Field(
        default=3,
        description="Failures in a row of one and the same step that end an episode; null: no "
        "bound.",
    )
    max_episode_tokens: Count | None = Field(
        default=None, description="Tokens of an episode, prompts included; null: no bound."
    )
    max_episode_usd: PositiveUsd | None = Field(
        default=None, description="Dollars of an episode; null: no bound."
    )
    prompt: TemplateName = Field(
        default="default", description="default, or the path of a .j2 template."
    )


class MoveParse(Line):
    """The operation that was read in a turn's reply."""

    rule: str | None
    """The rule that matched."""
    move: int | Literal["Done"] | None
    """The candidate's number, `Done`, or null."""
    problem: str | None = None
    """Why no single operation could be read."""


class EpisodeTurn(AskedTurn):
    """One request of an episode, with its reply and what came of it."""

    key: str = ""
    """The scene, the step, and the vote where a step has several."""
    seed: Whole = 0
    """The seed that was sent."""
    step: Whole
    """The step that it belongs to, from 1."""
    parse: MoveParse
    """The operation that was read."""
    outcome: StepOutcome | None = None
    """What became of the step; null for votes that it was not taken with."""
    placed: Whole | None = None
    """The goal block, from 0, that was placed."""
    swapped: tuple[tuple[Whole, ...], ...] = ()
    """Goal blocks whose candidates were exchanged."""
    world: tuple[Whole, ...] = ()
    """The goal blocks that stand after the step."""
    fallen: tuple[Whole, ...] = ()
    """Orders of the blocks that fell when the assembly was let go."""


class EpisodeRecord(Record):
    """An episode of one operation a step."""

    track: Literal["step_planning"]
    """`step_planning`."""
    parse: PlanParse | None = None
    """`plan` holds the moves that were attempted."""
    max_steps: Whole = 0
    """The most steps that the episode can take."""
    setting: str = ""
    """The setting under which a move succeeds."""
    engine: str | None = None
    """The physics engine that blocks were let go in, with its version; null where none were, and
    in records from before there was a choice (PyBullet)."""
    ending: Ending = "unanswered"
    """The ending."""
    outcomes: tuple[StepOutcome, ...] = ()
    """What became of every step."""
    progress: tuple[Whole, ...] = ()
    """Blocks placed after every step."""
    turns: tuple[EpisodeTurn, ...] = ()
    """Every request, with its reply and what came of it."""

    columns: ClassVar[Mapping[str, str]] = {
        **PLAN_COLUMNS,
        "ending": "object",
        "max_steps": "Int64",
        "outcomes": "object",
        "progress": "object",
    }

    def row(self) -> Mapping[str, Any]:
        """The moves that were attempted, as a plan, and how the episode went."""
        went = ("ending", "max_steps", "outcomes", "progress")
        return {**plan_row(self.parse, self.shown), **{name: getattr(self, name) for name in went}}

    exported: ClassVar[Mapping[str, str]] = {"ending": "string"}

    def export_row(self) -> Mapping[str, Any]:
        """The ending."""
        return {"ending": self.ending}

    def course(self, matcher: str) -> Course:
        """The outcome of every step; no matcher has a part in it."""
        del matcher
        steps = (
            (str(turn.parse.move), None if turn.outcome in ("placed", "done") else turn.outcome)
            for turn in self.steps
        )
        return Course(tuple(steps), self.n_blocks - (self.progress[-1] if self.progress else 0))

    @property
    def asked_turns(self) -> tuple[AskedTurn, ...]:
        """Every request, with its reply."""
        return self.turns

    @property
    def replies(self) -> tuple[Reply, ...]:
        """Those of all turns."""
        return tuple(turn.reply for turn in self.turns) or super().replies

    @property
    def limit_usd(self) -> float:
        """The use of a failed request; replies were counted where each was written, as a turn."""
        return super().limit_usd if self.reply is None else 0.0

    @property
    def steps(self) -> tuple[EpisodeTurn, ...]:
        """The turns that a step was taken with: one of each vote."""
        return tuple(turn for turn in self.turns if turn.outcome is not None)


Ending = Literal[
    "completed",
    "done",
    "collapsed",
    "max_steps",
    "max_failures",
    "max_repeats",
    "max_tokens",
    "max_cost",
    "unanswered",
]
ENDINGS: tuple[Ending, ...] = get_args(Ending)


@dataclass(frozen=True)
class StepLimits:
    """Limits that end an episode, whatever the model does; None is no bound.

    `steps` None is twice the number of blocks, so that every episode ends. `failures` are failed
    steps in a row, `repeats` failures in a row of one and the same operation; `tokens` and `usd`
    are those of all replies, a number that is not known counting as 0.
    """

    steps: int | None = None
    failures: int | None = 5
    repeats: int | None = 3
    tokens: int | None = None
    usd: float | None = None

    def max_steps(self, n_blocks: int) -> int:
        """Steps at most for a goal of so many blocks."""
        return 2 * n_blocks if self.steps is None else self.steps


@dataclass(frozen=True)
class StepRules:
    """Rules of playing and scoring episodes.

    The simulator lets a move succeed under `accepts`; scores are counted under all `settings`.
    Reasons are a part of the JSON that is asked for where `cot`.
    """

    accepts: Setting = "A"
    settings: tuple[Setting, ...] = ("A", "B")
    gating: Gating = "aov"
    physics: Physics = "off"
    samples: int = 1
    limits: StepLimits = StepLimits()
    answer_format: AnswerFormat = "text"
    cot: bool = True

    def form(self, n_candidates: int) -> AnswerForm[ParsedMove] | None:
        """The form in which an operation is asked for; None where that is text."""
        return None if self.answer_format == "text" else move_form(n_candidates, reasons=self.cot)

    def written(self, operation: str, n_candidates: int) -> str:
        """A reply that names an operation and nothing else, as it is shown in a conversation."""
        form = self.form(n_candidates)
        return operation if form is None else form.write(operation)


@dataclass
class Tally:
    """The use of an episode's limits."""

    steps: int = 0
    failures: int = 0
    repeats: int = 0
    tokens: int = 0
    usd: float = 0.0
    last_failed: int | None = None

    def count(self, move: int | None, *, is_placed: bool) -> None:
        """Count a step: the candidate that was named, None for a reply that could not be read."""
        self.steps += 1
        if is_placed:
            self.failures = self.repeats = 0
            self.last_failed = None
            return
        self.failures += 1
        is_repeat = move is not None and move == self.last_failed
        self.repeats = self.repeats + 1 if is_repeat else 1
        self.last_failed = move

    def ending(self, limits: StepLimits, n_blocks: int) -> Ending | None:
        """The first limit that is reached, or None."""
        reached: tuple[tuple[Ending, float, float | None], ...] = (
            ("max_repeats", self.repeats if self.last_failed is not None else 0, limits.repeats),
            ("max_failures", self.failures, limits.failures),
            ("max_steps", self.steps, limits.max_steps(n_blocks)),
            ("max_tokens", self.tokens, limits.tokens),
            ("max_cost", self.usd, limits.usd),
        )
        return next((name for name, n, most in reached if most is not None and n >= most), None)


def majority(replies: Sequence[ParsedMove]) -> int:
    """Place of the reply that speaks for all: the first with the operation named most often.

    Operations named equally often are taken in the order in which they came. Replies that could
    not be read have no vote, unless none could be.
    """
    votes = Counter((one.move, one.is_done) for one in replies if one.problem is None)
    if not votes:
        return 0
    (chosen, _), *_ = votes.most_common(1)
    return next(
        place
        for place, one in enumerate(replies)
        if one.problem is None and (one.move, one.is_done) == chosen
    )


Feedback = Literal["none", "success", "error_type"]
History = Literal["text", "turns"]
StepOutcome = MoveOutcome | Literal["done"] | MoveProblem
"""What became of a step; a problem is a reply in which no single operation could be read."""

_FORMAT: Mapping[str, str] = {
    "empty": "the answer was empty",
    "thoughts_only": "the answer was empty",
    "no_move": "no operation could be read",
    "several_moves": "more than one operation was given",
}
_REASONS: Mapping[str, str] = {
    "shape_not_in_gt": "the goal has no block of this type and color",
    "overflow": "every such block of the goal is already placed",
    "incorrect_orientation": "no such block that is missing has this orientation",
    "dependency_not_met": "what must be there before it is not there yet",
    "invalid": "no candidate has this number",
}
_NO_TEXT = "(no answer)"


@dataclass(frozen=True)
class PastStep:
    """A step that was taken: the operation, what became of it, the reply that stands for it, and
    the picture that it was chosen from (None where none is sent).
    """

    operation: str
    outcome: StepOutcome
    reply: str
    seen: Image | None

    def report(self, feedback: Feedback) -> str:
        """Return the message to the model about it."""
        if feedback == "none":
            return ""
        if self.outcome == "placed":
            return "it worked, the block is placed"
        why = _FORMAT.get(self.outcome, "")
        if feedback == "error_type":
            why = why or _REASONS[self.outcome]
        return f"it failed, {why}" if why else "it failed, nothing was placed"


@dataclass(frozen=True)
class StepPrompt:
    """A template with its rules; `memory` is how many earlier steps are shown, None for all.

    By `gating` and the setting `accepts` a move succeeds, of which the model is told; with
    `is_blind` it is not shown the goal. `form` is that of an answer with so many candidates, None
    for text.
    """

    template: TemplatePrompt
    feedback: Feedback
    history: History
    memory: int | None
    cot: bool
    gating: Gating = "aov"
    accepts: Setting = "A"
    is_blind: bool = False
    form: Callable[[int], AnswerForm[ParsedMove] | None] = lambda _: None

    def __post_init__(self) -> None:
        """Raise PromptError where the template has no text for the turns of a conversation."""
        if self.history == "turns":
            self.template.require("turn", "for the later messages of history: turns")

    def messages(
        self,
        fixed: Sequence[Image],
        current: Image,
        past: Sequence[PastStep],
        n_candidates: int,
        max_steps: int,
        candidate_scale: CandidateScale | None = None,
    ) -> tuple[Message, ...]:
        """The messages of the step after `past`; `fixed` are the goal and the candidates.

        `candidate_scale` is None where the pictures are not drawn here.
        """
        hidden = 0 if self.memory is None else max(0, len(past) - self.memory)
        facts: dict[str, object] = {
            "n_candidates": n_candidates,
            "candidate_scale": candidate_scale,
            "max_steps": max_steps,
            "cot": self.cot,
            "gating": self.gating,
            "setting": self.accepts,
            "is_blind": self.is_blind,
            "n_hidden": hidden,
            **form_facts(self.form(n_candidates)),
        }
        facts["answer"] = self.template.text("answer", facts)
        if self.history == "text":
            return self._first(fixed, current, facts, past, hidden, len(past) + 1)
        shown = list(past[hidden:])
        seen = [step.seen or current for step in shown] + [current]
        messages = list(self._first(fixed, seen[0], facts, (), hidden, hidden + 1))
        for number, (step, picture) in enumerate(zip(shown, seen[1:], strict=True), hidden + 2):
            facts_of_turn = {"told": step.report(self.feedback), "step": number, "history": []}
            text = self.template.text(
                "turn", {**facts, **facts_of_turn, "pictures": [picture.label]}
            )
            messages.append(Message("assistant", (step.reply.strip() or _NO_TEXT,)))
            messages.append(Message("user", (picture, text)))
        return tuple(messages)

    def _first(
        self,
        fixed: Sequence[Image],
        current: Image,
        facts: Mapping[str, object],
        past: Sequence[PastStep],
        hidden: int,
        step: int,
    ) -> tuple[Message, ...]:
        """The message with the goal and the candidates, and a system message if there is one."""
        pictures = (*fixed, current)
        history = [
            {"step": number, "operation": one.operation, "told": one.report(self.feedback)}
            for number, one in enumerate(past[hidden:], hidden + 1)
        ]
        last = past[-1].report(self.feedback) if past else ""
        labels = [picture.label for picture in pictures]
        more = {"pictures": labels, "step": step, "history": history, "told": last}
        return self.template.messages(pictures, {**facts, **more})


@dataclass(frozen=True)
class StepSubject:
    """The next step is asked for.

    `valid` are the candidates that would be placed now, in ascending order; empty when the goal
    is complete. `exact` are those of them that are also turned as the goal is. `last_failed` is
    the candidate whose move failed last, if the last move did; `step` is how many steps were taken.
    `guess` gives a plan that was learned without the goal.
    """

    scene: Scene
    candidates: CandidateSet
    valid: tuple[int, ...]
    exact: tuple[int, ...]
    last_failed: int | None = None
    step: int = 0
    guess: Callable[[], Plan] = field(default=Plan, compare=False)


def _random_step(subject: StepSubject, rng: np.random.Generator) -> str:
    return step_text(int(rng.integers(1, len(subject.candidates) + 1)))


def _oracle_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """One of the right moves, so that every valid order can come; Done where there is none."""
    moves = subject.exact or subject.valid
    return step_text(moves[int(rng.integers(len(moves)))] if moves else None)


def _unoriented_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """A right move, but with the block turned wrongly wherever there is such a candidate."""
    index = subject.exact[int(rng.integers(len(subject.exact)))] if subject.exact else None
    if index is None:
        return _oracle_step(subject, rng)
    kind, candidates = subject.candidates[index].kind, subject.candidates
    looks = {block.look for block in subject.scene.blocks}
    wrong = [
        n
        for n in range(1, len(candidates) + 1)
        if candidates[n].kind == kind and candidates[n].look not in looks
    ]
    return step_text(wrong[int(rng.integers(len(wrong)))] if wrong else index)


def _repeated_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """Any move at random until one fails, then that one for ever."""
    return (
        _random_step(subject, rng)
        if subject.last_failed is None
        else step_text(subject.last_failed)
    )


def _next_candidate(subject: StepSubject, _: np.random.Generator) -> str:
    """Every candidate once, in their order."""
    return step_text(subject.step + 1 if subject.step < len(subject.candidates) else None)


def _next_guess(subject: StepSubject, _: np.random.Generator) -> str:
    plan = subject.guess().steps
    return step_text(plan[subject.step] if subject.step < len(plan) else None)


def _first_pose(subject: StepSubject, rng: np.random.Generator) -> str:
    """The kind of a right move, in the pose of it that is listed first."""
    if not subject.exact:
        return _oracle_step(subject, rng)
    index = subject.exact[int(rng.integers(len(subject.exact)))]
    return step_text(subject.candidates.first_of(subject.candidates[index].kind))


def step_text(index: int | None) -> str:
    """One operation in the benchmark's own reply form; None is the end."""
    return "Next plan: Done" if index is None else f"Next plan: Move({index})"


STEP_RULES = {
    "random": _random_step,
    "oracle": _oracle_step,
    "oracle-no-orientation": _unoriented_step,
    "repeat": _repeated_step,
    "all-candidates": _next_candidate,
    "goal-blind": _next_guess,
    "first-pose": _first_pose,
}
"""Rules by name of the baseline."""
STEP_FLOORS = ("goal-blind", "all-candidates", "random", "repeat")
"""Those that never see the goal."""


def pick_step(subject: StepSubject) -> Picking:
    """The candidates, and after them the end."""
    n_candidates = len(subject.candidates)

    def write(picks: Sequence[Pick]) -> str:
        (pick,) = picks
        return step_text(pick.place + 1 if pick.place < n_candidates else None)

    choices = (*candidate_choices(n_candidates), Choice("Done", "the goal is complete"))
    return Picking(choices, least=1, most=1, repeats=False, noun="step", write=write)


def state_keys(record: Any, task: AssemblyTask, style: PictureStyle) -> Iterator[str]:
    """The names in the cache of what stood before each step of an episode."""
    if not isinstance(record, EpisodeRecord):
        return
    wide = goal_style(task.scene, style)
    world: tuple[int, ...] = ()
    for turn in record.turns:
        blocks = [task.scene.blocks[vertex] for vertex in world]
        yield question_key(state_picture(task.scene, blocks, wide), wide)
        if turn.outcome is not None:
            world = turn.world


_NOT_TRIED = ("done", *get_args(MoveProblem))
"""Outcomes of steps in which no move was attempted."""


@dataclass(frozen=True)
class Desk:
    """The services that an episode needs.

    `settle` lets blocks go at their goal poses; `write` gives the messages of the step after the
    given ones, with the picture of the assembly that is among them, and is None for models that
    need no messages; `version` is that of the prompt. `guess` gives a plan that was learned
    without the goal.
    """

    settle: Callable[[Sequence[Block]], Awaitable[Settled]]
    guess: Callable[[], Plan] = Plan
    write: (
        Callable[
            [Sequence[PastStep], Sequence[Block]], Awaitable[tuple[tuple[Message, ...], Image]]
        ]
        | None
    ) = None
    version: str = ""


class StepEpisode:
    """Asks for one operation after another until the goal stands or a limit is reached.

    With several samples a step, each is a request of its own, and the vote follows the last.
    """

    def __init__(
        self,
        task: AssemblyTask,
        seed: int,
        params: Mapping[str, object],
        rules: StepRules,
        desk: Desk,
    ) -> None:
        self.ending: Ending | None = None
        self._task = task
        self._seed = seed
        self._params = params
        self._rules = rules
        self._desk = desk
        self._form = rules.form(len(task.candidates))
        self._assembly = Assembly(task.scene, task.candidates, rules.accepts, rules.gating)
        self._tally = Tally()
        self._past: list[PastStep] = []
        self._turns: list[dict[str, Any]] = []
        self._votes: list[tuple[ParsedMove, str]] = []
        self._seen: Image | None = None
        self._settled = True

    async def request(self) -> Request | None:
        """The next request, or None when the episode has ended."""
        if not self._settled:
            await self._settle()
        if self.ending is not None:
            return None
        messages: tuple[Message, ...] = ()
        if self._desk.write is not None:
            messages, self._seen = await self._desk.write(self._past, self._blocks())
        sample, samples = len(self._votes), self._rules.samples
        key = f"{self._task.key}/{self._tally.steps + 1}"
        subject = StepSubject(
            self._task.scene,
            self._task.candidates,
            self._assembly.right_moves(),
            self._assembly.exact_moves(),
            self._tally.last_failed,
            self._tally.steps,
            self._desk.guess,
        )
        return Request(
            key if samples == 1 else f"{key}.{sample + 1}",
            self._seed * samples + sample,
            messages,
            self._params,
            self._desk.version,
            subject,
            response_format(self._form),
        )

    def take(self, request: Request, reply: Reply) -> None:
        """Go on with the reply to the last request."""
        parsed = parse_move(reply.text)
        usage = reply.usage
        self._tally.tokens += (usage.prompt_tokens or 0) + (usage.completion_tokens or 0)
        self._tally.usd += reply.cost_usd or 0.0
        move = "Done" if parsed.is_done else parsed.move
        self._turns.append(
            {
                "key": request.key,
                "seed": request.seed,
                "step": self._tally.steps + 1,
                "parse": {"rule": parsed.rule, "move": move, "problem": parsed.problem},
                "outcome": None,
                "placed": None,
            }
        )
        self._votes.append((parsed, reply.text))
        if len(self._votes) == self._rules.samples:
            self._step()

    @property
    def is_read(self) -> bool:
        """True if an operation could be read in any reply."""
        return any(turn["parse"]["problem"] is None for turn in self._turns)

    @property
    def outcomes(self) -> list[StepOutcome]:
        """The outcome of every step, in order."""
        return [step.outcome for step in self._past]

    @property
    def steps(self) -> list[int]:
        """The candidates of all moves that were attempted, in order."""
        return [turn["parse"]["move"] for turn in self._turns if _is_attempt(turn)]

    def fields(self) -> dict[str, Any]:
        """Return the fields of the record about the episode (docs/results.md)."""
        placed = [outcome == "placed" for outcome in self.outcomes]
        plan = self.steps
        return {
            "parse": {
                "parser": "move",
                "rule": None,
                "plan": plan,
                "file_plan": file_plan(self._task, plan),
                "dropped": [],
            },
            "scores": [
                score
                for setting in self._rules.settings
                for score in self._scores(setting, len(plan))
            ],
            "setting": self._rules.accepts,
            "ending": self.ending or "unanswered",
            "outcomes": self.outcomes,
            "progress": [sum(placed[: count + 1]) for count in range(len(placed))],
            "turns": list(self._turns),
        }

    def _step(self) -> None:
        """Take the step that the votes name."""
        at = majority([parsed for parsed, _ in self._votes])
        parsed, text = self._votes[at]
        turn = self._turns[len(self._turns) - len(self._votes) + at]
        samples = len(self._votes)
        self._votes.clear()
        operation = "Done" if parsed.is_done else f"Move({parsed.move})"
        operation = operation if parsed.problem is None else "(no operation)"
        outcome: StepOutcome = "done"
        if parsed.problem is not None:
            outcome = parsed.problem
        elif parsed.move is not None:
            move = self._assembly.move(parsed.move)
            outcome = move.outcome
            turn["placed"] = move.vertex
            turn["swapped"] = [list(pair) for pair in move.swapped]
        turn["outcome"] = outcome
        turn["world"] = list(self._assembly.vertices)
        reply = text
        if samples > 1 and parsed.problem is None:
            reply = self._rules.written(operation, len(self._task.candidates))
        elif samples > 1:
            reply = operation
        self._past.append(PastStep(operation, outcome, reply, self._seen))
        self._tally.count(parsed.move, is_placed=outcome == "placed")
        self._settled = outcome != "placed" or self._rules.physics == "off"
        self._end(outcome)

    def _end(self, outcome: StepOutcome) -> None:
        if self._assembly.is_complete:
            self.ending = "completed"
        elif outcome == "done":
            self.ending = "done"
        else:
            self.ending = self._tally.ending(self._rules.limits, len(self._task.scene))

    async def _settle(self) -> None:
        """Let the assembly go; what falls is put back, or ends the episode."""
        settled = await self._desk.settle(self._blocks())
        self._settled = True
        turn = next(turn for turn in reversed(self._turns) if turn["outcome"] is not None)
        turn["fallen"] = list(settled.fallen)
        if not settled.stands and self._rules.physics == "strict":
            self.ending = "collapsed"

    def _blocks(self) -> tuple[Block, ...]:
        return tuple(self._task.scene.blocks[vertex] for vertex in self._assembly.vertices)

    def _fallen(self) -> list[int]:
        """The vertices that lie on the ground after a collapse."""
        if self.ending != "collapsed":
            return []
        fallen = next(turn["fallen"] for turn in reversed(self._turns) if turn.get("fallen"))
        blocks = self._task.scene.blocks
        return [v for v in self._assembly.vertices if blocks[v].order in fallen]

    def _scores(self, setting: Setting, attempts: int) -> list[dict[str, Any]]:
        """Counts over the blocks in the world, and over every move that was attempted."""
        scene, candidates = self._task.scene, self._task.candidates
        chosen = self._assembly.chosen
        placed = placed_counts(scene, candidates, setting, chosen, self._fallen())
        outcomes = self.outcomes
        errors = {name: outcomes.count(name) for name in ERROR_TYPES}
        return [
            _score("placed", setting, placed, None),
            _score("attempted", setting, attempted_counts(placed, attempts), errors),
        ]


def _is_attempt(turn: Mapping[str, Any]) -> bool:
    return turn["outcome"] is not None and turn["outcome"] not in _NOT_TRIED


def _score(
    criterion: str, setting: Setting, counts: Counts, errors: Mapping[ErrorType, int] | None
) -> dict[str, Any]:
    return {
        "criterion": criterion,
        "matcher": None,
        "setting": setting,
        "tp": counts.tp,
        "fp": counts.fp,
        "fn": counts.fn,
        "errors": errors,
    }


_KEPT = 4096
"""States whose fall or stand is remembered."""
_LIKELY = PastStep("Move(1)", "placed", "Next plan: Move(1)", None)


@dataclass(frozen=True)
class _Sight:
    """The view of a model: a prompt and the pictures in it."""

    prompt: StepPrompt
    pictures: Pictures


_PLAIN = TaskShowing(Showing())


class StepPlanning:
    """Episodes of one operation a step; see `StepEpisode`."""

    name = "step_planning"

    def __init__(
        self,
        rules: StepRules,
        prompt: StepPrompt | None = None,
        pictures: Pictures | None = None,
        items: Sequence[AssemblyTask] = (),
        showing: TaskShowing = _PLAIN,
        pool: Sequence[AssemblyTask] = (),
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording; from `pool`, else
        `items`, baselines learn.
        """
        self.rules = rules
        self.items = items
        self.template = "" if prompt is None else prompt.template.name
        self._showing = showing
        self._guesses = BlindGuesses(showing, pool or items, rules.accepts)
        self._sight = _Sight(prompt, pictures) if prompt and pictures else None
        self._settled: OrderedDict[tuple[Block, ...], Settled] = OrderedDict()

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """The scene as a seed shows it."""
        return self._showing.of(item, seed)

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """The most steps that an episode of it can take, the physics engine, where there is one,
        and how the scene is shown.
        """
        engine = {} if self.rules.physics == "off" else {"engine": described_engine()}
        most = self.rules.limits.max_steps(len(item.scene))
        return {"max_steps": most, **engine, **showing_fields(item)}

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, a digest of all that decides the pictures, and the
        physics engine where blocks are let go in another one than PyBullet.
        """
        engine = {} if self.rules.physics == "off" else engine_identity()
        if self._sight is None:
            return {"prompt": None, "pictures": None, **engine}
        template = self._sight.prompt.template
        keys = [self._sight.pictures.keys(task) for task in self._showing.each(self.items)]
        return {
            "prompt": {"name": template.name, "version": template.version},
            "pictures": hex_digest(json.dumps(keys)),
            **engine,
        }

    def start(
        self, item: AssemblyTask, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> StepEpisode:
        """An episode that has not begun."""
        desk = Desk(self._settle, partial(self._guesses.plan, item))
        if with_messages and self._sight is not None:
            version = self._sight.prompt.template.version
            desk = replace(desk, write=partial(self._write, self._sight, item), version=version)
        return StepEpisode(item, seed, params, self.rules, desk)

    def again(self, item: AssemblyTask, record: Record) -> StepEpisode:
        """The episode of a record before its first reply; what falls is what fell then."""
        fell = {
            tuple(item.scene.blocks[vertex] for vertex in turn.world): turn.fallen
            for turn in (record.steps if isinstance(record, EpisodeRecord) else ())
            if turn.outcome == "placed"
        }

        async def settle_again(blocks: Sequence[Block]) -> Settled:
            state = tuple(blocks)
            return Settled(fell.get(state, ()), state)

        return StepEpisode(item, record.seed, {}, self.rules, Desk(settle_again))

    def outlines(self, item: AssemblyTask) -> Iterator[tuple[Request, bool]]:
        """As many requests as an episode can have, made without rendering.

        Each step is taken to have placed a block. Only the first request can be a real one, and
        with several samples none, since their seeds are not those of the run.
        """
        rules = self.rules
        assembly = Assembly(item.scene, item.candidates, rules.accepts, rules.gating)
        guess = partial(self._guesses.plan, item)
        right = assembly.right_moves()
        subject = StepSubject(item.scene, item.candidates, right, (), guess=guess)
        for step in range(rules.limits.max_steps(len(item.scene))):
            for sample in range(rules.samples):
                request = Request(f"{item.key}/{step + 1}", sample, (), {}, "", subject)
                yield self._outline(item, request, [_LIKELY] * step)

    def close(self) -> None:
        """Stop the worker processes."""
        if self._sight is not None:
            self._sight.pictures.close()

    def _outline(
        self, item: AssemblyTask, request: Request, past: Sequence[PastStep]
    ) -> tuple[Request, bool]:
        is_real = not past and self.rules.samples == 1
        if self._sight is None:
            return request, is_real
        pictures = self._sight.pictures
        fixed, is_fixed_real = pictures.outline(item)
        drawing = self._drawing(self._sight, item, ())
        side = pictures.style_of(item).size_px
        (current,), is_current_real = pictures.outlined((drawing,), (side, side))
        messages = self._messages(self._sight, item, fixed, current, past)
        version = self._sight.prompt.template.version
        request = replace(
            request,
            messages=messages,
            prompt_version=version,
            response_format=response_format(self.rules.form(len(item.candidates))),
        )
        return request, is_real and is_fixed_real and is_current_real

    async def _write(
        self,
        sight: _Sight,
        item: AssemblyTask,
        past: Sequence[PastStep],
        blocks: Sequence[Block],
    ) -> tuple[tuple[Message, ...], Image]:
        """The messages of the step after `past`, and the picture of the assembly among them."""
        fixed = await sight.pictures.of(item)
        current = await sight.pictures.image(self._drawing(sight, item, blocks))
        return self._messages(sight, item, fixed, current, past), current

    def _messages(
        self,
        sight: _Sight,
        item: AssemblyTask,
        fixed: Sequence[Image],
        current: Image,
        past: Sequence[PastStep],
    ) -> tuple[Message, ...]:
        most = self.rules.limits.max_steps(len(item.scene))
        scale = sight.pictures.candidate_scale
        return sight.prompt.messages(fixed, current, past, len(item.candidates), most, scale)

    def _drawing(self, sight: _Sight, item: AssemblyTask, blocks: Sequence[Block]) -> Drawing:
        style = sight.pictures.style_of(item)
        recipe = state_picture(item.scene, blocks, style)
        return Drawing(
            recipe.label, question_key(recipe, style), partial(question_png, recipe, style)
        )

    async def _settle(self, blocks: Sequence[Block]) -> Settled:
        """Return the fate of blocks, computed in another process, or in a thread without one."""
        state = tuple(blocks)
        if state not in self._settled:
            trial = DEFAULT_TRIAL if self.rules.physics == "strict" else ONE_SETTING
            work = partial(settle, state, trial)
            self._settled[state] = (
                await asyncio.to_thread(work)
                if self._sight is None
                else await self._sight.pictures.work_out(work)
            )
            if len(self._settled) > _KEPT:
                self._settled.popitem(last=False)
        return self._settled[state]


def open_step_planning(opening: Opening) -> StepPlanning:
    """The track; SpecError, DataError or PromptError with what is wrong."""
    suite = opening.suite
    tasks = select_tasks(opening.dataset.tasks, suite.levels, opening.limit)
    rules = _rules(suite)
    pool = opening.dataset.tasks
    showing = task_showing(suite, StepsSpec, "steps", tasks, pool)
    if not opening.with_prompts:
        return StepPlanning(rules, items=tasks, showing=showing, pool=pool)
    check_drawn(suite, "step planning draws every state, so the goal must be drawn as well")
    steps = suite.section(StepsSpec)
    shown = (steps.feedback, steps.history, steps.memory, steps.cot)
    template = template_prompt(suite, StepPlanning.name)
    rules_shown = (rules.gating, rules.accepts, steps.blind, rules.form)
    prompt = StepPrompt(template, *shown, *rules_shown)
    return StepPlanning(rules, prompt, assembly_pictures(suite, opening.shop), tasks, showing, pool)


def _rules(suite: Suite) -> StepRules:
    """Return the rules by which a suite plays episodes."""
    steps = suite.section(StepsSpec)
    limits = StepLimits(
        steps.max_steps,
        steps.max_failures,
        steps.max_repeats,
        steps.max_episode_tokens,
        steps.max_episode_usd,
    )
    accepts = steps.setting or suite.settings[0]
    return StepRules(
        accepts,
        suite.settings,
        steps.gating,
        steps.physics,
        steps.samples,
        limits,
        suite.answer_format,
        steps.cot,
    )


def _physics(suite: Mapping[str, Any]) -> bool:
    section = suite.get("steps")
    return not isinstance(section, Mapping) or section.get("physics") != "off"


def _report() -> TrackReport:
    from phyblock.tracks.step_planning_results import REPORT

    return REPORT


TRACK = TrackKind(
    name=StepPlanning.name,
    title="Step planning",
    item="episode",
    about="step by step in the simulator",
    open=open_step_planning,
    report=_report,
    subject=StepSubject,
    baselines=STEP_RULES,
    by_hand=pick_step,
    physics=_physics,
    plays=True,
    section=("steps", StepsSpec, "The rules of the step_planning track."),
    record=EpisodeRecord,
    template=bundled("prompts", "step_planning.j2"),
    json_template=bundled("prompts", "step_planning_json.j2"),
    prompt_field=("steps", "prompt"),
    counted=(POSE_COUNTS,),
    tables=("table3", "endings", "moves"),
    no_examples="one would be an episode of several turns, each with a picture of its own",
    varies=("prompt", "background", "view", "candidate_order", "layout", "repeats"),
)
