"""One sample from request to record, whether it asks once or plays an episode."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from phyblock.config.models import ModelConfig
from phyblock.config.suite import Variant
from phyblock.errors import BudgetReachedError, ModelError, UnavailableError
from phyblock.models import AskLaterError, Model, Request
from phyblock.records.record import Record, SentPrompt, Turn
from phyblock.records.reply import Reply, Usage
from phyblock.run.extraction import Extractor
from phyblock.run.halt import Halt
from phyblock.run.judging import judged_apart
from phyblock.run.records import about_prompt, begun, judged
from phyblock.run.shielded import to_its_end
from phyblock.run.store import PromptFile, RecordWriter
from phyblock.stable import drawn_bytes, plain_sum
from phyblock.tracks import (
    AnyTrack,
    Episode,
    EpisodeTrack,
    Item,
    SingleTrack,
)
from phyblock.types import AskedAs

__all__ = ["Sample", "SampleRunner"]

_N = TypeVar("_N", int, float)
_SEEDS = 2**31
"""Providers take no larger ones."""


@dataclass(frozen=True)
class Sample:
    """One item of a track, asked of one model with one seed; `track` asks as the variant does."""

    track: AnyTrack
    model: str
    item: Item
    seed: int
    variant: Variant = field(default_factory=Variant)

    @property
    def id(self) -> str:
        """Its name inside the run."""
        whole = f"{self.track.name}/{self.model}/{self.item.key}/s{self.seed}"
        return f"{whole}/{self.variant.key}" if self.variant.key else whole

    def asking(self, request: Request) -> Request:
        """The request as it is sent: a repeat has another seed, and so is asked anew."""
        repeat = self.variant.repeat
        if repeat == 1:
            return request
        digest = drawn_bytes("repeat", request.seed, repeat)
        return replace(request, seed=int.from_bytes(digest[:8], "big") % _SEEDS)

    def shown(self) -> Sample:
        """The sample with its item as its seed shows it."""
        return replace(self, item=self.track.shown(self.item, self.seed))


class SampleRunner:
    """Turns samples into records; answered turns of episodes are on disk before the next is asked.

    `earlier` are the turns of episodes that an earlier command began, by sample id; `run` is the
    digest that shows whose the records are; `extractor` is asked what unread replies say.
    """

    def __init__(
        self,
        turns: RecordWriter,
        prompts: PromptFile,
        halt: Halt,
        earlier: Mapping[str, Sequence[Turn]],
        run: str,
        extractor: Extractor | None = None,
    ) -> None:
        self._extractor = extractor
        self._turns = turns
        self._prompts = prompts
        self._halt = halt
        self._earlier = earlier
        self._run = run

    async def record(self, sample: Sample, model: Model, config: ModelConfig) -> Record:
        """Ask, and say what came of it.

        Raises UnavailableError, BudgetReachedError, HaltedError and AskLaterError as models do, and
        what making a prompt or writing a turn raises.
        """
        sample = sample.shown()
        if isinstance(sample.track, EpisodeTrack):
            return await self._play(sample, sample.track, model, config)
        return await self._ask(sample, sample.track, model, config)

    async def request(
        self, sample: Sample, config: ModelConfig, *, with_messages: bool = True
    ) -> Request:
        """The request of a sample that is asked once. HaltedError where the run ends meanwhile."""
        sample = sample.shown()
        assert isinstance(sample.track, SingleTrack), "an episode has many requests"
        return await self._request(sample, sample.track, config, with_messages=with_messages)

    async def _request(
        self, sample: Sample, track: SingleTrack[Any], config: ModelConfig, *, with_messages: bool
    ) -> Request:
        with self._halt.giving_up():
            request = await track.request(
                sample.item, sample.seed, config.params, with_messages=with_messages
            )
        return sample.asking(replace(request, track=track.name))

    async def _ask(
        self,
        sample: Sample,
        track: SingleTrack[Any],
        model: Model,
        config: ModelConfig,
    ) -> Record:
        request = await self._request(sample, track, config, with_messages=model.needs_messages)
        with self._halt.giving_up():
            answer = await _answer(model.ask(request))
        fields = self._begin(sample, answer) | _asked(config, request)
        fields["prompt"] = self._prompt(track, request)
        text = answer.text if isinstance(answer, Reply) else None
        record, is_cancelled = await to_its_end(self._judged(track, sample.item, text, fields))
        task = asyncio.current_task()
        if is_cancelled and task is not None:
            # It ends at its next wait, which is that for its record.
            task.cancel()
        return record

    async def _judged(
        self, track: SingleTrack[Any], item: Item, text: str | None, fields: Mapping[str, Any]
    ) -> Record:
        record = await judged_apart(track, item, text, fields)
        if self._extractor is None:
            return record
        return await self._extractor.read(track, item, record)

    async def _play(
        self,
        sample: Sample,
        track: EpisodeTrack[Any],
        model: Model,
        config: ModelConfig,
    ) -> Record:
        episode = track.start(
            sample.item, sample.seed, config.params, with_messages=model.needs_messages
        )
        asked: dict[str, AskedAs] = {}
        earlier = self._earlier.get(sample.id, ())
        turns: list[dict[str, Any]] = []
        replies: list[Reply] = []
        answer: Reply | ModelError | None = None
        while (wanted := await self._next(episode)) is not None:
            request = sample.asking(wanted)
            asked = _asked(config, request)
            prompt = self._prompt(track, request)
            turn = {"prompt": prompt}
            digest = "" if prompt is None else prompt.messages
            known = earlier[len(replies)] if len(replies) < len(earlier) else None
            # Where earlier replies led elsewhere, as another version read them, it asks anew.
            if known is not None and known.messages == digest != "":
                answer = known.reply
            else:
                with self._halt.giving_up():
                    answer = await _answer(_ask_now(model, request))
                if isinstance(answer, Reply):
                    number, reply = len(replies), answer.storable()
                    await self._turns.put(
                        Turn(
                            sample=sample.id,
                            turn=number,
                            reply=reply,
                            run=self._run,
                            messages=digest,
                        )
                    )
            if not isinstance(answer, Reply):
                break
            turns.append({"reply": answer.storable(), **turn})
            replies.append(answer)
            episode.take(request, answer)
        failed = answer if isinstance(answer, ModelError) else None
        fields = self._begin(sample, failed) | asked
        return self._ended(fields, sample.item, episode, turns, replies)

    def _ended(
        self,
        begun: Mapping[str, Any],
        item: Item,
        episode: Episode,
        turns: Sequence[Mapping[str, Any]],
        replies: Sequence[Reply],
    ) -> Record:
        fields = dict(begun)
        fields["reply"] = _pooled(replies).storable() if replies else None
        fields["prompt"] = turns[0]["prompt"] if turns else None
        both = zip(turns, episode.fields()["turns"], strict=True)
        whole = [{"n": n, **turn, **more} for n, (turn, more) in enumerate(both, 1)]
        return judged(fields, item, episode, {"turns": whole})

    async def _next(self, episode: Episode) -> Request | None:
        with self._halt.giving_up():
            return await episode.request()

    def _prompt(self, track: AnyTrack, request: Request) -> SentPrompt | None:
        if not request.messages:
            return None
        return about_prompt(request, track.prompt_name, self._prompts.keep(request.messages))

    def _begin(self, sample: Sample, answer: Reply | ModelError | None) -> dict[str, Any]:
        name, item = sample.track.name, sample.item
        fields = begun(sample.id, name, sample.model, item, sample.seed, answer)
        if sample.variant.levels:
            fields["variant"] = dict(sample.variant.levels)
        return {**fields, "run": self._run, **sample.track.about(item)}


def _asked(config: ModelConfig, request: Request) -> dict[str, AskedAs]:
    """Return the fields of a record about a request for JSON; nothing where none was made of
    anyone.
    """
    if request.response_format is None or config.kind != "litellm":
        return {}
    return {"asked": "response_format" if config.sends_format else "prompt"}


async def _ask_now(model: Model, request: Request) -> Reply | None:
    """Return the answer of a model that may defer a request: an episode that has begun goes on."""
    try:
        return await model.ask(request)
    except AskLaterError:
        return await model.ask(request)


async def _answer(asked: Awaitable[Reply | None]) -> Reply | ModelError | None:
    """The reply, or the error that is this sample's alone."""
    try:
        return await asked
    except (UnavailableError, BudgetReachedError):
        raise
    except ModelError as error:
        return error


def _pooled(replies: Sequence[Reply]) -> Reply:
    """Return the sum of an episode's replies, with the text of the last one.

    It is cut off or refused where every one of them is.
    """
    counts = {
        name: _sum(getattr(reply.usage, name) for reply in replies) for name in Usage.model_fields
    }
    billed = [reply.billed_usd for reply in replies if reply.billed_usd is not None]
    ends = {reply.finish for reply in replies}
    return Reply(
        text=replies[-1].text,
        finish=ends.pop() if len(ends) == 1 else "stop",
        usage=Usage(**counts),
        cost_usd=_sum(reply.cost_usd for reply in replies),
        billed_usd=plain_sum(billed) if billed else None,
        latency_s=plain_sum(reply.latency_s for reply in replies),
        provider_model=replies[-1].provider_model,
        attempts=sum(reply.attempts for reply in replies),
        cached=all(reply.cached for reply in replies),
        seed_sent=all(reply.seed_sent for reply in replies),
    )


def _sum(values: Iterable[_N | None]) -> _N | None:
    """The sum, or None where one is not known."""
    found = list(values)
    known = [value for value in found if value is not None]
    return plain_sum(known) if known and len(known) == len(found) else None
