"""A run from its folder to its last record: request, model, judgement, record on disk.

A session emits events and prints nothing. It stops cleanly: it sends nothing more and waits for
calls in progress, because they are paid for. Replies that have arrived are written whatever ends
it, even an internal error or a cancellation.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Collection, Coroutine, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AsyncExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from phyblock.config.models import ModelConfig
from phyblock.errors import (
    BudgetReachedError,
    ModelError,
    Problem,
    SpecError,
    StoreError,
    UnavailableError,
)
from phyblock.files import reply_cache_file
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.costs import Budget
from phyblock.models.model import ModelEvent, RetryPolicy, build_model
from phyblock.models.request import HaltedError, Model, Request
from phyblock.records.files import BATCHES
from phyblock.records.record import Record, Reply
from phyblock.run.plan import RunPlan, Sample
from phyblock.run.store import RunStore, Summary, begun, judge_episode, judge_reply
from phyblock.text import counted
from phyblock.tracks.base import Item

if TYPE_CHECKING:
    from phyblock.models.batch import BatchFiles


@dataclass(frozen=True)
class RunStarted:
    """Number of samples of a model, and by model the summary of final records on disk."""

    expected: int
    earlier: Mapping[str, Sequence[Summary]]


@dataclass(frozen=True)
class SampleDone:
    """A record was written."""

    record: Record


@dataclass(frozen=True)
class RunNotice:
    """A notice about the whole run, such as a disabled cache."""

    text: str


@dataclass(frozen=True)
class ModelStopped:
    """A model was stopped, because it is not available."""

    model: str
    reason: str


@dataclass(frozen=True)
class Stopping:
    """The run starts no new samples: it was interrupted, its cost limit is reached, or an internal
    error ends it; it waits for `in_flight` calls.
    """

    cause: Literal["interrupted", "cost", "error"]
    reason: str
    in_flight: int = 0

    @property
    def text(self) -> str:
        """Message to the person who stopped it: what it waits for, and how to cancel that."""
        if not self.in_flight:
            return f"Stopping: {self.reason}."
        calls = f"{counted(self.in_flight, 'call')} in progress"
        return f"Stopping: {self.reason}; waiting for {calls} (Ctrl-C again to give them up)."


RunEvent = RunStarted | SampleDone | ModelEvent | RunNotice | ModelStopped | Stopping
Watcher = Callable[[RunEvent], None]


_Result = TypeVar("_Result")
_LOCAL_AT_ONCE = max(8, os.cpu_count() or 1)


@dataclass
class RunResult:
    """The result of a run: numbers of samples with a final record, of requests rejected for good
    and of replies that could not be judged among them; `stopped` models with the reason;
    `unanswered`, a sentence on calls that may have been billed without a reply.
    """

    samples: int
    settled: int = 0
    failed: int = 0
    unjudged: int = 0
    stopped: dict[str, str] = field(default_factory=dict)
    stop: Stopping | None = None
    unanswered: str = ""

    @property
    def left(self) -> int:
        """Number of samples without a final record."""
        return self.samples - self.settled

    def add(self, sample: Record | Summary) -> None:
        """Count a sample by its record."""
        self.settled += sample.is_final
        self.failed += sample.is_final and not sample.is_answered
        self.unjudged += not sample.is_judged


@dataclass(eq=False)
class Session:
    """Runs one plan in one folder, once.

    It asks every model about every sample without a final record; with `retry_failed` also samples
    whose request was rejected for good. `present` are models in this process, by name; others are
    built. `interrupt` may be called at any time, even before `run`.
    """

    plan: RunPlan
    folder: Path
    watch: Watcher
    use_cache: bool
    retry_failed: bool = False
    present: Mapping[str, Model] = field(default_factory=dict)
    _models: dict[str, Model] = field(init=False, default_factory=dict)
    _waiting: set[asyncio.Task[Any]] = field(init=False, default_factory=set)
    _is_over: bool = field(init=False, default=False)
    _failure: Exception | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.result = RunResult(self.plan.samples_per_model * len(self.plan.models))

    @property
    def stopping(self) -> bool:
        """True if no new sample is started."""
        return self.result.stop is not None

    def interrupt(self) -> None:
        """Stop sending requests; safe to call from a signal handler in the loop's thread."""
        self._stop(Stopping("interrupted", "interrupted"))

    async def run(self) -> RunResult:
        """Open the folder, ask all samples without a final record, and close it.

        Raises errors of the folder or of building models, and, once calls in progress have ended,
        the first error of a sample that concerns neither the sample nor its model. A cancellation
        gives up calls in progress.
        """
        async with AsyncExitStack() as stack:
            queues = self._open(stack)
            # An interrupt that came meanwhile is handled before any request.
            await asyncio.sleep(0)
            try:
                await self._ask_all(queues)
            except BaseException:
                # If the disk is full, the error that ended the run comes first.
                with contextlib.suppress(StoreError):
                    self._note_stopped()
                raise
            self._note_stopped()
        return self.result

    def _open(self, stack: AsyncExitStack) -> dict[str, deque[Sample]]:
        """Open store, cache and models until the stack is closed, emit the progress of the run,
        and return the remaining samples of each model.
        """
        plan, result = self.plan, self.result
        stack.callback(plan.close)
        samples = {model.name: list(plan.samples(model.name)) for model in plan.models}
        ids = frozenset(sample.id for each in samples.values() for sample in each)
        self._store = store = stack.enter_context(RunStore(self.folder, plan.manifest, ids))
        queues: dict[str, deque[Sample]] = {name: deque() for name in samples}
        earlier: dict[str, list[Summary]] = {name: [] for name in samples}
        for name, queue in queues.items():
            for sample in samples[name]:
                known = store.progress.samples.get(sample.id)
                if known and (known.is_answered if self.retry_failed else known.is_final):
                    earlier[name].append(known)
                    result.add(known)
                else:
                    queue.append(sample)
        self._open_models(stack, queues)
        result.unanswered = store.progress.unanswered_text
        self.watch(RunStarted(plan.samples_per_model, earlier))
        if result.unanswered:
            self.watch(RunNotice(result.unanswered))
        return queues

    def _open_models(self, stack: AsyncExitStack, queues: Mapping[str, deque[Sample]]) -> None:
        """Build the models that are not given as `present`."""
        plan, store, limits = self.plan, self._store, self.plan.suite.limits
        batches: BatchFiles | None = None
        if store.progress.batches or any(model.batch for model in plan.models):
            batches = self._batch_files()

        cache: ReplyCache | None = None
        if self.use_cache and any(model.kind == "litellm" for model in plan.models):
            cache = ReplyCache(reply_cache_file(), lambda text: self.watch(RunNotice(text)))
            stack.callback(cache.close)
        for file in (store.batches, store.calls):
            stack.push_async_callback(file.drain)
        build = partial(
            build_model,
            cache=cache,
            overall=asyncio.Semaphore(limits.max_concurrency),
            budget=Budget(limits.max_cost_usd, sum(store.progress.limit_usd.values())),
            journal=store,
            report=self.watch,
            policy=RetryPolicy(limits.max_attempts, limits.retry_for_s),
        )
        for planned in plan.models:
            if (present := self.present.get(planned.name)) is not None:
                model: Model = _Journaled(present, planned, store)
            else:
                expected = len(queues[planned.name])
                model = build(planned, batches=batches and replace(batches, expected=expected))
            self._models[planned.name] = model
            stack.push_async_callback(model.aclose)

    def _batch_files(self) -> BatchFiles:
        """Return the files of batches. Raises SpecError for a model that has a batch in progress
        but no longer sets `batch`.
        """
        from phyblock.models.batch import BatchFiles, under_way

        lines = tuple(self._store.progress.batches)
        message = "has a batch in progress, whose questions would be asked twice"
        hint = f"let it end with batch: true, or remove its lines from {BATCHES} to give it up"
        if problems := [
            Problem(f"model {model.name}", message, "batch", waiting[0].shown, hint=hint)
            for model in self.plan.models
            if not model.batch and (waiting := under_way(lines, model.name))
        ]:
            raise SpecError(problems)
        poll_s, recorded = self.plan.suite.limits.batch_poll_s, self._store.progress.samples
        return BatchFiles(lines, self._store.batches.put, self.folder, poll_s, frozenset(recorded))

    def _note_stopped(self) -> None:
        result = self.result
        reason = result.stop.reason if result.stop and result.left else ""
        self._store.note_stopped(result.stopped, reason, list(self._models))

    async def _ask_all(self, queues: Mapping[str, deque[Sample]]) -> None:
        workers: list[asyncio.Task[None]] = []
        for planned in self.plan.models:
            queue = queues[planned.name]
            # Models that answer at once are asked a few at a time, or they would delay calls.
            is_local = planned.kind in ("baseline", "replay")
            most = _LOCAL_AT_ONCE if is_local else planned.max_concurrency
            # All requests of a batch are asked at once.
            count = len(queue) if planned.batch else min(most, len(queue))
            workers += [asyncio.create_task(self._work(planned, queue)) for _ in range(count)]
        try:
            # One worker's error must not end the others, whose calls are paid for.
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
        """Give up calls in progress, and wait until all replies are on disk."""
        self._is_over = True
        for _ in range(2):
            # Only once, so that a call that has its answer still returns it.
            for worker in workers:
                worker.cancel()
            await asyncio.sleep(0)
        await asyncio.gather(*workers, return_exceptions=True)
        await self._store.records.drain()

    async def _work(self, planned: ModelConfig, queue: deque[Sample]) -> None:
        """Ask until the queue is empty, or the model or the run is stopped."""
        while queue and not (self.stopping or self._is_over or planned.name in self.result.stopped):
            try:
                await self._one(queue.popleft(), planned)
            except UnavailableError as error:
                if planned.name not in self.result.stopped:
                    self.result.stopped[planned.name] = str(error)
                    self.watch(ModelStopped(planned.name, str(error)))
            except BudgetReachedError as error:
                self._stop(Stopping("cost", str(error)))
            except HaltedError:
                return
            except Exception as error:
                # An internal error must not lose calls that are paid for.
                self._failure = self._failure or error
                self._stop(Stopping("error", "an internal error"))

    @property
    def under_way(self) -> int:
        """Number of calls that were sent and have not ended."""
        return sum(getattr(model, "under_way", 0) for model in self._models.values())

    def _stop(self, stop: Stopping) -> None:
        if self.result.stop is None:
            self.result.stop = stop = replace(stop, in_flight=self.under_way)
            for task in self._waiting:
                task.cancel()
            self.watch(stop)

    async def _until_stopped(self, work: Coroutine[Any, Any, _Result]) -> _Result:
        """Return the result of work, which is cancelled when the run stops. Raises HaltedError
        then, unless the work completes, as a request in progress does.
        """
        task, message = asyncio.current_task(), "the run was ended before this request was sent"
        assert task is not None
        if self.stopping:
            work.close()
            raise HaltedError(message)
        self._waiting.add(task)
        try:
            return await work
        except asyncio.CancelledError:
            if self.stopping:
                raise HaltedError(message) from None
            raise
        finally:
            self._waiting.discard(task)

    async def _one(self, sample: Sample, config: ModelConfig) -> None:
        """Ask one sample, judge the reply, and wait until its record is on disk."""
        item = sample.track.shown(sample.item, sample.seed)
        if sample.track.plays:
            record = await self._play(sample, item, config)
        else:
            record = await self._ask(sample, item, config)
        await self._store.records.put(record)
        self.result.add(record)
        self.watch(SampleDone(record))

    async def _ask(self, sample: Sample, item: Item, config: ModelConfig) -> Record:
        track, model = sample.track, self._models[sample.model]
        shows = model.needs_messages
        made = track.request(item, sample.sent_seed, config.params, with_messages=shows)
        request = replace(await self._until_stopped(made), sample=sample.id)
        answer = await self._answer(model, request)
        fields = self._fields(sample, item, answer, request, config)
        record, is_cancelled = await to_its_end(judge_reply(track, item, fields))
        task = asyncio.current_task()
        if is_cancelled and task is not None:
            # It ends at its next wait, which is that for its record.
            task.cancel()
        return record

    async def _play(self, sample: Sample, item: Item, config: ModelConfig) -> Record:
        track, model = sample.track, self._models[sample.model]
        shows = model.needs_messages
        episode = track.start(item, sample.sent_seed, config.params, with_messages=shows)
        replies: list[Reply] = []
        fields = self._fields(sample, item, None, None, config)
        while (wanted := await self._until_stopped(episode.request())) is not None:
            request = replace(wanted, sample=sample.id)
            answer = await self._answer(model, request)
            fields = self._fields(sample, item, answer, request, config)
            if not isinstance(answer, Reply):
                break
            replies.append(answer.storable())
            episode.take(replies[-1], fields["prompt"])
        return judge_episode(track, item, fields, episode, replies)

    async def _answer(self, model: Model, request: Request) -> Reply | ModelError | None:
        """Return the reply, or an error that concerns only this sample."""
        try:
            return await self._until_stopped(model.ask(request))
        except (UnavailableError, BudgetReachedError):
            raise
        except ModelError as error:
            return error

    def _fields(
        self,
        sample: Sample,
        item: Item,
        answer: Reply | ModelError | None,
        request: Request | None,
        config: ModelConfig,
    ) -> dict[str, Any]:
        """Return the fields of a record before it is judged."""
        track = sample.track
        fields = begun(sample.id, track, sample.model, item, sample.seed, answer)
        fields["run"] = self._store.run
        if sample.variant.levels:
            fields["variant"] = dict(sample.variant.levels)
        if request is not None and request.messages:
            fields["prompt"] = self._store.keep_prompt(request, track.prompt_name)
        if request is not None and request.response_format and config.kind == "litellm":
            fields["asked"] = "response_format" if config.sends_format else "prompt"
        return fields


class _Journaled:
    """A model in this process that cannot be asked again; its answers are written at once."""

    needs_messages = True

    def __init__(self, model: Model, config: ModelConfig, journal: RunStore) -> None:
        self.name = model.name
        self._model = model
        self._config = config
        self._journal = journal

    async def ask(self, request: Request) -> Reply | None:
        """Return the model's answer, or its answer to an earlier command."""
        key = reply_key(self._config, request)
        if (kept := self._journal.kept(key)) is not None:
            return kept
        reply = await self._model.ask(request)
        if reply is not None:
            call = await self._journal.sent(self.name, request.sample, key, 0.0)
            await self._journal.ended(call, 0.0, reply)
        return reply

    async def aclose(self) -> None:
        """Release what the model holds."""
        await self._model.aclose()


async def to_its_end(work: Coroutine[Any, Any, _Result]) -> tuple[_Result, bool]:
    """Return the result of work, which a cancellation does not stop, and whether the waiting task
    was cancelled meanwhile; raises what the work raises.
    """
    task = asyncio.create_task(work)
    is_cancelled = False
    while not task.done():
        try:
            await asyncio.wait([task])
        except asyncio.CancelledError:
            is_cancelled = True
    return task.result(), is_cancelled


_NAP_S = 0.1
"""Longest delay until a signal that the system delivers to another thread is noticed [s]."""


def completed(
    session: Session,
    signals: Collection[signal.Signals] = (signal.SIGINT,),
    tick: Callable[[bool], object] = lambda _: None,
) -> RunResult:
    """Run a session to its end in a separate thread, since a notebook's thread already has a loop.

    After the first signal it sends nothing more, the second gives up calls in progress; all replies
    are on disk when this returns. `tick` is called several times a second, with True while calls
    are in progress.
    """
    loop, stops = asyncio.new_event_loop(), 0
    whole: asyncio.Task[RunResult] | None = None

    async def run() -> RunResult:
        nonlocal whole
        whole = asyncio.current_task()
        try:
            return await session.run()
        except asyncio.CancelledError:
            return session.result

    def in_thread() -> RunResult:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            return runner.run(run())

    def stop(*_: object) -> None:
        nonlocal stops
        stops += 1
        # Only once, since replies must be written; a closed loop has nothing to stop.
        give_up = whole.cancel if stops == 2 and whole is not None else session.interrupt
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(give_up)

    is_main = threading.current_thread() is threading.main_thread()
    before = {name: signal.getsignal(name) for name in signals if is_main}
    heard = {name: was for name, was in before.items() if was not in (None, signal.SIG_IGN)}
    for name in heard:
        signal.signal(name, stop)
    try:
        with ThreadPoolExecutor(1) as pool:
            running = pool.submit(in_thread)
            try:
                while not wait((running,), _NAP_S).done:
                    tick(session.under_way > 0)
            except BaseException:
                # A program's handlers of other signals may raise anything.
                stop()
                raise
        return running.result()
    finally:
        for name, was in heard.items():
            signal.signal(name, was)


def remarks_on(result: RunResult, folder: Path | str) -> list[str]:
    """Return a sentence on each stopped model, and on samples that need attention."""
    remarks = [f"{model} was stopped: {reason}" for model, reason in result.stopped.items()]
    if result.failed:
        rejected = f"{counted(result.failed, 'request')} rejected for good"
        how = "when the cause is fixed, ask again with --retry-failed, retry_failed=True"
        remarks.append(f"{rejected}: {how}")
    if result.unjudged:
        unjudged = f"{counted(result.unjudged, 'answer')} could not be judged"
        remarks.append(f"{unjudged}: phyblock score {folder} tries again, without a call")
    return remarks
