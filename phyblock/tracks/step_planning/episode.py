"""One episode of step planning, as a state machine that replies alone drive."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from phyblock.data import AssemblyTask
from phyblock.domain import Block, Plan
from phyblock.models.base import Image, Message, Request
from phyblock.parsing.move import MoveProblem, ParsedMove, parse_move
from phyblock.records.reply import Reply
from phyblock.scoring.counts import Counts
from phyblock.scoring.plan import ERROR_TYPES, ErrorType
from phyblock.scoring.steps import Assembly, attempted_counts, placed_counts
from phyblock.sim.dynamics import Settled
from phyblock.tracks.prompts import response_format
from phyblock.tracks.showing import file_plan
from phyblock.tracks.step_planning.baselines import StepSubject
from phyblock.tracks.step_planning.prompt import PastStep, StepOutcome
from phyblock.tracks.step_planning.rules import Ending, StepRules, Tally, majority
from phyblock.types import Setting

__all__ = ["Desk", "StepEpisode"]

_NOT_TRIED = ("done", *get_args(MoveProblem))
"""Outcomes of steps in which no move was attempted."""


@dataclass(frozen=True)
class Desk:
    """What an episode needs done for it.

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
        """Whether an operation could be read in any reply."""
        return any(turn["parse"]["problem"] is None for turn in self._turns)

    @property
    def outcomes(self) -> list[StepOutcome]:
        """What became of every step, in order."""
        return [step.outcome for step in self._past]

    @property
    def steps(self) -> list[int]:
        """The candidates of all moves that were attempted, in order."""
        return [turn["parse"]["move"] for turn in self._turns if _is_attempt(turn)]

    def fields(self) -> dict[str, Any]:
        """What the record says of the episode (docs/results.md)."""
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
