"""An environment for OpenEnv, its typed client, and the server that holds many sessions.

    uvicorn --factory phyblock.integrations.openenv:app --port 8000

`PHYBLOCK_TASKS` holds the arguments of `phyblock.tasks` as JSON. `openenv.yaml` and a Dockerfile
lie beside this module, in `openenv_space`.
"""

from __future__ import annotations

import itertools
import json
import os
from typing import Any

from openenv.core import EnvClient
from openenv.core.client_types import StepResult
from openenv.core.env_server.http_server import create_app
from openenv.core.env_server.interfaces import Environment
from openenv.core.env_server.types import Action, Observation, State

from phyblock.task import Episode, Task, Tasks, tasks

_MOST_SESSIONS = 64


class Reply(Action):
    """The text that a model gave."""

    text: str


class Asked(Observation):
    """The messages that wait for a reply, in OpenAI's form; at the end none, and the score."""

    key: str
    messages: tuple[dict[str, Any], ...] = ()
    score: dict[str, Any] | None = None


class PhyBlockEnvironment(Environment[Reply, Asked, State]):
    """One task an episode: asked once, or played turn by turn. Rewards sum to the score."""

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self, known: Tasks) -> None:
        super().__init__()
        self._known, self._stream, self._state = known, iter(known), State()
        self._task: Task | None = None
        self._episode: Episode | None = None

    def reset(
        self,
        seed: int | None = None,
        episode_id: str | None = None,
        key: str | None = None,
        **_: Any,
    ) -> Asked:
        """Begin a task: that of a key, of the seed's place in a finite set, else the next."""
        if key is not None:
            self._task = self._known[key]
        elif seed is not None and not self._known.is_endless:
            self._task = self._known[seed % len(self._known)]
        else:
            self._stream = itertools.chain(self._stream, iter(self._known))
            self._task = next(self._stream)
        self._state = State(episode_id=episode_id)
        self._episode = self._task.episode() if self._task.plays else None
        first = self._episode.messages if self._episode else self._task.messages()
        return Asked(key=self._task.key, messages=tuple(first))

    def step(self, action: Reply, timeout_s: float | None = None, **_: Any) -> Asked:
        """Take a reply; RuntimeError before a reset and after the end."""
        del timeout_s
        if self._task is None:
            raise RuntimeError("reset() begins a task")
        self._state.step_count += 1
        told: dict[str, Any] = {"key": self._task.key}
        if self._episode is not None:
            turn, score = self._episode.step(action.text), self._episode.score()
            told |= {"messages": turn.messages, "reward": turn.reward, "done": turn.done}
        else:
            score = self._task.score(action.text)
            told |= {"reward": score.value, "done": True}
        if told["done"]:
            self._task, told["score"] = None, score.as_json()
        return Asked(**told)

    @property
    def state(self) -> State:
        """The number of steps."""
        return self._state


class PhyBlockClient(EnvClient[Reply, Asked, State]):
    """A client of the server, asynchronous or with `.sync()`."""

    def _step_payload(self, action: Reply) -> dict[str, Any]:
        return {"text": action.text}

    def _parse_result(self, payload: dict[str, Any]) -> StepResult[Asked]:
        ends = {"reward": payload.get("reward"), "done": payload.get("done", False)}
        return StepResult(observation=Asked(**{**payload["observation"], **ends}), **ends)

    def _parse_state(self, payload: dict[str, Any]) -> State:
        return State(**payload)


def app() -> Any:
    """Return the server; its sessions share the tasks."""
    given = json.loads(os.environ.get("PHYBLOCK_TASKS", '{"track": "full_planning"}'))
    known = tasks(given.pop("track"), *given.pop("overrides", ()), **given)
    return create_app(
        lambda: PhyBlockEnvironment(known),
        Reply,
        Asked,
        env_name="phyblock",
        max_concurrent_envs=_MOST_SESSIONS,
    )
