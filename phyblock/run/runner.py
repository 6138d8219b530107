"""A run from its folder to its last record: request, model, judgement, record on disk.

A session emits events and prints nothing. To stop, it sends nothing more and waits for calls in
progress, since they are paid for. Whatever ends it, even a bug, replies that arrived are written.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
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

from phyblock import errors
from phyblock.config.models import ModelConfig
from phyblock.files import reply_cache_file
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.costs import Budget
from phyblock.models.model import ModelEvent, RetryPolicy, build_model
from phyblock.models.request import HaltedError, Model, Request
from phyblock.records.files import BATCHES
from phyblock.records.record import Record, Reply
from phyblock.run.plan import RunPlan, Sample
from phyblock.run.store import Answer, RunStore, Summary, begun, judge_episode, judge_reply
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
class Stopping:
    """The run starts no new samples; it waits for `in_flight` calls."""

    cause: Literal["interrupted", "cost", "error"]
    reason: str
    in_flight: int = 0

    @property
    def text(self) -> str:
        """Message to the person who stopped it: what it waits for, and how to cancel that."""
        if not self.in_flight:
            return (
                f"Stopping: {self.reason}; what is in progress ends first (Ctrl-C again: at once)."
            )
        calls = f"{counted(self.in_flight, 'call')} in progress"
        return f"Stopping: {self.reason}; waiting for {calls} (Ctrl-C again to give them up)."


_INTERRUPTED = Stopping("interrupted", "interrupted")
RunEvent = RunStarted | Summary | ModelEvent | Stopping
"""A summary is emitted when its record was written."""

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

    def add(self, sample: Summary) -> None:
        """Count a sample by its record."""
        self.settled += sample.is_final
        self.failed += sample.is_final and not sample.is_answered
        self.unjudged += not sample.is_judged

    def remarks(self, folder: Path | str) -> list[str]:
        """Return a sentence on each stopped model, and on samples that need attention."""
        remarks = [f"{model} was stopped: {reason}" for model, reason in self.stopped.items()]
        if self.failed:
            rejected = f"{counted(self.failed, 'request')} rejected for good"
            how = "when the cause is fixed, ask again with --retry-failed, retry_failed=True"
            remarks.append(f"{rejected}: {how}")
        if self.unjudged:
            unjudged = f"{counted(self.unjudged, 'answer')} could not be judged"
            remarks.append(f"{unjudged}: phyblock score {folder} tries again, without a call")
        return remarks


@dataclass(eq=False)
class Session:
    """Runs one plan in one folder, once.

    It asks about every sample without a final record, with `retry_failed` also those whose request
    was rejected for good. `present` are models in this process, by name; others are built.
    """

    plan: RunPlan
    folder: Path
    watch: Callable[[RunEvent], None]
    use_cache: bool
    retry_failed: bool = False
    present: Mapping[str, Model] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [model.name for model in self.plan.models]
        self.result = RunResult(self.plan.samples_per_model * len(names))
        self._queues: dict[str, deque[Sample]] = {name: deque() for name in names}
        self._models: dict[str, Model] = {}
        self._waiting: set[asyncio.Task[Any]] = set()
        self._failure: Exception | None = None
        self._whole: tuple[asyncio.AbstractEventLoop, asyncio.Task[Any]] | None = None
        self._interrupts = 0

    def interrupt(self) -> None:
        """Stop sending requests; the second time, give up calls in progress too.

        It may be called at any time, in any thread, and by a signal handler.
        """
        self._interrupts += 1
        if self._whole is not None:
            loop, task = self._whole
            # Only once, since replies must be written; a closed loop has nothing to stop.
            heed = task.cancel if self._interrupts == 2 else self._stop
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(heed)

    async def run(self) -> RunResult:
        """Open the folder, ask all samples without a final record, and close it.

        Raises errors of the folder or of building models and, once calls in progress have ended,
        the first error that concerns neither a sample nor its model. A cancellation gives up calls.
        """
        task = asyncio.current_task()
        assert task is not None
        self._whole = asyncio.get_running_loop(), task
        try:
            async with AsyncExitStack() as stack:
                self._open(stack)
                await asyncio.sleep(0)
                if self._interrupts:
                    self._stop()
                try:
                    await self._ask_all()
                except BaseException:
                    # If the disk is full, the error that ended the run comes first.
                    with contextlib.suppress(errors.StoreError):
                        self._note_stopped()
                    raise
                self._note_stopped()
        except asyncio.CancelledError:
            if self._interrupts < 2:
                raise
        return self.result

    def _open(self, stack: AsyncExitStack) -> None:
        """Open store, cache and models on the stack, queue the samples, and emit the progress."""
        plan, result, limits = self.plan, self.result, self.plan.suite.limits
        stack.callback(plan.close)
        samples = [sample for planned in plan.models for sample in plan.samples(planned)]
        ids = frozenset(sample.id for sample in samples)
        self._store = store = RunStore(self.folder, plan.manifest, ids)
        stack.callback(store.close)
        progress = store.progress
        earlier: dict[str, list[Summary]] = {name: [] for name in self._queues}
        for sample in samples:
            known = progress.samples.get(sample.id)
            if known and (known.is_answered if self.retry_failed else known.is_final):
                earlier[known.model].append(known)
                result.add(known)
            else:
                self._queues[sample.model.name].append(sample)
        most_usd = math.inf if limits.max_cost_usd is None else limits.max_cost_usd
        cache: ReplyCache | None = None
        if self.use_cache and any(model.kind == "litellm" for model in plan.models):
            cache = stack.enter_context(ReplyCache(reply_cache_file(), self._notice))
        for file in (store.batches, store.calls):
            stack.push_async_callback(file.drain)
        build = partial(
            build_model,
            cache=cache,
            overall=asyncio.Semaphore(limits.max_concurrency),
            budget=Budget(most_usd, progress.limit_usd),
            journal=store,
            report=self.watch,
            policy=RetryPolicy(limits.max_attempts, limits.retry_for_s),
        )
        for planned in plan.models:
            present = self.present.get(planned.name)
            model = present or build(planned, batches=self._batch_files(planned))
            self._models[planned.name] = model
            stack.push_async_callback(model.aclose)
        result.unanswered = progress.unanswered_text
        self.watch(RunStarted(plan.samples_per_model, earlier))
        if result.unanswered:
            self._notice(result.unanswered)

    def _batch_files(self, model: ModelConfig) -> BatchFiles | None:
        """Return the files of the batches of a model, if it is asked in batches.

        Raises SpecError if it has a batch in progress, but no longer sets `batch`.
        """
        lines = tuple(self._store.progress.batches)
        if not (model.batch or lines):
            return None
        from phyblock.models.batch import BatchFiles, under_way

        if model.batch:
            poll_s, recorded = self.plan.suite.limits.batch_poll_s, self._store.progress.samples
            put, expected = self._store.batches.put, len(self._queues[model.name])
            return BatchFiles(lines, put, self.folder, poll_s, recorded, expected)
        if waiting := under_way(lines, model.name):
            message = "has a batch in progress, whose questions would be asked twice"
            hint = f"let it end with batch: true, or remove its lines from {BATCHES} to give it up"
            where = f"model {model.name}"
            problem = errors.Problem(where, message, "batch", waiting[0].shown, hint=hint)
            raise errors.SpecError(problem)
        return None

    def _notice(self, text: str) -> None:
        self.watch(ModelEvent("", "notice", text))

    def _note_stopped(self) -> None:
        result = self.result
        reason = result.stop.reason if result.stop and result.left else ""
        self._store.note_stopped(result.stopped, reason, list(self._models))

    async def _ask_all(self) -> None:
        workers: list[asyncio.Task[None]] = []
        for planned in self.plan.models:
            queue, most = self._queues[planned.name], planned.max_concurrency
            if planned.kind in ("baseline", "replay"):
                # Models that answer at once are asked a few at a time, or they would delay calls.
                most = _LOCAL_AT_ONCE
            # All requests of a batch are asked at once.
            count = len(queue) if planned.batch else min(most, len(queue))
            # Batches of a model that is stopped are waited for: only other tasks have its name.
            name = "" if planned.batch else planned.name
            work = (self._work(planned.name) for _ in range(count))
            workers += [asyncio.create_task(one, name=name) for one in work]
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
        for queue in self._queues.values():
            queue.clear()
        for _ in range(2):
            # Only once, so that a call that has its answer still returns it.
            for worker in workers:
                worker.cancel()
            await asyncio.sleep(0)
        await asyncio.gather(*workers, return_exceptions=True)
        await self._store.records.drain()

    async def _work(self, model: str) -> None:
        """Ask, judge and record samples until none is left, or the model or run is stopped."""
        queue = self._queues[model]
        while queue:
            sample = queue.popleft()
            try:
                item = sample.track.shown(sample.item, sample.seed)
                record = await (self._play if sample.track.plays else self._ask)(sample, item)
                summary = Summary.of(record)
                _, is_cancelled = await to_its_end(self._store.records.put(record))
                self.result.add(summary)
                self.watch(summary)
                if is_cancelled:
                    return
            except errors.UnavailableError as error:
                queue.clear()
                if model not in self.result.stopped:
                    self.result.stopped[model] = str(error)
                    self.watch(ModelEvent(model, "stopped", str(error)))
                    for task in self._waiting:
                        # It may wait for another attempt, which would fail too.
                        if task.get_name() == model:
                            task.cancel()
            except errors.BudgetReachedError as error:
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

    def _stop(self, stop: Stopping = _INTERRUPTED) -> None:
        if self.result.stop is None:
            self.result.stop = stop = replace(stop, in_flight=self.under_way)
            for queue in self._queues.values():
                queue.clear()
            for task in self._waiting:
                task.cancel()
            self.watch(stop)

    async def _until_stopped(self, work: Coroutine[Any, Any, _Result]) -> _Result:
        """Return the result of work, which is cancelled when the run or its model is stopped.
        Raises HaltedError then, unless the work completes, as a request in progress does.
        """
        task, message = asyncio.current_task(), "it was stopped before this request was sent"
        assert task is not None
        if self.result.stop is not None or task.get_name() in self.result.stopped:
            work.close()
            raise HaltedError(message)
        self._waiting.add(task)
        try:
            return await work
        except asyncio.CancelledError:
            if self.result.stop is not None or task.get_name() in self.result.stopped:
                raise HaltedError(message) from None
            raise
        finally:
            self._waiting.discard(task)

    async def _ask(self, sample: Sample, item: Item) -> Record:
        track, params = sample.track, sample.model.params
        shows = self._models[sample.model.name].needs_messages
        made = track.request(item, sample.sent_seed, params, with_messages=shows)
        request = await self._until_stopped(made)
        fields = self._fields(sample, item, request, await self._answer(sample, request))
        record, is_cancelled = await to_its_end(judge_reply(track, item, fields))
        task = asyncio.current_task()
        if is_cancelled and task is not None:
            # It ends at its next wait, which is that for its record.
            task.cancel()
        return record

    async def _play(self, sample: Sample, item: Item) -> Record:
        track, params = sample.track, sample.model.params
        shows = self._models[sample.model.name].needs_messages
        episode = track.start(item, sample.sent_seed, params, with_messages=shows)
        replies: list[Reply] = []
        fields = self._fields(sample, item, None, None)
        while (request := await self._until_stopped(episode.request())) is not None:
            answer = await self._answer(sample, request)
            fields = self._fields(sample, item, request, answer)
            if not isinstance(answer, Reply):
                break
            replies.append(answer.storable())
            episode.take(replies[-1], fields["prompt"])
        return judge_episode(track, item, fields, episode, replies)

    async def _answer(self, sample: Sample, request: Request) -> Answer:
        """Return the reply, or an error that concerns only this sample."""
        name, request = sample.model.name, replace(request, sample=sample.id)
        ask = self._models[name].ask
        if name in self.present:
            ask = partial(self._ask_once, sample.model)
        try:
            return await self._until_stopped(ask(request))
        except errors.UnavailableError:
            raise
        except errors.ModelError as error:
            return error

    async def _ask_once(self, model: ModelConfig, request: Request) -> Reply | None:
        """Return the answer of a model in this process, or its answer to an earlier command.

        It cannot be asked again, so its answer is written at once.
        """
        key = reply_key(model, request)
        if (kept := self._store.kept(key)) is not None:
            return kept
        reply = await self.present[model.name].ask(request)
        if reply is not None:
            call = await self._store.sent(model.name, request.sample, key, 0.0)
            await self._store.ended(call, 0.0, reply)
        return reply

    def _fields(
        self, sample: Sample, item: Item, request: Request | None, answer: Answer
    ) -> dict[str, Any]:
        """Return the fields of a record before it is judged."""
        track, model = sample.track, sample.model
        fields = begun(sample.id, track, model.name, item, sample.seed, answer)
        fields["run"] = self._store.run
        if sample.variant.levels:
            fields["variant"] = dict(sample.variant.levels)
        if request is not None and request.messages and track.prompt is not None:
            fields["prompt"] = self._store.keep_prompt(request, track.prompt.name)
        if request is not None and request.response_format and model.kind == "litellm":
            fields["asked"] = "response_format" if model.response_format == "always" else "prompt"
        return fields


async def to_its_end(work: Coroutine[Any, Any, _Result]) -> tuple[_Result, bool]:
    """Return the result of work that no cancellation stops, and True if one was asked for."""
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

    Each of the signals interrupts it; all replies are on disk when this returns. `tick` is called
    several times a second, with True while calls are in progress.
    """
    is_main = threading.current_thread() is threading.main_thread()
    before = {name: signal.getsignal(name) for name in signals if is_main}
    heard = {name: was for name, was in before.items() if was not in (None, signal.SIG_IGN)}
    for name in heard:
        signal.signal(name, lambda *_: session.interrupt())
    try:
        with ThreadPoolExecutor(1) as pool:
            running = pool.submit(asyncio.run, session.run())
            try:
                while not wait((running,), _NAP_S).done:
                    tick(session.under_way > 0)
            except BaseException:
                # A program's handlers of other signals may raise anything.
                session.interrupt()
                raise
        return running.result()
    finally:
        for name, was in heard.items():
            signal.signal(name, was)
