"""A plan opened in a folder: cache, limits, models and store, closed whatever happens."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import TracebackType

from phyblock.errors import Problem, SpecError, StoreError
from phyblock.models import (
    BatchFiles,
    Budget,
    Model,
    ModelEvent,
    ReplyCache,
    RetryPolicy,
    api_key_status,
    build_model,
    under_way,
)
from phyblock.records.files import BATCHES
from phyblock.resources import reply_cache_file
from phyblock.run.events import ModelNotice, RunNotice, RunStarted, Watcher
from phyblock.run.execute import Executor, RunResult
from phyblock.run.extraction import Extractor
from phyblock.run.halt import Halt
from phyblock.run.models import provider_problem
from phyblock.run.plan import RunPlan
from phyblock.run.store import RecordWriter, RunStore

__all__ = ["Session", "check_ready"]


def check_ready(plan: RunPlan) -> None:
    """Raise SpecError naming every model whose key or address is not set."""
    problems: list[Problem] = []
    configs = [*(model.config for model in plan.models), *filter(None, [plan.extractor])]
    for config in configs:
        status = api_key_status(config)
        if status.fault:
            problems.append(Problem(f"model {config.name}", status.fault, "", config.id))
        if (unknown := provider_problem(config, f"model {config.name}")) is not None:
            problems.append(unknown)
        elif status.is_needed and not status.is_set:
            message = "needs an API key, and none is set"
            names = " or ".join(status.variables)
            hint = f"set {names} in the environment, or leave the model out with --models"
            problems.append(Problem(f"model {config.name}", message, "", config.id, hint=hint))
    if problems:
        raise SpecError(problems)


class Session:
    """Runs one plan in one folder; an async context manager."""

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
        """`present` are models that are there already, by name; others are built."""
        self._present = present or {}
        self._retry_failed = retry_failed
        self._plan = plan
        self._folder = folder
        self._watch = watch
        self._use_cache = use_cache
        self._cache: ReplyCache | None = None
        self._store: RunStore | None = None
        self._batch_writer: RecordWriter | None = None
        self._models: dict[str, Model] = {}
        self._extracting: Model | None = None
        self.executor: Executor

    async def __aenter__(self) -> Session:
        plan = self._plan
        try:
            self._store = RunStore(self._folder, plan.manifest, plan.sample_ids())
            self._check_batches(self._store)
            asks = any(m.config.kind == "litellm" for m in plan.models) or plan.extractor
            if self._use_cache and asks:
                self._cache = ReplyCache(reply_cache_file(), self._tell)
            limits = plan.suite.limits
            overall = asyncio.Semaphore(limits.max_concurrency)
            halt = Halt()
            standing = self._store.standing
            spent_usd = sum(standing.limit_usd.values())
            budget = Budget(limits.max_cost_usd, spent_usd, standing.limit_usd)
            policy = RetryPolicy(
                limits.max_attempts, limits.retry_for_s, limits.max_connection_failures
            )
            build = partial(
                build_model,
                cache=self._cache,
                overall=overall,
                budget=budget,
                observer=self._notice,
                tell=self._tell,
                policy=policy,
            )
            for model in plan.models:
                if model.name in self._present:
                    self._models[model.name] = self._present[model.name]
                    continue
                batches = self._batches(self._store) if model.config.batch else None
                self._models[model.name] = build(model.config, batches=batches)
            extractor = None
            if plan.extractor is not None:
                self._extracting = build(plan.extractor)
                extractor = Extractor(self._extracting, plan.extractor)
            self.executor = Executor(
                plan,
                self._store,
                self._models,
                self._watch,
                halt,
                retry_failed=self._retry_failed,
                extractor=extractor,
            )
        except BaseException:
            await self._close()
            raise
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self._close()

    async def run(self) -> RunResult:
        """Ask what is left to ask; see `Executor.run`."""
        settled = self.executor.settled.values()
        self._watch(
            RunStarted(
                {model.name: self._plan.samples_per_model for model in self._plan.models},
                {
                    model.name: tuple(s for s in settled if s.model == model.name)
                    for model in self._plan.models
                },
            )
        )
        try:
            result = await self.executor.run()
        except BaseException:
            # Where the disk is full, what ended the run comes first.
            with contextlib.suppress(StoreError):
                self._note_stopped(self.executor.result)
            raise
        self._note_stopped(result)
        return result

    def _note_stopped(self, result: RunResult) -> None:
        reason = result.stop.reason if result.stop and result.left else ""
        assert self._store is not None
        self._store.note_stopped(
            result.stopped, reason, [model.name for model in self._plan.models]
        )

    def _check_batches(self, store: RunStore) -> None:
        """Raise SpecError for models that are asked singly and have a batch under way."""
        waiting = under_way(store.standing.batches)
        message = "has a batch under way, whose questions would be asked twice"
        hint = f"let it end with batch: true, or remove its lines from {BATCHES} to give it up"
        problems = [
            Problem(f"model {model.name}", message, "batch", waiting[model.name], hint=hint)
            for model in self._plan.models
            if model.name in waiting and not model.config.batch
        ]
        if problems:
            raise SpecError(problems)

    def _batches(self, store: RunStore) -> BatchFiles:
        if self._batch_writer is None:
            self._batch_writer = RecordWriter(store.batches)
        poll_s = self._plan.suite.limits.batch_poll_s
        return BatchFiles(
            tuple(store.standing.batches), self._batch_writer.put, self._folder, poll_s
        )

    def _notice(self, event: ModelEvent) -> None:
        notice = ModelNotice(event.model, event.kind, event.message, event.wait_s, event.status)
        self._watch(notice)

    def _tell(self, text: str) -> None:
        self._watch(RunNotice(text))

    async def _close(self) -> None:
        for model in (*self._models.values(), *filter(None, [self._extracting])):
            await model.aclose()
        if self._batch_writer is not None:
            await self._batch_writer.drain()
        self._plan.close()
        if self._cache is not None:
            self._cache.close()
        if self._store is not None:
            self._store.close()
