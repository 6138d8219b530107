"""A plan opened in a folder: cache, limits, models and store, closed whatever happens."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from phyblock.errors import Problem, SpecError
from phyblock.models import (
    Budget,
    Gate,
    Halt,
    Model,
    ModelEvent,
    ReplyCache,
    RetryPolicy,
    api_key_status,
    build_model,
)
from phyblock.resources import reply_cache_file
from phyblock.run.events import ModelNotice, RunStarted, Watcher
from phyblock.run.execute import Executor, RunResult
from phyblock.run.plan import RunPlan
from phyblock.run.store import RunStore

__all__ = ["SERVERS", "Session", "check_ready"]

SERVERS = ("hosted_vllm", "lm_studio", "llamafile")
"""Providers that are nowhere unless `api_base` or their variable says where."""


def check_ready(plan: RunPlan) -> None:
    """Raise SpecError naming every model whose key or address is not set."""
    problems = []
    for model in plan.models:
        if model.config.provider in SERVERS and model.config.api_base is None:
            message = "is behind a server of your own: it needs an address"
            hint = "api_base: http://localhost:8000/v1 in the models file"
            problems.append(
                Problem(f"model {model.name}", message, "api_base", model.config.id, hint=hint)
            )
        status = api_key_status(model.config)
        if status.is_needed and not status.is_set:
            message = "needs an API key, and none is set"
            names = " or ".join(status.variables)
            hint = f"set {names} in the environment, or leave the model out with --models"
            problems.append(Problem(f"model {model.name}", message, "", model.config.id, hint=hint))
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
    ) -> None:
        self._retry_failed = retry_failed
        self._plan = plan
        self._folder = folder
        self._watch = watch
        self._use_cache = use_cache
        self._cache: ReplyCache | None = None
        self._store: RunStore | None = None
        self._models: dict[str, Model] = {}
        self.executor: Executor

    async def __aenter__(self) -> Session:
        plan = self._plan
        try:
            self._store = RunStore(self._folder, plan.manifest, plan.sample_ids())
            if self._use_cache and any(m.config.kind == "litellm" for m in plan.models):
                self._cache = ReplyCache(reply_cache_file())
            limits = plan.suite.limits
            overall = Gate(limits.max_concurrency)
            halt = Halt()
            budget = None
            if limits.max_cost_usd is not None:
                budget = Budget(limits.max_cost_usd, self._store.standing.limit_usd)
            for model in plan.models:
                self._models[model.name] = build_model(
                    model.config,
                    cache=self._cache,
                    overall=overall,
                    budget=budget,
                    observer=self._notice,
                    policy=RetryPolicy(attempts=limits.max_attempts),
                    halt=halt,
                )
            self.executor = Executor(
                plan,
                self._store,
                self._models,
                self._watch,
                halt,
                retry_failed=self._retry_failed,
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
        """Ask what is left to ask; see `Executor.run`.

        Raises StoreError also where all is asked but the cache refused a reply.
        """
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
        result = await self.executor.run()
        if self._cache is not None:
            self._cache.check()
        return result

    def _notice(self, event: ModelEvent) -> None:
        self._watch(ModelNotice(event.model, event.kind, event.message))

    async def _close(self) -> None:
        for model in self._models.values():
            await model.aclose()
        for track in self._plan.tracks:
            track.close()
        for resource in (self._cache, self._store):
            if resource is not None:
                resource.close()
