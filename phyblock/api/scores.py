"""Scores of a reply about a scene."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from phyblock.api.given import expect
from phyblock.data import AssemblyTask
from phyblock.errors import Problem, SpecError
from phyblock.parsing.plan import parse_plan
from phyblock.scoring.plan import AssemblyScorer, ErrorType
from phyblock.types import MATCHERS, PLAN_PARSERS, SETTINGS, Matcher, PlanParser, Setting

__all__ = ["PlanScore", "score"]


@dataclass(frozen=True)
class PlanScore:
    """A reply, read and scored.

    `plan` holds the candidates in order as they were read by `rule`, which is None where nothing
    could be read; `problem` says why then. `errors` has the reason of each wrong step, None for a
    right one. `tp`, `fp` and `fn` count right steps, wrong steps and blocks that are missing;
    `precision`, `recall` and `f1` are in [0, 1], None where nothing was counted.
    """

    plan: tuple[int, ...]
    rule: str | None
    problem: str | None
    setting: Setting
    matcher: Matcher
    tp: int
    fp: int
    fn: int
    precision: float | None
    recall: float | None
    f1: float | None
    errors: tuple[ErrorType | None, ...]

    def _repr_html_(self) -> str:
        """Return what a notebook shows: F1, and what became of each step."""
        if self.rule is None:
            return f"<p>Nothing could be read: {escape(str(self.problem))}</p>"
        f1 = "none" if self.f1 is None else f"{100 * self.f1:.1f} %"
        head = f"F1 {f1}, setting {self.setting}, {self.matcher} matcher"
        rows = (
            f"<tr><td>{n}</td><td>{block}</td><td>{(error or 'placed').replace('_', ' ')}</td></tr>"
            for n, (block, error) in enumerate(zip(self.plan, self.errors, strict=True), 1)
        )
        return (
            f"<p><b>{head}</b>: {self.tp} right, {self.fp} wrong, {self.fn} missing</p><table>"
            f"<thead><tr><th>Step</th><th>Block</th><th>Outcome</th></tr></thead>"
            f"<tbody>{''.join(rows)}</tbody></table>"
        )


def score(
    reply: str,
    scene: AssemblyTask,
    *,
    setting: Setting = "A",
    matcher: Matcher = "optimal",
    parser: PlanParser = "steps",
) -> PlanScore:
    """Read a reply to full planning and score its plan against a scene, by the AOV graph.

    Raises SpecError for a setting, matcher or parser that there is not, and for arguments of
    another kind.
    """
    expect(
        "score",
        {
            "reply": (reply, str, "text"),
            "scene": (scene, AssemblyTask, "a scene of a suite: suite.scenes[ID]"),
        },
    )
    given = {
        "setting": (setting, SETTINGS),
        "matcher": (matcher, MATCHERS),
        "parser": (parser, PLAN_PARSERS),
    }
    problems = [
        Problem("score", "is not known", name, str(word), ", ".join(words))
        for name, (word, words) in given.items()
        if word not in words
    ]
    if problems:
        raise SpecError(problems)
    parsed = parse_plan(reply, len(scene.candidates), parser)
    (scored,) = AssemblyScorer(scene.scene, scene.candidates, (setting,)).score(
        parsed.plan, (matcher,), None
    )
    counts = scored.counts
    return PlanScore(
        plan=parsed.plan.steps,
        rule=parsed.rule,
        problem=parsed.problem,
        setting=setting,
        matcher=matcher,
        tp=counts.tp,
        fp=counts.fp,
        fn=counts.fn,
        precision=counts.precision,
        recall=counts.recall,
        f1=counts.f1,
        errors=scored.step_errors or (),
    )
