"""An environment for OpenEnv, its typed client, and the server that holds many sessions.

    uvicorn --factory phyblock.integrations.openenv:app --port 8000

`PHYBLOCK_TASKS` has the arguments of `phyblock.tasks` as JSON; `openenv_space` has a Dockerfile.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterator
from typing import Any

from openenv.core import EnvClient
from openenv.core.client_types import StepResult
from openenv.core.env_server.http_server import create_app
from openenv.core.env_server.interfaces import Environment
from openenv.core.env_server.types import Action, Observation, State

from phyblock.api import Episode, Task, Tasks, tasks
from phyblock.errors import Problem, SpecError


class PhyBlockAction(Action):
    """The text of a model's reply."""

    text: str


class PhyBlockObservation(Observation):
    """The messages to reply to, in OpenAI's form; at the end none, and the score."""

    key: str
    messages: tuple[dict[str, Any], ...] = ()
    score: dict[str, Any] | None = None


class PhyBlockEnvironment(Environment[PhyBlockAction, PhyBlockObservation, State]):
    """A task per episode; rewards sum to its score. Environments share `places` to take turns."""

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self, known: Tasks, places: Iterator[int] | None = None) -> None:
        super().__init__()
        self._known, self._places, self._state = known, places or itertools.count(), State()
        self._task: Task | None = None
        self._episode: Episode | None = None

    def reset(
        self,
        seed: int | None = None,
        episode_id: str | None = None,
        key: str | None = None,
        **_: Any,
    ) -> PhyBlockObservation:
        """Begin a task: that of a key, that at the seed's place, else the next in turn.

        In a finite set, places wrap around; in a stream, the task at a place is made on demand.
        """
        if key is not None:
            self._task = self._known[key]
        else:
            place = next(self._places) if seed is None else seed
            self._task = self._known[place if self._known.is_endless else place % len(self._known)]
        self._state = State(episode_id=episode_id)
        self._episode = self._task.episode() if self._task.plays else None
        first = self._episode.messages if self._episode else self._task.messages()
        return PhyBlockObservation(key=self._task.key, messages=tuple(first))

    def step(self, action: PhyBlockAction, *_: Any, **__: Any) -> PhyBlockObservation:
        """Take a step with a reply. Raises RuntimeError before a reset and after the end."""
        if self._task is None:
            raise RuntimeError("reset() begins a task")
        self._state.step_count += 1
        seen: dict[str, Any] = {"key": self._task.key}
        if self._episode is not None:
            turn, score = self._episode.step(action.text), self._episode.score()
            seen |= {"messages": turn.messages, "reward": turn.reward, "done": turn.done}
        else:
            score = self._task.score(action.text)
            seen |= {"reward": score.value, "done": True}
        if seen["done"]:
            self._task, seen["score"] = None, score.as_json()
        return PhyBlockObservation(**seen)

    @property
    def state(self) -> State:
        """The number of steps."""
        return self._state


class PhyBlockClient(EnvClient[PhyBlockAction, PhyBlockObservation, State]):
    """A client of the server, asynchronous or with `.sync()`."""

    def _step_payload(self, action: PhyBlockAction) -> dict[str, Any]:
        return {"text": action.text}

    def _parse_result(self, payload: dict[str, Any]) -> StepResult[PhyBlockObservation]:
        ends = {"reward": payload.get("reward"), "done": payload.get("done", False)}
        seen = PhyBlockObservation(**{**payload["observation"], **ends})
        return StepResult(observation=seen, **ends)

    def _parse_state(self, payload: dict[str, Any]) -> State:
        return State(**payload)


def tasks_of_environment() -> Tasks:
    """Return the tasks of `PHYBLOCK_TASKS`. Raises SpecError if it is not valid."""
    text = os.environ.get("PHYBLOCK_TASKS", '{"track": "full_planning"}')
    try:
        given = dict(json.loads(text))
        track, overrides = given.pop("track"), given.pop("overrides", ())
    except (ValueError, TypeError, KeyError):
        allowed = 'a JSON object: {"track": "full_planning", ...}'
        raise SpecError(Problem("PHYBLOCK_TASKS", "names no track", "", text, allowed)) from None
    return tasks(track, *overrides, **given)


def app() -> Any:
    """Return the server; its sessions share the tasks and their order."""
    known, places = tasks_of_environment(), itertools.count()
    return create_app(
        lambda: PhyBlockEnvironment(known, places),
        PhyBlockAction,
        PhyBlockObservation,
        env_name="phyblock",
        max_concurrent_envs=64,
    )
