"""Executing a plan: bounded concurrency, every answer on disk before the next is judged.

The executor emits events and prints nothing. It stops cleanly: nothing more is sent, calls that
are under way are waited for, because they are paid for.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from phyblock.errors import BudgetReachedError, PhyblockError, UnavailableError
from phyblock.models import Halt, HaltedError, Model
from phyblock.run.events import ModelStopped, SampleDone, Stopping, Watcher
from phyblock.run.models import PlannedModel
from phyblock.run.plan import RunPlan
from phyblock.run.samples import Sample, SampleRunner
from phyblock.run.standing import Summary
from phyblock.run.store import RunStore
from phyblock.run.writer import RecordWriter

__all__ = ["Executor", "RunResult"]


@dataclass
class RunResult:
    """How a run ended: how many of its samples have a final record, and how many of those are
    requests that were rejected for good; `stopped` models and why.
    """

    samples: int
    settled: int = 0
    failed: int = 0
    stopped: dict[str, str] = field(default_factory=dict)
    reason: str | None = None

    @property
    def left(self) -> int:
        """Samples that have no final record."""
        return self.samples - self.settled


class Executor:
    """Asks every model about every sample that has no final record yet.

    `settled` sums up those that had one from the start, by sample.
    """

    INTERRUPTED = "interrupted"

    def __init__(
        self,
        plan: RunPlan,
        store: RunStore,
        models: Mapping[str, Model],
        watch: Watcher,
        halt: Halt,
        *,
        retry_failed: bool = False,
    ) -> None:
        """`halt` is the switch that `models` were built with; `retry_failed` asks again also where
        a request was rejected for good.
        """
        self.settled: Mapping[str, Summary] = {
            sample: summary
            for sample, summary in store.standing.samples.items()
            if (summary.is_answered if retry_failed else summary.is_final)
        }
        self._plan = plan
        self._writer = RecordWriter(store.records)
        self._turns = RecordWriter(store.turns)
        begun = store.turns_of_others(self.settled) if plan.has_episodes else {}
        run = plan.manifest.run
        self._samples = SampleRunner(self._turns, store.prompts, halt, begun, run)
        self._models = models
        self._watch = watch
        self._halt = halt
        self.result = RunResult(plan.samples_per_model * len(plan.models))
        self.result.failed = sum(not summary.is_answered for summary in self.settled.values())
        self._in_flight = 0
        self._failure: PhyblockError | None = None

    @property
    def stopping(self) -> bool:
        """Whether no new sample is started."""
        return self.result.reason is not None

    def stop(self, reason: str) -> None:
        """Send nothing more; safe to call from a signal handler in the loop's thread."""
        if self.result.reason is None:
            self.result.reason = reason
            self._watch(Stopping(reason, self._in_flight - self._halt.waiting))
            self._halt.set()

    async def run(self) -> RunResult:
        """Run what earlier records have not settled.

        Raises the first StoreError, DataError or PromptError that a sample met, once calls under
        way have ended.
        """
        workers: list[asyncio.Task[None]] = []
        for planned in self._plan.models:
            queue = deque(
                sample
                for sample in self._plan.samples(planned.name)
                if sample.id not in self.settled
            )
            self.result.settled += self._plan.samples_per_model - len(queue)
            count = min(planned.config.max_concurrency, len(queue))
            workers += [asyncio.create_task(self._work(planned, queue)) for _ in range(count)]
        try:
            await asyncio.gather(*workers)
        finally:
            for worker in workers:
                worker.cancel()
            await asyncio.gather(*workers, return_exceptions=True)
            await self._writer.drain()
            await self._turns.drain()
        if self._failure is not None:
            raise self._failure
        return self.result

    async def _work(self, planned: PlannedModel, queue: deque[Sample]) -> None:
        while queue and self.result.reason is None and planned.name not in self.result.stopped:
            sample = queue.popleft()
            self._in_flight += 1
            try:
                await self._one(planned, sample)
            except UnavailableError as error:
                self._stop_model(planned.name, str(error))
            except BudgetReachedError as error:
                self.stop(str(error))
            except HaltedError:
                return
            except PhyblockError as error:
                self._failure = self._failure or error
                self.stop("an error that the run cannot go on with")
            finally:
                self._in_flight -= 1

    async def _one(self, planned: PlannedModel, sample: Sample) -> None:
        model = self._models[planned.name]
        record = await self._samples.record(sample, model, planned.config.params)
        await self._writer.put(record)
        self.result.settled += record.is_final
        self.result.failed += record.is_final and not record.is_answered
        self._watch(SampleDone(record))

    def _stop_model(self, name: str, reason: str) -> None:
        if name not in self.result.stopped:
            self.result.stopped[name] = reason
            self._watch(ModelStopped(name, reason))
