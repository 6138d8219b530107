"""Step planning: one block at a time, in a simulator."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np

from phyblock.config.validation import Count, Flag, PictureControls, TemplateName
from phyblock.domain.scene import AssemblyTask, Block
from phyblock.files import bundled
from phyblock.models.request import Image, Message, Request
from phyblock.parsing.answer import MoveProblem, ParsedMove, move_form, parse_move
from phyblock.parsing.text import AnswerForm
from phyblock.records.record import AskedTurn, Course, Line, Record, Reply, SentPrompt, Whole
from phyblock.scoring.plan import ERROR_TYPES, Counts
from phyblock.scoring.steps import MOVE_OUTCOMES, Assembly, MoveOutcome, placed_counts
from phyblock.sim.dynamics import DEFAULT_TRIAL, ONE_SETTING, settle
from phyblock.sim.engine import described_engine
from phyblock.sim.pictures import goal_style
from phyblock.sim.question_pictures import question_key, question_png, state_picture
from phyblock.tracks import base
from phyblock.tracks.base import Choice, Judgement, Picking, SceneTrack
from phyblock.tracks.full_planning import POSE_COUNTS, PlanParse, PlanSubject, blind_guesses
from phyblock.tracks.measures import SampleCounts
from phyblock.tracks.pictures import Drawing, Workshop, picture_style
from phyblock.tracks.prompts import TemplatePrompt
from phyblock.types import Gating, Physics, Setting

Feedback = Literal["none", "success", "error_type"]
StepOutcome = MoveOutcome | Literal["done"] | MoveProblem
"""Outcome of a step; a MoveProblem is a reply without a single parsed operation."""
Ending = Literal[
    "completed", "done", "collapsed", "max_steps", "max_failures", "max_repeats", "unanswered"
]
ENDINGS: tuple[Ending, ...] = get_args(Ending)


class StepsSpec(PictureControls):
    """The rules of the step_planning track: simulator, feedback, endings."""

    setting: Setting | None = None
    """Setting under which the simulator accepts a step; null: the first of settings. With B,
    blocks in a wrong orientation are placed, and count as wrong in A."""
    gating: Gating = "aov"
    """aov: a block can be placed when all blocks it rests on are placed. layer: when all lower
    layers are complete, as in the official code."""
    physics: Physics = "settle"
    """off: placed blocks stay where they are. settle: every new state is simulated; blocks that
    would fall are recorded and held. strict: a collapse ends the episode."""
    feedback: Feedback = "success"
    """Feedback on each step: none, success or failure, or the type of error."""
    cot: Flag = True
    """Ask for reasoning before the step."""
    max_steps: Count | None = None
    """Maximum number of steps; null: twice the number of blocks."""
    max_failures: Count | None = 5
    """Failed steps in a row that end an episode; null: no limit."""
    max_repeats: Count | None = 3
    """Failures in a row of the same step that end an episode; null: no limit."""
    prompt: TemplateName = "default"
    """default, or the path of a .j2 template."""

    def most_steps(self, n_blocks: int) -> int:
        """Return the maximum number of steps for a goal: by default twice its number of blocks."""
        return 2 * n_blocks if self.max_steps is None else self.max_steps


class MoveParse(Line):
    """The operation that was parsed from a turn's reply."""

    rule: str | None
    """The rule that matched."""
    move: int | Literal["Done"] | None
    """The candidate's number, `Done`, or null."""
    problem: str | None = None
    """Reason why no single operation could be parsed."""


class EpisodeTurn(AskedTurn):
    """One request of an episode, with its reply and its outcome."""

    parse: MoveParse
    """The parsed operation."""
    outcome: StepOutcome
    """Outcome of the step."""
    placed: Whole | None = None
    """The goal block, from 0, that was placed."""
    swapped: tuple[tuple[Whole, ...], ...] = ()
    """Goal blocks whose candidates were exchanged."""
    world: tuple[Whole, ...] = ()
    """The goal blocks in the world after the step."""
    fallen: tuple[Whole, ...] = ()
    """Orders of the blocks that fell when the assembly was released."""


class EpisodeRecord(Record):
    """An episode with one operation per step."""

    track: Literal["step_planning"]
    """`step_planning`."""
    parse: PlanParse | None = None
    """`plan` holds the moves that were attempted."""
    engine: str | None = None
    """The physics engine, with its version; null: nothing was simulated."""
    ending: Ending = "unanswered"
    """The ending."""
    outcomes: tuple[StepOutcome, ...] = ()
    """Outcome of every step."""
    turns: tuple[EpisodeTurn, ...] = ()
    """Every request, with its reply and its outcome."""

    exported: ClassVar[Mapping[str, tuple[str, str]]] = {"ending": ("string", "ending")}

    def course(self, _matcher: str) -> Course:
        """Return the outcome of every step, which does not depend on the matcher."""
        steps = (
            (str(turn.parse.move), None if turn.outcome in ("placed", "done") else turn.outcome)
            for turn in self.turns
        )
        return Course(tuple(steps), self.n_blocks - self.outcomes.count("placed"), self.ending)

    def built(self, task: AssemblyTask) -> tuple[Block, ...]:
        """Return the blocks that were placed."""
        placed = self.turns[-1].world if self.turns else ()
        return tuple(task.scene.blocks[vertex] for vertex in placed)

    @property
    def asked_turns(self) -> tuple[AskedTurn, ...]:
        """Every request, with its reply."""
        return self.turns

    @property
    def replies(self) -> tuple[Reply, ...]:
        """The replies of all turns."""
        return tuple(turn.reply for turn in self.turns) or super().replies


@dataclass(frozen=True)
class StepSubject(PlanSubject):
    """The state in which baselines and people choose the next step.

    `valid` are the candidates that would be placed now, in ascending order; empty when the goal is
    complete. `exact` are those of them in the goal's orientation. `last_failed` is the candidate of
    the last move, if it failed; `step` is the number of steps taken.
    """

    valid: tuple[int, ...] = ()
    exact: tuple[int, ...] = ()
    last_failed: int | None = None
    step: int = 0


def step_text(index: int | None) -> str:
    """Return one operation in the reply form of the benchmark; None is Done."""
    return "Next plan: Done" if index is None else f"Next plan: Move({index})"


def _random(subject: StepSubject, rng: np.random.Generator) -> str:
    return step_text(int(rng.integers(1, len(subject.candidates) + 1)))


def _right_move(choose: Callable[[StepSubject, int, np.random.Generator], int | None]) -> Any:
    """Return a rule that names the choice for a right move, or Done if no move is right."""

    def rule(subject: StepSubject, rng: np.random.Generator) -> str:
        moves = subject.exact or subject.valid
        if not moves:
            return step_text(None)
        index = moves[int(rng.integers(len(moves)))]
        instead = choose(subject, index, rng) if subject.exact else None
        return step_text(index if instead is None else instead)

    return rule


def _turned(subject: StepSubject, index: int, rng: np.random.Generator) -> int | None:
    """Return a candidate of the same kind in an orientation that the goal lacks, or None."""
    kind, looks = subject.candidates[index].kind, {block.look for block in subject.scene.blocks}
    listed = enumerate(subject.candidates.candidates, 1)
    wrong = [n for n, one in listed if one.kind == kind and one.look not in looks]
    return wrong[int(rng.integers(len(wrong)))] if wrong else None


def _in_turn(plan_of: Callable[[StepSubject], Sequence[int]]) -> Callable[..., str]:
    """Return the rule that takes the steps of a plan in turn, then says Done."""

    def rule(subject: StepSubject, _: np.random.Generator) -> str:
        plan = plan_of(subject)
        return step_text(plan[subject.step] if subject.step < len(plan) else None)

    return rule


_REASONS: Mapping[str, str] = {
    "empty": "the answer was empty",
    "thoughts_only": "the answer was empty",
    "no_move": "no operation could be read",
    "several_moves": "more than one operation was given",
    "shape_not_in_gt": "the goal has no block of this type and color",
    "overflow": "every such block of the goal is already placed",
    "incorrect_orientation": "no such block that is missing has this orientation",
    "dependency_not_met": "what must be there before it is not there yet",
    "invalid": "no candidate has this number",
}


class PastStep(NamedTuple):
    """A past step: its operation, a candidate, `Done` or None, and its outcome."""

    operation: int | str | None
    outcome: StepOutcome

    @property
    def move(self) -> int | None:
        """The named candidate, if any."""
        return self.operation if isinstance(self.operation, int) else None

    def report(self, feedback: Feedback) -> str:
        """Return the message to the model about the step."""
        if feedback == "none":
            return ""
        if self.outcome == "placed":
            return "it worked, the block is placed"
        if self.outcome in MOVE_OUTCOMES and feedback == "success":
            return "it failed, nothing was placed"
        return f"it failed, {_REASONS[self.outcome]}"


STEP_OUTCOMES = ("placed", *ERROR_TYPES, "invalid", "unread", "done")
"""Outcomes of steps in tables; `unread` are replies without a single parsed operation."""
_SAME = (f"tracks.step_planning.{base.ENGINE}",)


def _episodes(record: EpisodeRecord) -> tuple[int, ...]:
    """Count an episode: its ending, its steps by outcome, and the steps to complete the goal."""
    taken = Counter(one if one in STEP_OUTCOMES else "unread" for one in record.outcomes)
    steps, whole = len(record.outcomes), record.ending == "completed"
    numbers = (whole, 1, steps, whole * steps, whole * record.n_blocks)
    ended = (record.ending == name for name in ENDINGS)
    return (*numbers, *ended, *(taken[name] for name in STEP_OUTCOMES))


_EPISODES = (
    *("completed", "episodes", "steps", "finishing", "fewest"),
    *(f"ended_{name}" for name in ENDINGS),
    *(f"step_{name}" for name in STEP_OUTCOMES),
)


class StepPlanning(SceneTrack):
    """Asks for one operation after another; see `StepEpisode`."""

    name = "step_planning"
    title = "Step planning"
    item = "episode"
    section = "steps"
    options = StepsSpec
    template = bundled("prompts", "step_planning.j2")
    baselines: ClassVar = {
        "random": _random,
        "oracle": _right_move(lambda *_: None),
        "oracle-no-orientation": _right_move(_turned),
        "repeat": lambda subject, rng: (
            _random(subject, rng) if subject.last_failed is None else step_text(subject.last_failed)
        ),
        "all-candidates": _in_turn(lambda subject: range(1, len(subject.candidates) + 1)),
        "goal-blind": _in_turn(lambda subject: subject.guess().steps),
        "color-areas": _in_turn(lambda subject: subject.guess(sees_colors=True).steps),
        "first-pose": _right_move(
            lambda subject, index, _: subject.candidates.first_of(subject.candidates[index].kind)
        ),
    }
    record = EpisodeRecord
    counted = (
        SampleCounts("moves", ("tp", "fp", "fn"), score=lambda s: (s.tp, s.fp, s.fn), same=_SAME),
        SampleCounts("episodes", _EPISODES, record=_episodes, same=_SAME),
        POSE_COUNTS,
    )
    varies = ("prompt", "background", "view", "candidate_order", "layout", "repeats")
    plays = True
    simulates = True
    draws = True
    spec: StepsSpec

    @staticmethod
    def by_hand(subject: StepSubject) -> Picking:
        """Return the choices of a person: the candidates, then Done."""
        n = len(subject.candidates)
        return Picking(
            (*base.candidate_choices(n), Choice("Done", "the goal is complete")),
            lambda picks: step_text(picks[0].place + 1 if picks[0].place < n else None),
            "Pick the next block to place, or Done when the goal is complete.",
        )

    def open(self) -> None:
        """Select scenes."""
        super().open()
        suite, pool = self.suite, tuple(self.dataset.tasks)
        self.accepts = self.spec.setting or suite.settings[0]
        self.guess = blind_guesses(pool, suite.candidates.order, self.accepts)
        self._fallen: dict[tuple[Block, ...], tuple[int, ...]] = {}

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """Return the physics engine, if any, and the presentation of the scene."""
        engine = {} if self.spec.physics == "off" else {"engine": described_engine()}
        return {**engine, **super().about(item)}

    def json_form(self, item: AssemblyTask) -> AnswerForm[ParsedMove]:
        """Return the JSON form of an operation."""
        return move_form(len(item.candidates), reasons=self.spec.cot)

    def start(
        self,
        item: AssemblyTask,
        seed: int,
        params: Mapping[str, object],
        *,
        with_messages: bool,
        earlier: Record | None = None,
    ) -> StepEpisode:
        """Return an episode that has not begun; the same blocks fall as in an `earlier` record."""
        ask = functools.partial(self.asked, item, seed, params)
        return StepEpisode(self, item, ask, self.shop if with_messages else None, earlier)

    def outlines(self, item: AssemblyTask) -> Iterator[Request]:
        """Yield as many requests as an episode can have, made without rendering.

        They assume that each step places a block, so only the first is a real request.
        """
        for step in range(self.spec.most_steps(len(item.scene))):
            messages: tuple[Message, ...] = ()
            if self.shop is not None:
                fixed = self.shop.outlines(self.drawings(item))
                (current,) = self.shop.outlines((self.draw_state(item, ()),))
                current = replace(current, data=b"") if step else current
                past = [PastStep(1, "placed")] * step
                messages = self.messages(item, (*fixed, current), past)
            yield self.asked(item, 0, {}, messages, turn=step + 1)

    def messages(
        self, item: AssemblyTask, pictures: Sequence[Image], past: Sequence[PastStep] = ()
    ) -> tuple[Message, ...]:
        """Return the messages of the step after `past`, whose history they contain as text."""
        assert isinstance(self.prompt, TemplatePrompt)
        history = []
        for step, one in enumerate(past, 1):
            named = f"Move({one.move})" if one.move is not None else one.operation
            told = one.report(self.spec.feedback)
            history.append({"step": step, "operation": named or "(no operation)", "told": told})
        facts: dict[str, object] = {
            **self.facts(item, pictures),
            "step": len(past) + 1,
            "max_steps": self.spec.most_steps(len(item.scene)),
            "cot": self.spec.cot,
            "gating": self.spec.gating,
            "setting": self.accepts,
            "told": history[-1]["told"] if history else "",
            "history": history,
        }
        facts["answer"] = self.prompt.text("answer", facts)
        return self.prompt.messages(pictures, facts)

    async def fallen(self, blocks: tuple[Block, ...]) -> tuple[int, ...]:
        """Return the orders of blocks that fall when all are released at their goal poses."""
        if blocks not in self._fallen:
            trial = DEFAULT_TRIAL if self.spec.physics == "strict" else ONE_SETTING
            settled = await self.compute(functools.partial(settle, blocks, trial))
            self._fallen[blocks] = settled.fallen
        return self._fallen[blocks]

    def draw_state(self, item: AssemblyTask, blocks: Sequence[Block]) -> Drawing:
        """Return the picture of blocks from the goal's camera."""
        style = goal_style(item.scene, picture_style(self.suite.images))
        recipe = state_picture(item.scene, blocks, style)
        return Drawing.of(recipe.label, question_key, question_png, recipe, style)


class StepEpisode:
    """Asks for one operation after another until the goal is complete or a limit is reached.

    Falls are simulated, or the same as in an `earlier` record of the episode.
    """

    def __init__(
        self,
        track: StepPlanning,
        task: AssemblyTask,
        ask: Callable[..., Request],
        shop: Workshop | None,
        earlier: Record | None = None,
    ) -> None:
        self._track, self._task, self._ask, self._shop = track, task, ask, shop
        self._assembly = Assembly(task.scene, task.candidates, track.accepts, track.spec.gating)
        self._ending: Ending | None = None
        self._turns: list[dict[str, Any]] = []
        self._past: list[PastStep] = []
        self._fell: dict[tuple[int, ...], tuple[int, ...]] | None = None
        if isinstance(earlier, EpisodeRecord):
            placed = (turn for turn in earlier.turns if turn.outcome == "placed")
            self._fell = {turn.world: turn.fallen for turn in placed}

    async def request(self) -> Request | None:
        """Return the next request, or None when the episode has ended.

        After a step that placed a block, all are released; those that fall are put back, or end it.
        """
        track, task, assembly = self._track, self._task, self._assembly
        blocks = tuple(task.scene.blocks[vertex] for vertex in assembly.vertices)
        last = self._turns[-1] if self._turns else {}
        is_released = track.spec.physics != "off" and last.get("outcome") == "placed"
        if is_released and "fallen" not in last:
            known = self._fell
            fell = await track.fallen(blocks) if known is None else known.get(assembly.vertices, ())
            last["fallen"] = list(fell)
            if fell and track.spec.physics == "strict":
                self._ending = "collapsed"
        if self._ending is not None:
            return None
        messages: tuple[Message, ...] = ()
        if self._shop is not None:
            drawings = (*track.drawings(task), track.draw_state(task, blocks))
            messages = track.messages(task, await self._shop.images(drawings), self._past)
        guess = functools.partial(track.guess, task, track.suite.images.view)
        moves = assembly.right_moves(), assembly.exact_moves()
        failed = self._past[-1].move if last.get("outcome", "placed") != "placed" else None
        subject = StepSubject(task.scene, task.candidates, guess, *moves, failed, len(self._turns))
        return self._ask(messages, subject, len(self._turns) + 1)

    def take(self, reply: Reply, prompt: SentPrompt | None = None) -> None:
        """Take the step named in the reply to the last request."""
        parsed, assembly, spec = parse_move(reply.text), self._assembly, self._track.spec
        move = None if parsed.move is None else assembly.move(parsed.move)
        outcome: StepOutcome = parsed.problem or ("done" if move is None else move.outcome)
        operation = "Done" if parsed.is_done else parsed.move
        self._past.append(PastStep(operation, outcome))
        turn: dict[str, Any] = {
            "n": len(self._past),
            "reply": reply,
            "prompt": prompt,
            "parse": {"rule": parsed.rule, "move": operation, "problem": parsed.problem},
            "outcome": outcome,
            "placed": None if move is None else move.vertex,
        }
        if move is not None:
            turn["swapped"] = [list(pair) for pair in move.swapped]
        self._turns.append({**turn, "world": list(assembly.vertices)})
        failed = [*takewhile(lambda step: step.outcome != "placed", reversed(self._past))]
        same = takewhile(lambda one: one.move is not None and one.move == failed[0].move, failed)
        limits: tuple[tuple[Ending, int, int | None], ...] = (
            ("max_repeats", len([*same]), spec.max_repeats),
            ("max_failures", len(failed), spec.max_failures),
            ("max_steps", len(self._past), spec.most_steps(len(self._task.scene))),
        )
        if assembly.is_complete:
            self._ending = "completed"
        elif outcome == "done":
            self._ending = "done"
        else:
            reached = (name for name, n, most in limits if most is not None and n >= most)
            self._ending = next(reached, None)

    def judgement(self) -> Judgement:
        """Return the fields of the episode; it is parsed if any operation was.

        Scores count the blocks in the world (`placed`), and every attempted move.
        """
        scene, assembly = self._task.scene, self._assembly
        plan = [step.move for step in self._past if step.move is not None]
        happened = Counter(step.outcome for step in self._past)
        errors = {name: happened[name] for name in ERROR_TYPES}
        on_ground: list[int] = []
        if self._ending == "collapsed":
            fell = next(turn["fallen"] for turn in reversed(self._turns) if turn.get("fallen"))
            on_ground = [v for v in assembly.vertices if scene.blocks[v].order in fell]
        scores = []
        for setting in self._track.suite.settings:
            chosen, candidates = assembly.chosen, self._task.candidates
            placed = placed_counts(scene, candidates, setting, chosen, on_ground)
            attempted = Counts(placed.tp, len(plan) - placed.tp, placed.fn)
            for name, counts, wrong in (("placed", placed, None), ("attempted", attempted, errors)):
                way = {"criterion": name, "matcher": None, "setting": setting}
                scores.append({**way, **vars(counts), "errors": wrong})
        fields = {
            "parse": {"parser": "move", "rule": None, "plan": plan, "dropped": []},
            "scores": scores,
            "ending": self._ending or "unanswered",
            "outcomes": [step.outcome for step in self._past],
            "turns": list(self._turns),
        }
        return Judgement(any(turn["parse"]["problem"] is None for turn in self._turns), fields)
