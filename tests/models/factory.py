"""Requests, configurations, models and the ways to local servers, for tests of the network seam."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from phyblock.config.models import ModelConfig
from phyblock.domain.scene import Block, Candidate, CandidateSet, Scene
from phyblock.errors import ModelError
from phyblock.models.cache import ReplyCache
from phyblock.models.costs import Budget
from phyblock.models.model import ModelEvent, RetryPolicy, build_model
from phyblock.models.request import Image, Message, Model, Request
from phyblock.records.record import Reply
from phyblock.tracks.full_planning import PlanSubject
from tests.servers.anthropic_messages import AnthropicMessages
from tests.servers.chassis import LocalServer
from tests.servers.gemini_generate import GeminiGenerate
from tests.servers.openai_chat import OpenAIChat

T = TypeVar("T")

KEY_VARIABLE = "PHYBLOCK_TEST_KEY"
KEY = "sk-not-a-real-key-1234"


@dataclass(frozen=True)
class Route:
    """A protocol, the model id that leads to it, the path of its API, and a transport."""

    server: type[LocalServer]
    model_id: str
    path: str
    transport: str

    def config(self, url: str, **fields: Any) -> ModelConfig:
        """A model at the server with this address, its key in `KEY_VARIABLE`."""
        known: dict[str, Any] = {"id": self.model_id, "transport": self.transport, **fields}
        base = url + self.path
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
    return Request(
        key,
        seed,
        messages,
        given,
        "prompt-1",
        PlanSubject(SCENE, CANDIDATES),
        track="full_planning",
    )


def make_model(
    config: ModelConfig,
    *,
    cache: ReplyCache | None = None,
    overall: asyncio.Semaphore | None = None,
    told: list[str] | None = None,
    budget: Budget | None = None,
    events: list[ModelEvent] | None = None,
    policy: RetryPolicy = QUICK,
) -> Model:
    """A model with quick retries; its events go into the list."""
    return build_model(
        config,
        cache=cache,
        overall=overall or asyncio.Semaphore(64),
        budget=budget,
        observer=(events if events is not None else []).append,
        policy=policy,
        report=(told if told is not None else []).append,
    )


def ask(model: Model, *requests: Request) -> list[Reply | ModelError | None]:
    """Ask all at once and close the model; errors of calls stand among the replies."""

    async def one(request: Request) -> Reply | ModelError | None:
        try:
            return await model.ask(request)
        except ModelError as error:
            return error

    async def everything() -> list[Reply | ModelError | None]:
        try:
            return await asyncio.gather(*map(one, requests))
        finally:
            await model.aclose()

    return asyncio.run(everything())


def reply_of(model: Model, request: Request) -> Reply:
    """The reply to one request, which must be one."""
    (answer,) = ask(model, request)
    assert isinstance(answer, Reply), answer
    return answer


def run(main: Callable[[], Coroutine[Any, Any, T]]) -> T:
    """Run a coroutine function in a loop of its own."""
    return asyncio.run(main())
