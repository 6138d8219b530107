"""A person as a model of a run: who it is, and requests answered by what was picked."""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from functools import partial

from pydantic import JsonValue

from phyblock.config.models import HUMAN, ModelConfig
from phyblock.config.suite import Suite
from phyblock.errors import Problem, SpecError
from phyblock.models import Reply, Request, Usage
from phyblock.play.order import arranged, row_of_name
from phyblock.run.models import PlannedModel
from phyblock.run.plan import RunPlan, make_plan
from phyblock.stable import hex_digest
from phyblock.tracks.by_hand import Pick, Picking
from phyblock.tracks.kind import kinds

__all__ = ["Given", "Person", "PersonModel", "picking_of", "plan_sitting"]

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")


@dataclass(frozen=True)
class Person:
    """Who sits down: a short name, the number in the study if there is one, and the text that is
    agreed to first. Raises SpecError for a name with other characters than stated.
    """

    name: str
    number: int | None
    consent: str

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            allowed = "1 to 40 letters a-z, A-Z, digits, - and _, with a letter or digit first"
            raise SpecError(Problem("--name", "is no name", "", self.name, allowed))

    @property
    def model(self) -> str:
        """The name in records and tables."""
        return f"{HUMAN}{self.name}"

    @property
    def row(self) -> int:
        """The row of the design that orders what is shown."""
        return row_of_name(self.name) if self.number is None else self.number - 1

    @property
    def consent_sha256(self) -> str:
        """Digest of the text that is agreed to."""
        return hex_digest(self.consent)

    def planned(self) -> PlannedModel:
        """The person in a plan; number and text make runs that are not the same."""
        params: dict[str, JsonValue] = {"consent": self.consent_sha256}
        if self.number is not None:
            params["number"] = self.number
        config = ModelConfig(name=self.model, extra_body=params, max_concurrency=1)
        return PlannedModel(self.model, config)


def plan_sitting(suite: Suite, person: Person, limit: int | None) -> RunPlan:
    """The run of one person: a suite asked once, with the first of its seeds, in a row's order.

    Raises SpecError for a suite that asks in several ways or what nobody can answer by hand, and
    what `make_plan` raises.
    """
    if suite.vary.factors:
        message, hint = "asks in several ways, and a person is asked once", "take `vary` out"
        found = ", ".join(suite.vary.factors)
        raise SpecError(Problem(suite.where("vary"), message, "vary", found, hint=hint))
    once = suite.model_copy(update={"seeds": suite.seeds[:1]})
    plan = make_plan(once, {}, limit=limit, people=[person.planned()])
    return replace(plan, arranged=partial(arranged, row=person.row))


@dataclass(frozen=True)
class Given:
    """What a person picked, and how long it took [s]."""

    picks: tuple[Pick, ...]
    took_s: float


def picking_of(request: Request, suite: Suite) -> Picking:
    """How a person answers a request of a suite.

    How grids are cut in pictures that a data set brings is not known: they are not clicked in.
    """
    for kind in kinds().values():
        if type(request.subject) is kind.subject and kind.by_hand is not None:
            picking = kind.by_hand(request.subject)
            return picking if suite.images.source == "render" else picking.without_cells()
    raise AssertionError("a plan has only tracks that can be answered by hand")


class PersonModel:
    """Answers a request with the reply that picks make; `answer` waits for them."""

    needs_messages = True

    def __init__(
        self, name: str, suite: Suite, answer: Callable[[Request, Picking], Awaitable[Given]]
    ) -> None:
        self.name = name
        self._suite = suite
        self._answer = answer

    async def ask(self, request: Request) -> Reply:
        """The reply, in the form that the prompt asks for; raises what `answer` raises."""
        picking = picking_of(request, self._suite)
        given = await self._answer(request, picking)
        text = picking.reply(given.picks)
        return Reply(
            text=text,
            usage=Usage(prompt_tokens=0, completion_tokens=0),
            cost_usd=0.0,
            latency_s=given.took_s,
            provider_model=self.name,
        )

    async def aclose(self) -> None:
        """Nothing is held open."""
