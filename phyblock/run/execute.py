"""Executing a plan: bounded concurrency, every answer on disk before the next is judged.

The executor emits events and prints nothing. It stops cleanly: nothing more is sent, calls that
are under way are waited for, because they are paid for. What was answered is written whatever ends
it, an error of our own or a cancellation.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Coroutine, Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Any

from phyblock.errors import BudgetReachedError, UnavailableError
from phyblock.models import AskLaterError, GatheringModel, HaltedError, Model
from phyblock.run.events import ModelStopped, SampleDone, Stopping, Summary, Watcher
from phyblock.run.extraction import Extractor
from phyblock.run.halt import Halt
from phyblock.run.models import PlannedModel
from phyblock.run.plan import RunPlan
from phyblock.run.samples import Sample, SampleRunner
from phyblock.run.shielded import to_its_end
from phyblock.run.store import RecordWriter, RunStore

__all__ = ["Cause", "Executor", "RunResult", "Stop"]


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
    `stopped` models and why.
    """

    samples: int
    settled: int = 0
    failed: int = 0
    unjudged: int = 0
    stopped: dict[str, str] = field(default_factory=dict)
    stop: Stop | None = None

    @property
    def left(self) -> int:
        """Samples that have no final record."""
        return self.samples - self.settled


class Executor:
    """Asks every model about every sample that has no final record yet.

    `settled` sums up those that had one from the start, by sample.
    """

    def __init__(
        self,
        plan: RunPlan,
        store: RunStore,
        models: Mapping[str, Model],
        watch: Watcher,
        halt: Halt,
        *,
        retry_failed: bool = False,
        extractor: Extractor | None = None,
    ) -> None:
        """`halt` is the switch that ends calls; `retry_failed` asks again also where
        a request was rejected for good; `extractor` is asked what unread replies say.
        """
        planned = plan.sample_ids()
        self.settled: Mapping[str, Summary] = {
            sample: summary
            for sample, summary in store.standing.samples.items()
            if sample in planned
            if (summary.is_answered if retry_failed else summary.is_final)
        }
        self._recorded = store.standing.samples
        self._plan = plan
        self._writer = RecordWriter(store.records)
        self._turns = RecordWriter(store.turns)
        begun = store.begun_turns(self.settled) if plan.has_episodes else {}
        run = plan.manifest.run
        self._samples = SampleRunner(self._turns, store.prompts, halt, begun, run, extractor)
        self._models = models
        self._watch = watch
        self._halt = halt
        self.result = RunResult(plan.samples_per_model * len(plan.models))
        settled = self.settled.values()
        self.result.failed = sum(not summary.is_answered for summary in settled)
        self.result.unjudged = sum(not summary.is_judged for summary in settled)
        self._is_over = False
        self._failure: Exception | None = None

    @property
    def stopping(self) -> bool:
        """True if no new sample is started."""
        return self.result.stop is not None

    def interrupt(self) -> None:
        """Send nothing more; safe to call from a signal handler in the loop's thread."""
        self._stop(Stop(Cause.INTERRUPTED, "interrupted"))

    async def run(self) -> RunResult:
        """Run what earlier records have not settled.

        Raises the first error that a sample met and that is neither its own nor its model's, once
        calls under way have ended. Where this is cancelled, they are given up.
        """
        workers: list[asyncio.Task[None]] = []
        for planned in self._plan.models:
            queue = deque(
                sample
                for sample in self._plan.samples(planned.name)
                if sample.id not in self.settled
            )
            self.result.settled += self._plan.samples_per_model - len(queue)
            model = self._models[planned.name]
            if isinstance(model, GatheringModel):
                workers.append(asyncio.create_task(self._in_rounds(planned, model, queue)))
            else:
                count = min(planned.config.max_concurrency, len(queue))
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
        return self.result

    async def _end(self, workers: list[asyncio.Task[None]]) -> None:
        """Give up what is still under way, and wait until what was answered is on disk."""
        self._is_over = True
        for _ in range(2):
            # Once, and a call that is under way still returns its answer.
            for worker in workers:
                worker.cancel()
            await asyncio.sleep(0)
        await asyncio.gather(*workers, return_exceptions=True)
        await self._writer.drain()
        await self._turns.drain()

    async def _work(
        self, planned: PlannedModel, queue: deque[Sample], later: deque[Sample] | None = None
    ) -> None:
        """Ask until the queue is empty; what its model wants to be asked later goes to `later`, or
        without one behind the others.
        """
        while queue and self._goes_on(planned):
            sample = queue.popleft()
            try:
                await self._guarded(planned, self._one(planned, sample))
            except AskLaterError:
                (queue if later is None else later).append(sample)

    async def _in_rounds(
        self, planned: PlannedModel, model: GatheringModel, queue: deque[Sample]
    ) -> None:
        """Ask a model that sends many requests together."""
        width = planned.config.max_concurrency
        while queue and self._goes_on(planned):
            taken: deque[Sample] = deque()
            later: deque[Sample] = deque()
            gathering = self._gather(planned, model, queue, taken)
            await self._guarded(planned, gathering)
            await asyncio.gather(
                *(self._work(planned, taken, later) for _ in range(min(width, len(taken))))
            )
            queue.extendleft(reversed(later))

    async def _gather(
        self,
        planned: PlannedModel,
        model: GatheringModel,
        queue: deque[Sample],
        taken: deque[Sample],
    ) -> None:
        """Have a round's requests sent; those that belong to it are `taken` from the queue."""
        with self._halt.giving_up():
            await model.begin()
        count = len(queue)
        is_full = False

        async def gather() -> None:
            nonlocal is_full
            while queue and not is_full and self._goes_on(planned):
                sample = queue.popleft()
                request = await self._samples.request(sample, planned.config)
                with self._halt.giving_up():
                    is_taken = await model.gather(request, anew=sample.id in self._recorded)
                is_full = is_full or not is_taken
                (taken if is_taken else left).append(sample)

        left: deque[Sample] = deque()
        width = min(planned.config.max_concurrency, count)
        await asyncio.gather(*(self._guarded(planned, gather()) for _ in range(width)))
        queue.extendleft(reversed(left))
        if not self._goes_on(planned):
            return
        await self._guarded(planned, model.dispatch())
        if not taken:
            # Where it is the model that takes no more, it says so now.
            await model.begin()
            raise BudgetReachedError("what is left may cost more than is left of max_cost_usd")

    def _goes_on(self, planned: PlannedModel) -> bool:
        is_stopped = self.stopping or planned.name in self.result.stopped
        return not (is_stopped or self._is_over)

    async def _guarded(self, planned: PlannedModel, work: Coroutine[Any, Any, None]) -> None:
        """Do a part of the work on a model; what keeps it from going on stops it, or the run."""
        try:
            await work
        except UnavailableError as error:
            self._stop_model(planned.name, str(error))
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
            under_way = sum(getattr(model, "under_way", 0) for model in self._models.values())
            self._halt.set()
            self._watch(Stopping(stop.reason, under_way))

    async def _one(self, planned: PlannedModel, sample: Sample) -> None:
        model = self._models[planned.name]
        record = await self._samples.record(sample, model, planned.config)
        await self._writer.put(record)
        self.result.settled += record.is_final
        self.result.failed += record.is_final and not record.is_answered
        self.result.unjudged += not record.is_judged
        self._watch(SampleDone(record))

    def _stop_model(self, name: str, reason: str) -> None:
        if name not in self.result.stopped:
            self.result.stopped[name] = reason
            self._watch(ModelStopped(name, reason))
