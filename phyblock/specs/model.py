"""What a person may write about one model in a models file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    JsonValue,
    Tag,
    model_validator,
)

from phyblock.addresses import address_fault
from phyblock.specs.fields import (
    Count,
    Flag,
    MaxTokens,
    Section,
    Temperature,
    TimeoutS,
    TopP,
    Unique,
    UniqueSome,
    refuse,
)
from phyblock.specs.prices import PriceSpec, PriceSpecs
from phyblock.specs.sections import SamplingSpec
from phyblock.types import BATCH_PROVIDERS, ImageDetail, SendMode, TransportName

__all__ = ["ModelSpec"]

Effort = Literal["none", "minimal", "low", "medium", "high", "xhigh", "max"]
GroupName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]

_ID_PATTERN = r"^[A-Za-z0-9_.-]+/\S+$"
_OWNERS = (("gpt", "openai"), ("o1", "openai"), ("o3", "openai"), ("claude", "anthropic"),
           ("gemini", "gemini"), ("qwen-vl", "dashscope"))  # fmt: skip
_OPENAI_DETAILS = ("auto", "low", "high", "original")
_GEMINI_DETAILS = ("low", "medium", "high", "ultra_high")
_DETAILS: Mapping[str, tuple[str, ...]] = {
    "openai": _OPENAI_DETAILS,
    "azure": _OPENAI_DETAILS,
    "gemini": _GEMINI_DETAILS,
    "anthropic": (),
}
"""What providers know of `image_detail`; of all others nothing is known."""
_LARGEST_INTEGER = 2**64 - 1
_WITH_REPLAY = {"groups", "replay", "published", "size_b"}


def _check_id(model_id: str) -> str:
    provider, slash, rest = model_id.partition("/")
    if slash and provider and rest and " " not in model_id:
        return model_id
    owner = next((who for start, who in _OWNERS if model_id.lower().startswith(start)), None)
    own = f", behind a server of your own hosted_vllm/{model_id}" if " " not in model_id else ""
    hint = f"for example openai/gpt-4o-2024-08-06{own}"
    hint = f"did you mean {owner}/{model_id}?" if owner else hint
    raise refuse("is not a litellm id", allowed="provider/model", hint=hint)


def _check_api_base(url: str) -> str:
    fault = address_fault(url)
    if fault is None:
        return url
    raise refuse(
        fault.message,
        allowed="http://... or https://..., without user, password, query and fragment",
        hint=fault.hint,
        hides=fault.may_hold_secret,
    )


Address = Annotated[
    str, AfterValidator(_check_api_base), Field(json_schema_extra={"pattern": "^https?://"})
]
Addresses = Annotated[
    Annotated[Address, Tag("one")] | Annotated[UniqueSome[Address], Tag("list")],
    Discriminator(lambda value: "list" if isinstance(value, list | tuple) else "one"),
]
"""One address, or several of servers that all serve the same model."""

Word = Annotated[str, Field(min_length=1, max_length=4096)]


def _check_concurrency(value: Any) -> Any:
    if isinstance(value, str) and value != "auto":
        allowed = "a whole number of at least 1, or auto"
        raise refuse("is no number of calls", allowed=allowed, words=("auto",))
    return value


Concurrency = Annotated[
    Annotated[Count, Tag("number")] | Annotated[Literal["auto"], Tag("word")],
    Discriminator(lambda value: "word" if isinstance(value, str) else "number"),
    BeforeValidator(_check_concurrency),
]


def _check_finite(body: dict[str, JsonValue]) -> dict[str, JsonValue]:
    stack: list[tuple[tuple[str | int, ...], JsonValue]] = [((), body)]
    while stack:
        path, value = stack.pop()
        if isinstance(value, float) and not math.isfinite(value):
            raise refuse("is not a number that JSON can carry", at=path)
        if isinstance(value, int) and abs(value) > _LARGEST_INTEGER:
            allowed = "whole numbers of 64 bits"
            raise refuse("is larger than servers can read", at=path, allowed=allowed, hides=True)
        if isinstance(value, dict):
            stack.extend(((*path, key), item) for key, item in value.items())
        elif isinstance(value, list):
            stack.extend(((*path, index), item) for index, item in enumerate(value))
    return body


class ModelSpec(Section):
    """One model: where it is and how it is asked.

    Exactly one of `id` and `replay` is given. A sampling parameter that is left out takes the
    suite's value; one that is written as null is not sent (`params` tells the two apart).
    """

    id: (
        Annotated[str, AfterValidator(_check_id), Field(json_schema_extra={"pattern": _ID_PATTERN})]
        | None
    ) = Field(default=None, description="litellm id with its provider: openai/gpt-4o-2024-08-06.")
    api_base: Addresses | None = Field(
        default=None,
        description="Address of an OpenAI-compatible server (vLLM, Ollama, LM Studio), such as "
        "http://localhost:8000/v1; a list where several serve the same model. The one with the "
        "least to do is asked, one that is gone is left out and tried again.",
    )
    api_base_file: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="File that lists such addresses, one a line, in place of api_base; relative "
        "to this file, and read again while a run goes on.",
    )
    api_base_command: Annotated[tuple[Word, ...], Field(min_length=1)] | None = Field(
        default=None,
        description="Command that prints such addresses, as a list of its words, in place of "
        "api_base; run without a shell at the start and every 30 s while a run goes on.",
    )
    revision: Annotated[str, Field(min_length=1, max_length=100)] | None = Field(
        default=None,
        description="Which weights answer, where the id does not say it. An address does not tell "
        "models apart: one id on two servers is one model, unless revisions differ.",
    )
    api_key_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = Field(
        default=None,
        description="Name of the environment variable that holds the key, where it is not the "
        "provider's usual one. Never the key itself.",
    )
    transport: TransportName = Field(
        default="auto",
        description="litellm: through the library. direct: straight HTTP, for servers that speak "
        "the OpenAI chat protocol. auto: direct where it can.",
    )
    batch: Flag = Field(
        default=False,
        description="Send requests in the provider's batches (OpenAI and servers with its /files "
        "and /batches, Anthropic, Gemini): slower, by up to a day, and cheaper. How a "
        "model is asked is no part of a run: it may change when the run goes on.",
    )
    max_concurrency: Concurrency | None = Field(
        default=None,
        description="Calls to this model under way at once; null: the suite's limit. auto: as many "
        "as each of its servers answers without getting slow, up to the suite's limit.",
    )
    rpm: Count | None = Field(default=None, description="Requests a minute at most.")
    tpm: Count | None = Field(default=None, description="Tokens a minute at most.")
    temperature: Temperature | None = Field(
        default=None, description="0 to 2. Left out: the suite's; null: not sent."
    )
    top_p: TopP | None = Field(
        default=None, description="Above 0, at most 1. Left out: the suite's; null: not sent."
    )
    max_tokens: MaxTokens | None = Field(
        default=None,
        description="Limit of a reply [tokens]. Left out: the suite's; null: not sent.",
    )
    reasoning_effort: Effort | None = Field(
        default=None, description="How much a reasoning model thinks; null: not sent."
    )
    image_detail: ImageDetail | None = Field(
        default=None,
        description="How closely pictures are looked at: the `detail` of OpenAI and compatible "
        "servers (auto, low, high, original), the media resolution of Gemini (low, medium, high, "
        "ultra_high); null: as the provider does where nothing is said.",
    )
    extra_body: Annotated[dict[str, JsonValue], AfterValidator(_check_finite)] = Field(
        default_factory=dict, description="Further fields of the request body, sent as they are."
    )
    price: PriceSpecs | None = Field(
        default=None,
        description="Price, or a list of prices by the day from which they hold; null: litellm's "
        "price map, or unknown.",
    )
    seed: SendMode = Field(
        default="auto",
        description="auto: seeds are sent until the provider refuses one, then repeats are "
        "independent. always: a refused seed is an error. never: none is sent.",
    )
    response_format: SendMode = Field(
        default="auto",
        description="With answer_format: json_schema in the suite. auto: the schema is sent where "
        "litellm knows the model to take one, and to OpenAI-compatible servers named by api_base. "
        "always, never: whatever is known. The prompt says the form all the same.",
    )
    timeout_s: TimeoutS | None = Field(
        default=None, description="Longest wait for one reply [s]; null: the suite's."
    )
    published: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description="Name of its row in the paper's tables."
    )
    size_b: Annotated[float, Field(strict=True, gt=0, le=1e9, allow_inf_nan=False)] | None = Field(
        default=None, description="Parameters [billions], where known."
    )
    groups: Unique[GroupName] = Field(
        default=(),
        description="Groups that it belongs to: group:NAME in a suite or after --models stands for "
        "all of a group, in the order of this file.",
    )
    replay: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="Folder of recorded replies that stands in for the model (then no id), "
        "relative to this file.",
    )

    @model_validator(mode="after")
    def _check_kind(self) -> ModelSpec:
        if self.replay is None:
            if self.id is None:
                raise refuse(
                    "needs an id (or a replay folder)", hint="for example id: openai/gpt-4o"
                )
            first, *others = self._where_served() or [""]
            if others:
                message = f"says where the model is served, which {first} says too"
                raise refuse(message, at=(others[0],), key=True, hint="keep one of them")
            self._check_direct(self.id)
            self._check_detail(self.id)
            if self.batch:
                self._check_batch(self.id)
            return self
        for key in sorted(self.model_fields_set - _WITH_REPLAY):
            raise refuse(
                "has no meaning for a replay",
                at=(key,),
                key=True,
                allowed=", ".join(sorted(_WITH_REPLAY)),
                hint="keep either id or replay",
            )
        return self

    @property
    def has_address(self) -> bool:
        """Whether it says where the model is served."""
        return bool(self._where_served())

    def _where_served(self) -> list[str]:
        """The fields that say where the model is served."""
        fields = ("api_base", "api_base_file", "api_base_command")
        return [field for field in fields if getattr(self, field) is not None]

    def _check_detail(self, model_id: str) -> None:
        """A word that a provider does not know would be ignored, or refused with every request."""
        known = _DETAILS.get(model_id.partition("/")[0])
        if self.image_detail is None or known is None or self.image_detail in known:
            return
        provider = model_id.partition("/")[0]
        allowed = ", ".join(known) or f"none: {provider} has no such choice"
        raise refuse(f"is not known to {provider}", at=("image_detail",), allowed=allowed)

    def _check_direct(self, model_id: str) -> None:
        """Without an address, a direct call would take the provider's key to OpenAI."""
        provider = model_id.partition("/")[0]
        if self.transport == "direct" and not self.has_address and provider != "openai":
            raise refuse(
                f"needs the address of the server that speaks for {provider}",
                at=("transport",),
                allowed="direct with an api_base, else auto or litellm",
                hint="add api_base, or take the line out",
            )

    def _check_batch(self, model_id: str) -> None:
        """A batch lies at one server, which must be known to speak one of three protocols."""
        provider = model_id.partition("/")[0]
        if provider not in BATCH_PROVIDERS:
            raise refuse(
                f"is not possible: phyblock does not speak the batches of {provider}",
                at=("batch",),
                allowed=", ".join(f"{name}/..." for name in BATCH_PROVIDERS),
                hint="where the provider has the /files and /batches of OpenAI, use openai/... "
                "with its api_base; else take the line out",
            )
        if self.has_address and not isinstance(self.api_base, str):
            raise refuse(
                "is not possible with a list of servers: a batch lies at one",
                at=("batch",),
                hint="give one api_base, or take the line out",
            )

    @property
    def prices(self) -> tuple[PriceSpec, ...]:
        """Its own prices in the order of their days."""
        return (self.price,) if isinstance(self.price, PriceSpec) else self.price or ()

    def params(self, defaults: SamplingSpec) -> dict[str, Any]:
        """Sampling parameters to send, by their OpenAI names: its own, else the suite's."""
        chosen = {
            key: getattr(self if key in self.model_fields_set else defaults, key)
            for key in ("temperature", "top_p", "max_tokens")
        }
        chosen["reasoning_effort"] = self.reasoning_effort
        return {key: value for key, value in chosen.items() if value is not None}
