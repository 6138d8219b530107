"""A human baseline: a person answers a suite on a page, asked, recorded and scored like a model.

The run asks in its event loop and waits; the server's threads read the current question, and accept
an answer. The run shows no question before the last answer is on disk.
"""

from __future__ import annotations

import asyncio
import re
import signal
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import fmean
from typing import Any, Literal

from PIL import Image as Picture
from pydantic import JsonValue

from phyblock.config.models import HUMAN, ModelConfig
from phyblock.config.suite import Suite
from phyblock.domain.scene import AssemblyTask
from phyblock.errors import Problem, SpecError
from phyblock.models.request import HaltedError, Image, Request
from phyblock.records.files import read_records
from phyblock.records.record import Record, Reply, Usage
from phyblock.results.compare import check_pair, comparable
from phyblock.results.estimates import Headline
from phyblock.results.load import load_run
from phyblock.results.text import number as rounded
from phyblock.run.plan import RunPlan, make_plan
from phyblock.run.runner import RunEvent, RunResult, RunStarted, Session
from phyblock.run.store import Summary, begun, judge_reply
from phyblock.sim.pictures import Lookout, PictureStyle, to_png
from phyblock.text import counted, one_line
from phyblock.tracks.base import Pick, Picking, SceneTrack, as_recorded, kind_of
from phyblock.web.pack import card_png

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}")
_BUILT = re.compile(r"built/(\d{1,9})\.png")
_PICTURE_PX, _GAP_PX = 320, 8
Phase = Literal["start", "warmed", "waiting", "question", "paused", "done", "closed"]


def plan_session(suite: Suite, name: str, limit: int | None, *, is_exact: bool = False) -> RunPlan:
    """Return the plan of one person's run: a suite asked once, with its first seed.

    With `is_exact` the page shows the exact prompt of models. Raises as `make_plan`, and SpecError
    for a bad name, `vary`, or tracks that nobody can answer by hand.
    """
    if not _NAME.fullmatch(name):
        allowed = "1 to 40 letters a-z, A-Z, digits, - and _, with a letter or digit first"
        raise SpecError(Problem("--name", "is not a valid name", "", name, allowed))
    if suite.vary.factors:
        message, hint = "varies its presentation, and a person is asked once", "remove `vary`"
        found = ", ".join(suite.vary.factors)
        raise SpecError(Problem(suite.where("vary"), message, "vary", found, hint=hint))
    once = suite.model_copy(update={"seeds": suite.seeds[:1]})
    # Another prompt makes another run.
    params: dict[str, JsonValue] = {"exact": True} if is_exact else {}
    planned = ModelConfig(name=f"{HUMAN}{name}", extra_body=params, max_concurrency=1)
    return make_plan(once, {}, limit=limit, people=[planned])


class PersonModel:
    """A model that answers a request with the reply from a person's picks on a page.

    Before the first plan, the person may try the page on another scene; nothing of it is kept.
    """

    needs_messages = True

    def __init__(self, name: str, plan: RunPlan, session: PlaySession) -> None:
        self.name = name
        self._plan, self._session = plan, session
        self._spare, track = None, plan.tracks[0]
        if isinstance(track, SceneTrack) and not track.plays:
            used = {task.scene.id for task in plan.dataset.tasks}
            left = (task for task in track.dataset.tasks if task.scene.id not in used)
            self._spare = next((task for task in left if 1 in task.scene.levels), None)

    async def ask(self, request: Request) -> Reply:
        """Return the reply in the form of the prompt. Raises HaltedError after the end."""
        if self._spare is not None and not self._session.done:
            track, seed = self._plan.tracks[0], self._plan.suite.seeds[0]
            shown, self._spare = track.shown(self._spare, seed), None
            first = await track.request(shown, seed, {}, with_messages=True)
            reply = await self._answered(first, is_warm_up=True)
            fields = begun("warm-up", track, self.name, shown, seed, reply)
            record = await judge_reply(track, shown, fields)
            self._session.warmed(went(record, self._plan.suite.scoring.matchers[0]))
        return await self._answered(request)

    async def _answered(self, request: Request, *, is_warm_up: bool = False) -> Reply:
        by_hand = kind_of(request.track).by_hand
        assert by_hand is not None, "a plan has only tracks that can be answered by hand"
        picking = by_hand(request.subject)
        if self._plan.suite.images.source != "render":
            # The grids in a data set's own pictures are unknown.
            picking = picking.without_cells()
        text, took_s = await self._session.ask(request, picking, is_warm_up=is_warm_up)
        return Reply(
            text=text,
            usage=Usage(prompt_tokens=0, completion_tokens=0),
            cost_usd=0.0,
            latency_s=took_s,
            provider_model=self.name,
        )

    async def aclose(self) -> None:
        """Do nothing: nothing is held open."""


def shown(
    request: Request, picking: Picking, place: Mapping[str, int], addresses: Sequence[str]
) -> dict[str, Any]:
    """Return a question as data of the page: the messages for a model, and the choices.

    It contains nothing else of an item: no name, no scene, no answer. `place` is the number of the
    item (0: a warm-up), the number of items, and the turn; `addresses` are those of its pictures.
    """
    pictures, left = request.images, iter(addresses)
    last = {picture.label: (n, picture) for n, picture in enumerate(pictures)}

    def part_of(part: str | Image) -> dict[str, Any]:
        if isinstance(part, str):
            return {"text": part}
        size = {"width": part.width_px, "height": part.height_px}
        return {"picture": next(left), "label": part.label, **size}

    choices = []
    for choice in picking.choices:
        # The number of the picture, and shares of its sides.
        seen = [last[label] for label in choice.labels if label in last]
        spots = [
            {"picture": n, "box": choice.box(picture.width_px, picture.height_px)}
            for n, picture in seen
        ]
        choices.append({"name": choice.name, "text": choice.text, "spots": spots})
    return {
        **place,
        "messages": [
            {"role": message.role, "parts": [part_of(part) for part in message.parts]}
            for message in request.messages
        ],
        "choices": choices,
        **{name: getattr(picking, name) for name in ("least", "most", "repeats", "noun", "task")},
        "fields": [asdict(field) for field in picking.fields],
    }


class NotNowError(Exception):
    """The page sent something unexpected: another page was faster, or no question is shown."""


@dataclass
class _Asked:
    """A pending question, and how long it was shown [s]."""

    request: Request
    picking: Picking
    place: Mapping[str, int]
    answer: Future[tuple[str, float]]
    before_s: float = 0.0
    since_s: float | None = None

    def seen_s(self, now_s: float) -> float:
        """Return how long the question was shown."""
        return self.before_s + (0.0 if self.since_s is None else now_s - self.since_s)


class PlaySession:
    """One question at a time; every change has a number, with which a page requests the next."""

    def __init__(self, of: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._of, self.done, self._turns = of, 0, 0
        self._clock = clock
        self._changed = threading.Condition()
        self._number = 0
        self._phase: Phase = "waiting"
        self._details: Mapping[str, Any] = {}
        self._asked: _Asked | None = None
        self._is_exact = False
        self._ending: Ending | None = None

    async def run(self, plan: RunPlan, folder: Path, opened: Callable[[], None]) -> RunResult:
        """Ask the remaining samples; a signal closes the session, and all answers are written.

        `opened` is called when the page can be shown. Raises the errors of the run.
        """

        (person,) = (model for model in plan.models if model.kind == "human")
        self._is_exact = "exact" in person.extra_body

        def watch(event: RunEvent) -> None:
            if isinstance(event, RunStarted):
                self.done = len(event.earlier[person.name])
                if self.done < self._of:
                    self.welcome(person.name.removeprefix(HUMAN))
                opened()
            elif isinstance(event, Summary) and event.model == person.name:
                self.done += event.is_final
                self._turns = 0

        model, loop = PersonModel(person.name, plan, self), asyncio.get_running_loop()
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

    async def ask(
        self, request: Request, picking: Picking, *, is_warm_up: bool = False
    ) -> tuple[str, float]:
        """Return a person's reply and how long it took [s]. Raises HaltedError at the end."""
        answer: Future[tuple[str, float]] = Future()
        # From now on it can be settled, even if nobody waits any more.
        answer.set_running_or_notify_cancel()
        with self._changed:
            if self._phase == "closed":
                raise HaltedError("the session was closed")
            self._turns += not is_warm_up
            number = 0 if is_warm_up else self.done + 1
            place = {"number": number, "of": self._of, "turn": max(1, self._turns)}
            self._asked = _Asked(request, picking, place, answer)
            if self._phase == "waiting":
                self._go_to("question")
        return await asyncio.wrap_future(answer)

    def state(self, after: int, wait_s: float = 0.0) -> dict[str, Any]:
        """Return the state for a page; wait for a change after number `after`, up to `wait_s`."""
        with self._changed:
            self._changed.wait_for(lambda: self._number != after, wait_s)
            state: dict[str, Any] = {"change": self._number, "phase": self._phase, **self._details}
            if self._asked is not None and self._phase == "question":
                asked, now_s = self._asked, self._clock()
                # The clock starts when the question is first sent.
                asked.since_s = now_s if asked.since_s is None else asked.since_s
                count = len(asked.request.images)
                addresses = [f"picture/{self._number}/{n}" for n in range(count)]
                state["question"] = shown(asked.request, asked.picking, asked.place, addresses)
                state |= {"elapsed_s": asked.seen_s(now_s), "exact": self._is_exact}
            return state

    def picture(self, change: int, number: int) -> Image | None:
        """Return a picture of the current question; None for any other."""
        with self._changed:
            if self._asked is None or self._phase != "question" or change != self._number:
                return None
            pictures = self._asked.request.images
            return pictures[number] if 0 <= number < len(pictures) else None

    def drawn(self, name: str) -> bytes | None:
        """Return a picture of the final page by name; None for any other, and before the end."""
        return None if self._ending is None else self._ending.picture(name)

    def welcome(self, name: str) -> None:
        """Show the introduction to a person of this name."""
        with self._changed:
            self._go_to("start", about={"name": name, "done": self.done, "of": self._of})

    def warmed(self, went: Mapping[str, Any]) -> None:
        """Show the result of the warm-up."""
        with self._changed:
            self._go_to("warmed", went=went)

    def begin(self) -> None:
        """Show questions from now on, after a welcome, a warm-up or a pause."""
        with self._changed:
            if self._phase not in ("start", "warmed", "paused"):
                raise NotNowError
            self._go_to("waiting" if self._asked is None else "question")

    def answer(self, change: int, picks: Sequence[Pick]) -> None:
        """Accept the answer to the question with this change number.

        Raises NotNowError if it is not the current one, ValueError for picks that make no answer.
        """
        with self._changed:
            asked = self._on_show(change)
            text = asked.picking.reply(picks)
            self._asked = None
            self._go_to("waiting")
            asked.answer.set_result((text, round(asked.seen_s(self._clock()), 3)))

    def pause(self) -> None:
        """Hide the question and stop the clock."""
        with self._changed:
            asked = self._on_show()
            asked.before_s, asked.since_s = asked.seen_s(self._clock()), None
            self._go_to("paused")

    def finish(self, ending: Ending) -> None:
        """Show the results: the session is over."""
        with self._changed:
            self._ending = ending
            self._go_to("done", results=ending.shown)

    def close(self) -> None:
        """Accept nothing more; the current question is given up."""
        with self._changed:
            asked, self._asked = self._asked, None
            self._go_to("closed")
        if asked is not None:
            asked.answer.set_exception(HaltedError("the session was closed"))

    def _on_show(self, change: int | None = None) -> _Asked:
        if self._phase != "question" or change not in (None, self._number):
            raise NotNowError
        assert self._asked is not None
        return self._asked

    def _go_to(self, phase: Phase, **details: Any) -> None:
        self._phase, self._details = phase, details
        self._number += 1
        self._changed.notify_all()


class Ending:
    """The page after the end: a track's means of person, rules and models, and a row for each item.

    Models are of this run and those `beside` it. A note explains why a run cannot be compared.
    """

    def __init__(
        self, folder: Path, person: str, beside: Sequence[Path], tasks: Sequence[AssemblyTask]
    ) -> None:
        self._runs = [load_run(path) for path in (folder, *beside)]
        self._run, self._person = self._runs[0], person
        of_scene = {task.scene.id: task for task in tasks}
        records = [one for one in read_records(folder) if one.model == person]
        self._built = {
            n: (task, record.built(as_recorded(task, record)))
            for n, record in enumerate(records)
            if record.is_correct is None and (task := of_scene.get(record.scene)) is not None
        }
        self._notes: list[str] = []
        tracks = [self._track(name, records) for name in self._run.design.suite.tracks]
        self.shown: Mapping[str, Any] = {
            "tracks": [track for track in tracks if track["rows"]],
            "notes": list(dict.fromkeys(self._notes)),
        }

    def picture(self, name: str) -> bytes | None:
        """Return the card, or the goal beside the built structure; None for other names."""
        if (found := _BUILT.fullmatch(name)) and int(found[1]) in self._built:
            return to_png(self._pair(int(found[1])))
        if name != "card.png" or not self.shown["tracks"]:
            return None
        first = self.shown["tracks"][0]
        said = " · ".join(f"{one} {rounded(value)}" for one, value in first["line"])
        items = counted(len(first["rows"]), first["item"])
        about = f"{first['title']}: {first['measure']}, {items}"
        pair = self._pair(next(iter(self._built))) if self._built else None
        return card_png("Can you build this?", f"{said}\n{about}", pair)

    def _pair(self, number: int) -> Picture.Image:
        """Return a picture of the goal on the left and the built structure on the right."""
        task, built = self._built[number]
        lookout = Lookout(task.scene, PictureStyle(_PICTURE_PX))
        pair = Picture.new("RGB", (2 * _PICTURE_PX + _GAP_PX, _PICTURE_PX), "#ffffff")
        for place, blocks in enumerate((task.scene.blocks, built)):
            pair.paste(lookout.image(blocks), (place * (_PICTURE_PX + _GAP_PX), 0))
        return pair

    def _track(self, track: str, records: Sequence[Record]) -> dict[str, Any]:
        """Return a track: measure, all means, rows, and the `line` of person, floor, best model."""
        kind, what = kind_of(track), comparable(self._run, track)
        measure, part = what.measure, what.parts[-1]
        # The value of each item, by name.
        others: dict[str, dict[str, float]] = {}
        for other in self._runs:
            if track not in other.design.suite.tracks:
                continue
            try:
                check_pair(other, self._run, [part.cell], track, measure)
            except SpecError as error:
                self._notes.append(f"Left out, as it cannot be compared: {one_line(str(error))}")
                continue
            for model, values in what.values(other, part, self._run.design):
                by_item = values.groupby(level="item").mean()
                found = {str(item): float(mean) for item, mean in by_item.items()}
                others.setdefault(model, found)
        own = others.pop(self._person, {})
        rows = [
            {
                "key": record.item,
                "sample": record.sample,
                "value": own.get(record.item),
                "took_s": None if record.reply is None else record.reply.latency_s,
                "picture": f"built/{n}.png" if n in self._built else None,
                **went(record, self._run.design.matcher),
            }
            for n, record in enumerate(records)
            if record.track == track
        ]
        means = [("You", fmean(own.values()), len(own))] if own else []
        for name, found in others.items():
            if common := [found[row["key"]] for row in rows if row["key"] in found]:
                means.append((name, fmean(common), len(common)))
        means.sort(key=lambda one: one[1], reverse=measure.better == "higher")
        worth = {name: value for name, value, _ in means}
        line = [("You", worth["You"])] if own else []
        if (floor := Headline(self._run, track).floor) is not None:
            line.append((floor.name, worth.get(floor.name, floor.value)))
        rules = {"You"}.union(*(one.design.baselines for one in self._runs))
        line += [(f"best model {name}", worth[name]) for name in worth if name not in rules][:1]
        return {
            "title": kind.title,
            "item": kind.item,
            "measure": measure.heading,
            "unit": measure.unit,
            "line": line,
            "means": means,
            "rows": rows,
        }


def went(record: Record, matcher: str) -> dict[str, Any]:
    """Return the answer, step by step with the reason for wrong ones, or with the right answer."""
    if record.is_correct is not None:
        return {"given": record.parsed_text, "right": record.target, "correct": record.is_correct}
    if (course := record.course(matcher)) is None:
        return {}
    steps = [{"name": name, "why": why} for name, why in course.steps]
    return {"steps": steps, "missing": course.missing}
