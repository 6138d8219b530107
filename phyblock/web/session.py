"""A human baseline: a person answers a suite at a page, with the pictures, prompts, records and
scores of a model.

The run asks in its loop and waits; the server's threads read the question on show, and take an
answer. No question is shown before the answer to the last one is on disk, as the run sees to.

The order of items is a row of a Williams design, over whose rows every item stands in every place
equally often and follows every other equally often, so that neither practice nor what came just
before favors an item (E. J. Williams 1949, Australian Journal of Scientific Research A 2, 149-168).
An even number of items has as many rows, an odd one twice as many.
"""

from __future__ import annotations

import asyncio
import re
import signal
import threading
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

from pydantic import JsonValue

from phyblock.config.models import HUMAN, ModelConfig
from phyblock.config.suite import Suite
from phyblock.errors import Problem, SpecError
from phyblock.models import HaltedError, Image, Reply, Request, Usage
from phyblock.records.files import read_records
from phyblock.records.record import Record
from phyblock.results.compare import check_alike, comparable
from phyblock.results.load import Design, load_run
from phyblock.run.events import RunEvent, RunStarted, SampleDone
from phyblock.run.plan import RunPlan, make_plan
from phyblock.run.runner import RunResult, Session
from phyblock.stable import drawn_bytes, hex_digest
from phyblock.text import one_line
from phyblock.tracks import Item
from phyblock.tracks.base import kind_of
from phyblock.tracks.picking import Pick, Picking

_ItemT = TypeVar("_ItemT", bound=Item)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
Phase = Literal["consent", "waiting", "question", "paused", "done", "closed"]


def williams_rows(n: int) -> int:
    """Return how many rows the design of `n` items has."""
    return max(1, n if n % 2 == 0 else 2 * n)


def williams_row(n: int, row: int) -> tuple[int, ...]:
    """Return the items 0 to `n` - 1 in the order of a row from 0; rows begin again at the end."""
    row %= williams_rows(n)
    # Neighbors differ by 1, -2, 3, ...: by every difference but 0, each once.
    first = [(place + 1) // 2 if place % 2 else -place // 2 for place in range(n)]
    turned = [(item + row) % n for item in first]
    return tuple(turned if row < n else reversed(turned))


def arranged(items: Sequence[_ItemT], row: int) -> tuple[_ItemT, ...]:
    """Return the items in the order of a row; which of them is which in the design is drawn once
    for all people, by digests of their keys.
    """
    mixed = sorted(items, key=lambda item: drawn_bytes("place", item.key))
    return tuple(mixed[place] for place in williams_row(len(mixed), row))


@dataclass(frozen=True)
class Person:
    """A person who answers: a short name, the number in the study if there is one, and the text
    that is agreed to first. One who `is_exact` reads the prompt of models, as studies may want.
    Raises SpecError for a name with other characters than stated.
    """

    name: str
    number: int | None
    consent: str
    is_exact: bool = False

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
        """The row of the design: that of the number, or one drawn by the name."""
        if self.number is not None:
            return self.number - 1
        return int.from_bytes(drawn_bytes("row", self.name)[:6], "big")

    @property
    def consent_sha256(self) -> str:
        """Digest of the text that is agreed to."""
        return hex_digest(self.consent)

    def planned(self) -> ModelConfig:
        """Return the person in a plan; number and text make runs that are not the same."""
        params: dict[str, JsonValue] = {"consent": self.consent_sha256}
        if self.number is not None:
            params["number"] = self.number
        if self.is_exact:
            params["exact"] = True
        return ModelConfig(name=self.model, extra_body=params, max_concurrency=1)


def plan_session(suite: Suite, person: Person, limit: int | None) -> RunPlan:
    """Plan the run of one person: a suite asked once, with its first seed, in a row's order.

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
    """The picks of a person, and how long they took [s]."""

    picks: tuple[Pick, ...]
    took_s: float


def picking_of(request: Request, suite: Suite) -> Picking:
    """Return the choices that answer a request of a suite.

    Nothing tells how grids are cut in pictures that a data set brings: they are not clicked in.
    """
    by_hand = kind_of(request.track).by_hand
    assert by_hand is not None, "a plan has only tracks that can be answered by hand"
    picking = by_hand(request.subject)
    return picking if suite.images.source == "render" else picking.without_cells()


class PersonModel:
    """A model that answers a request with the reply that picks make; `answer` waits for them."""

    needs_messages = True

    def __init__(
        self, name: str, suite: Suite, answer: Callable[[Request, Picking], Awaitable[Given]]
    ) -> None:
        self.name = name
        self._suite, self._answer = suite, answer

    async def ask(self, request: Request) -> Reply:
        """Return the reply, in the form that the prompt asks for; raises what `answer` raises."""
        picking = picking_of(request, self._suite)
        given = await self._answer(request, picking)
        return Reply(
            text=picking.reply(given.picks),
            usage=Usage(prompt_tokens=0, completion_tokens=0),
            cost_usd=0.0,
            latency_s=given.took_s,
            provider_model=self.name,
        )

    async def aclose(self) -> None:
        """Do nothing: nothing is held open."""


@dataclass(frozen=True)
class Place:
    """The place of a question: the item's number from 1, of how many, and the turn there."""

    number: int
    of: int
    turn: int = 1


def pictures_of(request: Request) -> tuple[Image, ...]:
    """Return every picture of a request in the order sent."""
    return tuple(
        part for message in request.messages for part in message.parts if isinstance(part, Image)
    )


def shown(
    request: Request, picking: Picking, place: Place, addresses: Sequence[str]
) -> dict[str, Any]:
    """Return a question as the page takes it: the messages that a model is sent, and the choices.

    Nothing else of an item is in it: no name, no scene, no answer. `addresses` are those of its
    pictures, in order.
    """
    pictures, left = pictures_of(request), iter(addresses)
    last = {picture.label: (n, picture) for n, picture in enumerate(pictures)}

    def part_of(part: str | Image) -> dict[str, Any]:
        if isinstance(part, str):
            return {"text": part}
        size = {"width": part.width_px, "height": part.height_px}
        return {"picture": next(left), "label": part.label, **size}

    choices = []
    for choice in picking.choices:
        # The picture's number, and shares of its sides.
        seen = [last[label] for label in choice.labels if label in last]
        spots = [
            {"picture": n, "box": choice.box(picture.width_px, picture.height_px)}
            for n, picture in seen
        ]
        choices.append({"name": choice.name, "text": choice.text, "spots": spots})
    return {
        **asdict(place),
        "messages": [
            {"role": message.role, "parts": [part_of(part) for part in message.parts]}
            for message in request.messages
        ],
        "choices": choices,
        **{name: getattr(picking, name) for name in ("least", "most", "repeats", "noun", "task")},
        "fields": [asdict(field) for field in picking.fields],
    }


class NotNowError(Exception):
    """The page sent what is not waited for: another page was faster, or no question is shown."""


@dataclass
class _Asked:
    """A question that waits for its answer, and for how long it was on show [s]."""

    request: Request
    picking: Picking
    place: Place
    answer: Future[Given]
    before_s: float = 0.0
    since_s: float | None = None

    def seen_s(self, now_s: float) -> float:
        """Return the time that the question was on show."""
        return self.before_s + (0.0 if self.since_s is None else now_s - self.since_s)


class PlaySession:
    """One question at a time; every change has a number, by which a page asks for the next."""

    def __init__(self, of: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._of, self._done, self._turns = of, 0, 0
        self._clock = clock
        self._changed = threading.Condition()
        self._number = 0
        self._phase: Phase = "waiting"
        self._asked: _Asked | None = None
        self._about: Mapping[str, Any] = {}
        self._is_exact = False
        self._results: Mapping[str, Any] | None = None

    async def run(
        self, plan: RunPlan, person: Person, folder: Path, begun: Callable[[], None]
    ) -> RunResult:
        """Ask what is left; a signal closes the session, and what was answered is written.

        `begun` is called when the run is open and the page can be shown. Raises what the run meets.
        """

        self._is_exact = person.is_exact

        def watch(event: RunEvent) -> None:
            if isinstance(event, RunStarted):
                self._done = len(event.earlier[person.model])
                if self._done < self._of:
                    about = {"name": person.name, "consent": person.consent}
                    self.welcome({**about, "done": self._done, "of": self._of})
                begun()
            elif isinstance(event, SampleDone):
                self._done += event.record.is_final
                self._turns = 0

        model, loop = PersonModel(person.model, plan.suite, self.ask), asyncio.get_running_loop()
        signals = (signal.SIGINT, signal.SIGTERM)
        session = Session(plan, folder, watch, use_cache=False, present={model.name: model})

        def interrupted() -> None:
            session.interrupt()
            self.close()

        for one in signals:
            loop.add_signal_handler(one, interrupted)
        try:
            return await session.run()
        except BaseException:
            self.close()
            raise
        finally:
            for one in signals:
                loop.remove_signal_handler(one)

    async def ask(self, request: Request, picking: Picking) -> Given:
        """Return what the person picks; HaltedError where the session is closed first."""
        answer: Future[Given] = Future()
        # From now on it can be settled, whoever has stopped waiting.
        answer.set_running_or_notify_cancel()
        with self._changed:
            if self._phase == "closed":
                raise HaltedError("the session was closed")
            self._turns += 1
            place = Place(self._done + 1, self._of, self._turns)
            self._asked = _Asked(request, picking, place, answer)
            if self._phase == "waiting":
                self._go_to("question")
        return await asyncio.wrap_future(answer)

    def state(self, after: int, wait_s: float = 0.0) -> dict[str, Any]:
        """Return what a page shows; wait for a change after number `after`, this long at most."""
        with self._changed:
            self._changed.wait_for(lambda: self._number != after, wait_s)
            told: dict[str, Any] = {"change": self._number, "phase": self._phase}
            if self._phase == "consent":
                told["about"] = dict(self._about)
            elif self._phase == "done":
                told["results"] = self._results
            elif self._asked is not None and self._phase == "question":
                asked, now_s = self._asked, self._clock()
                # The clock starts when the question is first given out.
                asked.since_s = now_s if asked.since_s is None else asked.since_s
                count = len(pictures_of(asked.request))
                addresses = [f"picture/{self._number}/{n}" for n in range(count)]
                told["question"] = shown(asked.request, asked.picking, asked.place, addresses)
                told |= {"elapsed_s": asked.seen_s(now_s), "exact": self._is_exact}
            return told

    def picture(self, change: int, number: int) -> Image | None:
        """Return a picture of the question that is shown; None for any other."""
        with self._changed:
            if self._asked is None or self._phase != "question" or change != self._number:
                return None
            pictures = pictures_of(self._asked.request)
            return pictures[number] if 0 <= number < len(pictures) else None

    def welcome(self, about: Mapping[str, Any]) -> None:
        """Ask for consent first; `about` is what the page says of the session."""
        with self._changed:
            self._about = about
            self._go_to("consent")

    def agree(self) -> None:
        """Show questions from now on: the text was agreed to."""
        with self._changed:
            self._expect("consent")
            self._go_to("waiting" if self._asked is None else "question")

    def answer(self, change: int, picks: Sequence[Pick]) -> None:
        """Take the answer to the question that was shown under a number.

        Raises NotNowError for another question than the one on show, ValueError for picks that make
        no answer.
        """
        with self._changed:
            asked = self._on_show(change)
            asked.picking.reply(picks)
            self._asked = None
            self._go_to("waiting")
            seen_s = round(asked.seen_s(self._clock()), 3)
            asked.answer.set_result(Given(tuple(picks), seen_s))

    def pause(self) -> None:
        """Hide the question and stop the clock."""
        with self._changed:
            asked = self._on_show()
            asked.before_s, asked.since_s = asked.seen_s(self._clock()), None
            self._go_to("paused")

    def resume(self) -> None:
        """Show the question again."""
        with self._changed:
            self._expect("paused")
            self._go_to("question")

    def finish(self, results: Mapping[str, Any]) -> None:
        """Show how it went: the session is over."""
        with self._changed:
            self._results = results
            self._go_to("done")

    def close(self) -> None:
        """Take nothing more; a question on show is given up."""
        with self._changed:
            asked, self._asked = self._asked, None
            self._go_to("closed")
        if asked is not None:
            asked.answer.set_exception(HaltedError("the session was closed"))

    def _expect(self, phase: Phase, change: int | None = None) -> None:
        if self._phase != phase or change not in (None, self._number):
            raise NotNowError

    def _on_show(self, change: int | None = None) -> _Asked:
        self._expect("question", change)
        assert self._asked is not None
        return self._asked

    def _go_to(self, phase: Phase) -> None:
        self._phase = phase
        self._number += 1
        self._changed.notify_all()


def outcomes(folder: Path, person: str, beside: Sequence[Path]) -> dict[str, Any]:
    """Return what a page shows after the end: a part for each track, in it a row for each item in
    the order in which it was shown, beside what models of this and other runs did.

    `beside` are folders of other runs; of one that cannot be compared a note says why.
    """
    run = load_run(folder)
    others = [load_run(path) for path in beside]
    records, notes, tracks = list(read_records(folder)), [], []
    for track in run.design.suite.tracks:
        kind, what = kind_of(track), comparable(run, track)
        measure, part = what.measure, what.parts[-1]
        rest: list[tuple[str, dict[str, float]]] = []
        for other in [run, *others]:
            if track not in other.design.suite.tracks:
                continue
            try:
                check_alike(other, run, [part.cell], track, measure)
            except SpecError as error:
                notes.append(f"Left out, as it cannot be compared: {one_line(str(error))}")
                continue
            for model, values in what.values(other, part, run.design):
                means = values.groupby(level="item").mean()
                rest.append((model, {str(item): float(mean) for item, mean in means.items()}))
        own = next((found for name, found in rest if name == person), {})
        rows = [
            {
                "key": record.item,
                "sample": record.sample,
                "value": own.get(record.item),
                "took_s": None if record.reply is None else record.reply.latency_s,
                "others": [
                    {"name": name, "value": found[record.item]}
                    for name, found in rest
                    if record.item in found and found is not own
                ],
                **_went(record, run.design),
            }
            for record in records
            if record.track == track
        ]
        about = {"title": kind.title, "item": kind.item, "measure": measure.heading}
        tracks.append({**about, "unit": measure.unit, "better": measure.better, "rows": rows})
    return {"tracks": tracks, "notes": list(dict.fromkeys(notes))}


def _went(record: Record, design: Design) -> dict[str, Any]:
    """Return what was answered, step by step with why a step is wrong, or with what is right."""
    if record.is_correct is not None:
        return {"given": record.said, "right": record.target, "correct": record.is_correct}
    course = record.course(design.matcher)
    if course is None:
        return {}
    steps = [{"name": name, "why": why} for name, why in course.steps]
    return {"steps": steps, "missing": course.missing}
