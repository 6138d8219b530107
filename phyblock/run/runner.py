"""A run from its open folder to its last record: request, model, judgement, record on disk.

A session emits events and prints nothing. It stops cleanly: nothing more is sent, calls that are
under way are waited for, because they are paid for. What was answered is written whatever ends it,
an error of our own or a cancellation.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Coroutine, Iterator, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from phyblock.config.models import ModelConfig
from phyblock.errors import (
    BudgetReachedError,
    ModelError,
    Problem,
    SpecError,
    StoreError,
    UnavailableError,
)
from phyblock.models import (
    AskLaterError,
    BatchFiles,
    Budget,
    GatheringModel,
    HaltedError,
    Model,
    ReplyCache,
    Request,
    RetryPolicy,
    api_key_status,
    build_model,
    under_way,
)
from phyblock.records.files import BATCHES
from phyblock.records.record import Record, Reply, SentPrompt
from phyblock.resources import reply_cache_file
from phyblock.run.events import (
    ModelStopped,
    RunNotice,
    RunStarted,
    SampleDone,
    Stopping,
    Summary,
    Watcher,
)
from phyblock.run.judge import Extractor, about_prompt, begun, judged, judged_apart, pooled
from phyblock.run.plan import RunPlan, Sample, provider_problem
from phyblock.run.store import CallJournal, Journaled, RecordWriter, RunStore
from phyblock.tracks import AnyTrack, EpisodeTrack
from phyblock.types import AskedAs

_Result = TypeVar("_Result")


class Cause(Enum):
    """The kinds of causes that end a run before all is asked."""

    INTERRUPTED = auto()
    COST = auto()
    """The cost limit is reached."""
    ERROR = auto()


@dataclass(frozen=True)
class Stop:
    """The reason why a run stopped before all was asked: its kind, and the words for a person."""

    cause: Cause
    reason: str


@dataclass
class RunResult:
    """The result of a run: how many of its samples have a final record, how many of those are
    requests that were rejected for good, and how many are replies that could not be judged;
    `stopped` models and why; `unanswered` says what may have been billed without a reply.
    """

    samples: int
    settled: int = 0
    failed: int = 0
    unjudged: int = 0
    stopped: dict[str, str] = field(default_factory=dict)
    stop: Stop | None = None
    unanswered: str = ""

    @property
    def left(self) -> int:
        """Samples that have no final record."""
        return self.samples - self.settled


def check_ready(plan: RunPlan) -> None:
    """Raise SpecError naming every model whose key or address is not set."""
    problems: list[Problem] = []
    for config in (*plan.models, *filter(None, [plan.extractor])):
        where, status = f"model {config.name}", api_key_status(config)
        if status.fault:
            problems.append(Problem(where, status.fault, "", config.id))
        if (unknown := provider_problem(config, where)) is not None:
            problems.append(unknown)
        elif status.is_needed and not status.is_set:
            names = " or ".join(status.variables)
            hint = f"set {names} in the environment, or leave the model out with --models"
            message = "needs an API key, and none is set"
            problems.append(Problem(where, message, "", config.id, hint=hint))
    if problems:
        raise SpecError(problems)


class Session:
    """Runs one plan in one folder: an async context manager that holds cache, limits, models and
    store, closed whatever happens.

    It asks every model about every sample that has no final record yet; `settled` sums up those
    that had one from the start, by sample.
    """

    def __init__(
        self,
        plan: RunPlan,
        folder: Path,
        watch: Watcher,
        *,
        use_cache: bool,
        retry_failed: bool = False,
        present: Mapping[str, Model] | None = None,
    ) -> None:
        """`retry_failed` asks again also where a request was rejected for good; `present` are
        models that are there already, by name; others are built.
        """
        self._plan = plan
        self._folder = folder
        self._watch = watch
        self._use_cache = use_cache
        self._retry_failed = retry_failed
        self._models = dict(present or {})
        self._cancellation = Cancellation()
        self._extractor: Extractor | None = None
        self._is_over = False
        self._failure: Exception | None = None
        self.settled: Mapping[str, Summary] = {}
        self.result = RunResult(plan.samples_per_model * len(plan.models))

    async def __aenter__(self) -> Session:
        plan = self._plan
        async with AsyncExitStack() as stack:
            stack.callback(plan.close)
            samples = plan.sample_ids()
            self._store = store = stack.enter_context(
                RunStore(self._folder, plan.manifest, samples)
            )
            known = store.standing.samples
            self.settled = {
                sample: summary
                for sample, summary in known.items()
                if sample in samples
                if (summary.is_answered if self._retry_failed else summary.is_final)
            }
            self.result.failed = sum(not one.is_answered for one in self.settled.values())
            self.result.unjudged = sum(not one.is_judged for one in self.settled.values())
            self.result.unanswered = store.standing.unanswered_text
            self._records = RecordWriter(store.records)
            await self._open_models(stack, store)
            self._open = stack.pop_all()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self._open.aclose()

    async def _open_models(self, stack: AsyncExitStack, store: RunStore) -> None:
        """Build the models that are not present; SpecError for one with a batch under way that is
        asked singly now.
        """
        plan, standing, limits = self._plan, store.standing, self._plan.suite.limits
        waiting = under_way(standing.batches)
        message = "has a batch under way, whose questions would be asked twice"
        hint = f"let it end with batch: true, or remove its lines from {BATCHES} to give it up"
        if problems := [
            Problem(f"model {model.name}", message, "batch", waiting[model.name], hint=hint)
            for model in plan.models
            if model.name in waiting and not model.batch
        ]:
            raise SpecError(problems)

        def tell(text: str) -> None:
            self._watch(RunNotice(text))

        cache: ReplyCache | None = None
        asks = any(model.kind == "litellm" for model in plan.models)
        if self._use_cache and (asks or plan.extractor):
            cache = ReplyCache(reply_cache_file(), tell)
            stack.callback(cache.close)
        writer = RecordWriter(store.batches)
        stack.push_async_callback(writer.drain)
        batches = BatchFiles(tuple(standing.batches), writer.put, self._folder, limits.batch_poll_s)
        calls = RecordWriter(store.calls)
        stack.push_async_callback(calls.drain)
        journal = CallJournal(calls, plan.manifest.run, standing)
        build = partial(
            build_model,
            cache=cache,
            overall=asyncio.Semaphore(limits.max_concurrency),
            budget=Budget(limits.max_cost_usd, standing.limit_usd),
            journal=journal,
            observer=self._watch,
            tell=tell,
            policy=RetryPolicy(
                limits.max_attempts, limits.retry_for_s, limits.max_connection_failures
            ),
        )
        for planned in plan.models:
            present = self._models.get(planned.name)
            self._models[planned.name] = (
                build(planned, batches=batches if planned.batch else None)
                if present is None
                else Journaled(present, planned, journal)
            )
            stack.push_async_callback(self._models[planned.name].aclose)
        if plan.extractor is not None:
            extracting = build(plan.extractor)
            stack.push_async_callback(extracting.aclose)
            self._extractor = Extractor(extracting, plan.extractor)

    @property
    def stopping(self) -> bool:
        """True if no new sample is started."""
        return self.result.stop is not None

    def interrupt(self) -> None:
        """Send nothing more; safe to call from a signal handler in the loop's thread."""
        self._stop(Stop(Cause.INTERRUPTED, "interrupted"))

    async def run(self) -> RunResult:
        """Ask what earlier records have not settled.

        Raises the first error that a sample met and that is neither its own nor its model's, once
        calls under way have ended. Where this is cancelled, they are given up.
        """
        names = [model.name for model in self._plan.models]
        settled = self.settled.values()
        earlier = {name: tuple(one for one in settled if one.model == name) for name in names}
        self._watch(RunStarted(dict.fromkeys(names, self._plan.samples_per_model), earlier))
        if self.result.unanswered:
            self._watch(RunNotice(self.result.unanswered))
        try:
            await self._run()
        except BaseException:
            # Where the disk is full, what ended the run comes first.
            with contextlib.suppress(StoreError):
                self._note_stopped(names)
            raise
        self._note_stopped(names)
        return self.result

    def _note_stopped(self, names: list[str]) -> None:
        result = self.result
        reason = result.stop.reason if result.stop and result.left else ""
        self._store.note_stopped(result.stopped, reason, names)

    async def _run(self) -> None:
        workers: list[asyncio.Task[None]] = []
        for planned in self._plan.models:
            samples = self._plan.samples(planned.name)
            queue = deque(sample for sample in samples if sample.id not in self.settled)
            self.result.settled += self._plan.samples_per_model - len(queue)
            model = self._models[planned.name]
            if isinstance(model, GatheringModel):
                workers.append(asyncio.create_task(self._in_rounds(planned, model, queue)))
            else:
                count = min(planned.max_concurrency, len(queue))
                workers += [asyncio.create_task(self._work(planned, queue)) for _ in range(count)]
        try:
            # One worker's error must not end the others: they wait for what is paid for.
            ended = await asyncio.gather(*workers, return_exceptions=True)
        finally:
            _, is_cancelled = await to_its_end(self._end(workers))
            if is_cancelled:
                raise asyncio.CancelledError
        for error in (self._failure, *ended):
            if error is not None:
                raise error
        self._store.records.check()

    async def _end(self, workers: list[asyncio.Task[None]]) -> None:
        """Give up what is still under way, and wait until what was answered is on disk."""
        self._is_over = True
        for _ in range(2):
            # Once, and a call that is under way still returns its answer.
            for worker in workers:
                worker.cancel()
            await asyncio.sleep(0)
        await asyncio.gather(*workers, return_exceptions=True)
        await self._records.drain()

    async def _work(
        self, planned: ModelConfig, queue: deque[Sample], later: deque[Sample] | None = None
    ) -> None:
        """Ask until the queue is empty; what its model wants to be asked later goes to `later`, or
        without one behind the others.
        """
        while queue and self._goes_on(planned):
            sample = queue.popleft()
            try:
                await self._guarded(planned, self._one(sample, planned))
            except AskLaterError:
                (queue if later is None else later).append(sample)

    async def _in_rounds(
        self, planned: ModelConfig, model: GatheringModel, queue: deque[Sample]
    ) -> None:
        """Ask a model that sends many requests together."""
        width = planned.max_concurrency
        while queue and self._goes_on(planned):
            taken: deque[Sample] = deque()
            later: deque[Sample] = deque()
            await self._guarded(planned, self._gather(planned, model, queue, taken))
            await asyncio.gather(
                *(self._work(planned, taken, later) for _ in range(min(width, len(taken))))
            )
            queue.extendleft(reversed(later))

    async def _gather(
        self,
        planned: ModelConfig,
        model: GatheringModel,
        queue: deque[Sample],
        taken: deque[Sample],
    ) -> None:
        """Have a round's requests sent; those that belong to it are `taken` from the queue."""
        with self._cancellation.scope():
            await model.begin()
        left: deque[Sample] = deque()
        is_full = False

        async def gather() -> None:
            nonlocal is_full
            while queue and not is_full and self._goes_on(planned):
                sample = queue.popleft()
                request = await self._request(sample.shown(), planned, with_messages=True)
                with self._cancellation.scope():
                    known = sample.id in self._store.standing.samples
                    is_taken = await model.gather(request, anew=known)
                is_full = is_full or not is_taken
                (taken if is_taken else left).append(sample)

        width = min(planned.max_concurrency, len(queue))
        await asyncio.gather(*(self._guarded(planned, gather()) for _ in range(width)))
        queue.extendleft(reversed(left))
        if not self._goes_on(planned):
            return
        await self._guarded(planned, model.dispatch())
        if not taken:
            # Where it is the model that takes no more, it says so now.
            await model.begin()
            raise BudgetReachedError("what is left may cost more than is left of max_cost_usd")

    def _goes_on(self, planned: ModelConfig) -> bool:
        is_stopped = self.stopping or planned.name in self.result.stopped
        return not (is_stopped or self._is_over)

    async def _guarded(self, planned: ModelConfig, work: Coroutine[Any, Any, None]) -> None:
        """Do a part of the work on a model; what keeps it from going on stops it, or the run."""
        try:
            await work
        except UnavailableError as error:
            if planned.name not in self.result.stopped:
                self.result.stopped[planned.name] = str(error)
                self._watch(ModelStopped(planned.name, str(error)))
        except BudgetReachedError as error:
            self._stop(Stop(Cause.COST, str(error)))
        except HaltedError:
            return
        except AskLaterError:
            raise
        except Exception as error:
            # A mistake of our own is no reason to lose what others have paid for.
            self._failure = self._failure or error
            self._stop(Stop(Cause.ERROR, "an error that the run cannot go on with"))

    def _stop(self, stop: Stop) -> None:
        if self.result.stop is None:
            self.result.stop = stop
            calls = sum(getattr(model, "under_way", 0) for model in self._models.values())
            self._cancellation.set()
            self._watch(Stopping(stop.reason, calls))

    async def _one(self, sample: Sample, config: ModelConfig) -> None:
        """Ask one sample, judge what came, and wait until its record is on disk."""
        sample, model = sample.shown(), self._models[sample.model]
        if isinstance(sample.track, EpisodeTrack):
            record = await self._play(sample, model, config)
        else:
            record = await self._ask(sample, model, config)
        await self._records.put(record)
        self.result.settled += record.is_final
        self.result.failed += record.is_final and not record.is_answered
        self.result.unjudged += not record.is_judged
        self._watch(SampleDone(record))

    async def _ask(self, sample: Sample, model: Model, config: ModelConfig) -> Record:
        request = await self._request(sample, config, with_messages=model.needs_messages)
        answer = await self._answer(model, request)
        fields = self._fields(sample, answer) | _asked(config, request)
        fields["prompt"] = self._prompt(sample.track, request)
        record, is_cancelled = await to_its_end(self._judged(sample, answer, fields))
        task = asyncio.current_task()
        if is_cancelled and task is not None:
            # It ends at its next wait, which is that for its record.
            task.cancel()
        return record

    async def _request(
        self, sample: Sample, config: ModelConfig, *, with_messages: bool
    ) -> Request:
        """Return the request of a sample that is asked once."""
        track, item = sample.track, sample.item
        assert not isinstance(track, EpisodeTrack), "an episode has many requests"
        with self._cancellation.scope():
            request = await track.request(
                item, sample.seed, config.params, with_messages=with_messages
            )
        return sample.asking(replace(request, track=track.name))

    async def _judged(
        self, sample: Sample, answer: Reply | ModelError | None, fields: Mapping[str, Any]
    ) -> Record:
        track, item = sample.track, sample.item
        assert not isinstance(track, EpisodeTrack)
        text = answer.text if isinstance(answer, Reply) else None
        record = await judged_apart(track, item, text, fields)
        if self._extractor is not None:
            record = await self._extractor.read(track, item, record)
        return record

    async def _play(self, sample: Sample, model: Model, config: ModelConfig) -> Record:
        track, item = sample.track, sample.item
        assert isinstance(track, EpisodeTrack)
        episode = track.start(item, sample.seed, config.params, with_messages=model.needs_messages)
        asked: dict[str, AskedAs] = {}
        turns: list[dict[str, Any]] = []
        failed: ModelError | None = None
        while True:
            with self._cancellation.scope():
                wanted = await episode.request()
            if wanted is None:
                break
            request = sample.asking(wanted)
            asked = _asked(config, request)
            prompt = self._prompt(track, request)
            answer = await self._answer(model, request)
            if not isinstance(answer, Reply):
                failed = answer
                break
            reply = answer.storable()
            turns.append({"n": len(turns) + 1, "reply": reply, "prompt": prompt})
            episode.take(request, reply)
        fields = self._fields(sample, failed) | asked
        if turns:
            fields["reply"] = pooled([turn["reply"] for turn in turns]).storable()
            fields["prompt"] = turns[0]["prompt"]
        both = zip(turns, episode.fields()["turns"], strict=True)
        return judged(fields, item, episode, {"turns": [{**one, **more} for one, more in both]})

    async def _answer(self, model: Model, request: Request) -> Reply | ModelError | None:
        """Return the reply, or the error that is this sample's alone."""
        try:
            with self._cancellation.scope():
                return await model.ask(request)
        except (UnavailableError, BudgetReachedError):
            raise
        except ModelError as error:
            return error

    def _prompt(self, track: AnyTrack, request: Request) -> SentPrompt | None:
        if not request.messages:
            return None
        digest = self._store.prompts.keep(request.messages)
        return about_prompt(request, track.prompt_name, digest)

    def _fields(self, sample: Sample, answer: Reply | ModelError | None) -> dict[str, Any]:
        item = sample.item
        fields = begun(sample.id, sample.track.name, sample.model, item, sample.seed, answer)
        if sample.variant.levels:
            fields["variant"] = dict(sample.variant.levels)
        return {**fields, "run": self._plan.manifest.run, **sample.track.about(item)}


def _asked(config: ModelConfig, request: Request) -> dict[str, AskedAs]:
    """Return how a record says that JSON was asked for; nothing where it was asked of nobody."""
    if request.response_format is None or config.kind != "litellm":
        return {}
    return {"asked": "response_format" if config.sends_format else "prompt"}


class Cancellation:
    """A switch that all calls of a run share; asyncio, one loop."""

    def __init__(self) -> None:
        self._is_set = False
        self._inside: set[asyncio.Task[Any]] = set()

    def set(self) -> None:
        """Cancel what is inside a `scope`, and whatever enters one later."""
        self._is_set = True
        for task in self._inside:
            task.cancel()

    @contextlib.contextmanager
    def scope(self) -> Iterator[None]:
        """Raise HaltedError before or out of what is inside, once the switch is set.

        What comes to its end all the same, as a request that is under way, is kept.
        """
        task = asyncio.current_task()
        assert task is not None
        message = "the run was ended before this request was sent"
        if self._is_set:
            raise HaltedError(message)
        self._inside.add(task)
        try:
            yield
        except asyncio.CancelledError:
            if self._is_set:
                raise HaltedError(message) from None
            raise
        finally:
            self._inside.discard(task)


async def to_its_end(work: Coroutine[Any, Any, _Result]) -> tuple[_Result, bool]:
    """Return the result of work that is done whoever stops waiting for it, and whether the waiting
    task was cancelled meanwhile; raises what it raises.
    """
    task = asyncio.create_task(work)
    is_cancelled = False
    while not task.done():
        try:
            await asyncio.wait([task])
        except asyncio.CancelledError:
            is_cancelled = True
    return task.result(), is_cancelled
