"""Requests, configurations, models and the ways to local servers, for tests of the network seam;
models in batches without a run around them: a list for the disk, and kills.
"""

import asyncio
import re
import threading
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.domain.scene import Block, Candidate, CandidateSet, Scene
from phyblock.errors import BudgetReachedError, ModelError
from phyblock.models.batch import BatchFiles
from phyblock.models.model import ModelEvent, RetryPolicy, build_model
from phyblock.models.request import Image, Message, Model, Request
from phyblock.records.record import BatchLine
from phyblock.tracks.full_planning import PlanSubject
from tests.servers.batches import BatchServer
from tests.servers.chassis import LocalServer
from tests.servers.openai_chat import OpenAIChat
from tests.servers.other_protocols import AnthropicMessages, GeminiGenerate
from tests.workspace import KEY_VARIABLE, until


@dataclass(frozen=True)
class Route:
    """A protocol, the model id that leads to it, the path of its API, and a transport."""

    server: type[LocalServer]
    model_id: str
    path: str
    transport: str

    def config(self, *urls: str, **fields: Any) -> ModelConfig:
        """A model at the server or servers with these addresses, its key in `KEY_VARIABLE`."""
        known: dict[str, Any] = {"id": self.model_id, "transport": self.transport, **fields}
        first, *others = (url + self.path for url in urls)
        base = (first, *others) if others else first
        return ModelConfig(name="m", api_base=base, api_key_env=KEY_VARIABLE, **known)


ROUTES = {
    "direct": Route(OpenAIChat, "openai/m", "/v1", "direct"),
    "openai": Route(OpenAIChat, "openai/m", "/v1", "litellm"),
    "vllm": Route(OpenAIChat, "hosted_vllm/m", "/v1", "litellm"),
    "anthropic": Route(AnthropicMessages, "anthropic/claude-3-7-sonnet-20250219", "", "litellm"),
    "gemini": Route(GeminiGenerate, "gemini/gemini-2.5-flash", "", "litellm"),
}


def with_fields(config: ModelConfig, **fields: Any) -> ModelConfig:
    """The model with other values in fields of its entry."""
    given = config.model_dump(by_alias=True, exclude_unset=True)
    return ModelConfig.model_validate({**given, "name": config.name, **fields})


PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff\xe0"
QUICK = RetryPolicy(retry_for_s=0.0, base_s=0.001, max_wait_s=0.002, max_retry_after_s=0.002)
"""The default number of attempts with next to no wait between them, however little time it took."""

BLOCKS = (
    Block(1, "cube", "red", (0.0, 0.0, 0.025), (0.0, 0.0, 0.0), (), 1),
    Block(2, "arch", "red", (0.0, 0.0, 0.075), (0.0, 0.0, 90.0), (1,), 2),
    Block(3, "cube", "blue", (0.0, 0.1, 0.025), (0.0, 0.0, 0.0), (), 1),
)
SCENE = Scene("000", (2,), BLOCKS, ("000",))
CANDIDATES = CandidateSet(
    (
        Candidate("arch", "red", (0.0, 0.0, 0.0)),
        Candidate("cube", "blue", (0.0, 0.0, 0.0)),
        Candidate("arch", "red", (0.0, 0.0, 90.0)),
        Candidate("cube", "red", (0.0, 0.0, 0.0)),
        Candidate("triangle", "orange", (0.0, 0.0, 0.0)),
    )
)


def picture(content: int, magic: bytes = PNG, size: int = 300) -> bytes:
    """Bytes that start like a picture and differ by `content`."""
    return magic + content.to_bytes(4, "big") * (size // 4)


def make_request(
    key: str = "000", seed: int = 0, *, pictures: Sequence[bytes] | None = None, **params: object
) -> Request:
    """A system part, and a user part of text, picture, text, picture, text."""
    number = int.from_bytes(key.encode(), "big") % 2**31
    goal, candidates = pictures or (picture(number), picture(number + 1))
    user: tuple[str | Image, ...] = (
        "The goal:",
        Image(goal, "goal", 640, 480),
        "The candidates, numbered:",
        Image(candidates, "candidates", 800, 800),
        f"Scene {key}: which blocks, in which order?",
    )
    messages = (Message("system", ("You assemble blocks.",)), Message("user", user))
    given = {"temperature": 0.5, "top_p": 0.9, "max_tokens": 128, **params}
    subject = PlanSubject(SCENE, CANDIDATES)
    named = {"track": "full_planning", "sample": key}
    return Request(key, seed, messages, given, "prompt-1", subject, **named)


def requests_of(count: int) -> list[Request]:
    """So many requests, each about another sample."""
    return [make_request(f"{n:03}") for n in range(count)]


def make_model(
    config: ModelConfig, *, events: list[ModelEvent] | None = None, **options: Any
) -> Model:
    """A model with quick retries and no cache; its events go into the list."""
    report = (events if events is not None else []).append
    return build_model(config, **{"cache": None, "policy": QUICK, "report": report} | options)


async def answers(model: Model, *requests: Request) -> list[Any]:
    """Ask all at once and close the model; errors and what stops it stand among the replies."""

    async def one(request: Request) -> Any:
        try:
            return await model.ask(request)
        except (ModelError, BudgetReachedError) as error:
            return error

    try:
        return await asyncio.gather(*map(one, requests))
    finally:
        await model.aclose()


def ask(model: Model, *requests: Request) -> list[Any]:
    return asyncio.run(answers(model, *requests))


POLL_S = 0.01


@dataclass
class Disk:
    """The remains of a killed process: lines about batches, and a folder."""

    folder: Path
    lines: list[BatchLine] = field(default_factory=list)
    moment: Callable[[str], Any] | None = None

    async def put(self, line: BatchLine) -> None:
        """Write a line; a moment lies before and after it."""
        if self.moment is not None:
            await self.moment(f"before {line.event}")
        # As it is read again.
        self.lines.append(BatchLine.model_validate_json(line.as_json()))
        if self.moment is not None:
            await self.moment(f"after {line.event}")


async def command(
    config: ModelConfig,
    disk: Disk,
    requests: Sequence[Request],
    recorded: Sequence[Request] = (),
    **options: Any,
) -> list[Any]:
    """Ask all at once, as one command does."""
    known = {one.sample for one in recorded}
    files = BatchFiles(tuple(disk.lines), disk.put, disk.folder, POLL_S, known, len(requests))
    ended = await answers(make_model(config, batches=files, **options), *requests)
    # Or others would wait for it.
    assert options.get("budget") is None or not options["budget"].holds
    return ended


def run_command(*args: Any, **options: Any) -> list[Any]:
    return asyncio.run(command(*args, **options))


def look_up(server: BatchServer, lines: list[BatchLine], error: str) -> list[BatchLine]:
    """Return the lines as a person changes them later, whom the error of a batch tells how."""
    until(lambda: not server.under_way)
    found = re.search(r"\{.*?\}", error)
    assert found is not None, error
    line = BatchLine.model_validate_json(found[0])
    if (batch_id := server.id_of(line.batch)) is None:
        return [one for one in lines if one.batch != line.batch]
    return [*lines, line.model_copy(update={"id": batch_id})]


class Killing:
    """Kills a command at one of its moments: nothing of it goes on from there."""

    def __init__(self, at: int) -> None:
        self.at = at
        self.names: list[str] = []
        self._killed, self._over = asyncio.Event(), threading.Event()

    def run(self, disk: Disk, server: BatchServer, work: Coroutine[Any, Any, Any]) -> bool:
        """True if the work came to its end."""
        disk.moment, server.moment = self._here, self._there
        try:
            return asyncio.run(self._run(work))
        finally:
            disk.moment, server.moment = None, lambda _: None

    async def _run(self, work: Coroutine[Any, Any, Any]) -> bool:
        self._loop = asyncio.get_running_loop()
        task, killed = asyncio.create_task(work), asyncio.create_task(self._killed.wait())
        await asyncio.wait([task, killed], return_when=asyncio.FIRST_COMPLETED)
        is_over = task.done()
        while others := asyncio.all_tasks() - {asyncio.current_task()}:
            for other in others:
                other.cancel()
            await asyncio.wait(others)
        self._over.set()
        return is_over and not task.cancelled() and task.exception() is None

    def _is_now(self, name: str) -> bool:
        self.names.append(name)
        return len(self.names) == self.at + 1

    async def _here(self, name: str) -> None:
        """A moment on the client's side."""
        if self._is_now(name):
            self._killed.set()
            await asyncio.sleep(60)

    def _there(self, name: str) -> None:
        """A moment on the server's side, which waits until the client is dead."""
        if self._is_now(name):
            self._loop.call_soon_threadsafe(self._killed.set)
            self._over.wait(10)
