"""Models files: the models that suites may name, with addresses, prices and groups."""

from __future__ import annotations

import contextlib
import ipaddress
import math
import re
import urllib.parse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    JsonValue,
    PrivateAttr,
    Tag,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from phyblock.config.validation import (
    MOST_HINTS,
    Count,
    Flag,
    MaxTokens,
    ModelName,
    Section,
    Temperature,
    TimeoutS,
    TopP,
    Unique,
    UniqueSome,
    check,
    find_secrets,
    merge_problems,
    refuse,
)
from phyblock.config.yaml import YamlSource, expand, read_yaml, show, sort_problems
from phyblock.errors import Problem, SpecError
from phyblock.registry import baseline_names
from phyblock.types import BATCH_PROVIDERS, ImageDetail, SendMode, TransportName

_LONGEST = 1_000
_EXAMPLE = "for example http://localhost:8000/v1"
_BY_VARIABLE = "put the key alone into an environment variable and name that in api_key_env"


@dataclass(frozen=True)
class AddressFault:
    """Why an address is refused, what to do about it, and whether a secret may stand in it."""

    message: str
    hint: str
    may_hold_secret: bool


def address_fault(url: str) -> AddressFault | None:
    """Why this is no address that a model can be called at; None when it is one."""
    scheme, mark, rest = url.partition("://")
    host = re.split(r"[/?#\\]", rest if mark else url, maxsplit=1)[0]
    if "@" in host:
        return AddressFault("holds a user name or a password", _BY_VARIABLE, may_hold_secret=True)
    if "?" in url or "#" in url:
        message = "holds a query or a fragment, where keys are often written"
        return AddressFault(message, _BY_VARIABLE, may_hold_secret=True)
    if not mark or scheme.lower() not in ("http", "https"):
        message = "is not the address of a server"
    elif len(url) > _LONGEST or "\\" in url or any(not "!" <= c <= "~" for c in rest[len(host) :]):
        message = "is too long, or holds characters that must be escaped in an address"
    elif not _is_host(host):
        message = "names no host, or one that cannot be read"
    else:
        return None
    return AddressFault(message, _EXAMPLE, may_hold_secret="@" in url)


def host_of(url: str) -> str:
    """Host and port alone; "an unreadable address" where there are none."""
    try:
        parts = urllib.parse.urlsplit(url)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        return "an unreadable address"
    if not host:
        return "an unreadable address"
    shown = f"[{host}]" if ":" in host else host
    return shown if port is None else f"{shown}:{port}"


def _is_host(host: str) -> bool:
    """Whether `host` is a name or an IP address, with or without a port."""
    if any(character.isspace() or not character.isprintable() for character in host):
        return False
    try:
        parts = urllib.parse.urlsplit(f"//{host}")
        name = parts.hostname or ""
        if parts.port == 0:
            return False
        if host.startswith("[") or ":" in name:
            return ipaddress.ip_address(name.partition("%")[0]).version == 6
        return len(name.encode("idna")) > 0
    except ValueError:  # UnicodeError, of a label that is empty or too long, is one
        return False


UsdPerMillion = Annotated[float, Field(strict=True, ge=0, le=1e9, allow_inf_nan=False)]


def _read_day(value: object) -> date:
    if isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value):
        with contextlib.suppress(ValueError):
            return date.fromisoformat(value)
    raise refuse("is no day", allowed="a day such as 2026-12-01")


class BatchRateSpec(Section):
    """What tokens cost in the provider's batches."""

    input: UsdPerMillion = Field(description="Prompt tokens [USD per million].")
    output: UsdPerMillion = Field(description="Reply tokens [USD per million].")
    cached: UsdPerMillion | None = Field(
        default=None,
        description="Prompt tokens that the provider has in its cache [USD per million]; null: as "
        "the others.",
    )
    cache_write: UsdPerMillion | None = Field(
        default=None,
        description="Prompt tokens that it puts into its cache [USD per million]; null: as the "
        "others.",
    )


class RateSpec(BatchRateSpec):
    """What tokens cost."""

    batch: BatchRateSpec | None = Field(
        default=None,
        description="What they cost in batches; null: half at OpenAI's, Anthropic's and Google's "
        "own addresses, and at others as outside of batches.",
    )


class TierSpec(RateSpec):
    """What tokens cost in calls with long prompts."""

    above: Count = Field(description="Prompts of more tokens than this.")


def _check_rising(tiers: tuple[TierSpec, ...]) -> tuple[TierSpec, ...]:
    for index, (tier, following) in enumerate(pairwise(tiers), start=1):
        if following.above <= tier.above:
            message, allowed = "is not above the one before it", f"more than {tier.above}"
            raise refuse(message, at=(index, "above"), allowed=allowed)
    return tiers


class PriceSpec(RateSpec):
    """What a model costs, where litellm's price map does not know it or is wrong."""

    since: Annotated[date, BeforeValidator(_read_day)] | None = Field(
        default=None,
        alias="from",
        description="Day from which this holds (UTC). Before the first one that is named, "
        "litellm's price map does.",
    )
    tiers: Annotated[tuple[TierSpec, ...], AfterValidator(_check_rising)] = Field(
        default=(), description="Other prices of calls with long prompts, by rising `above`."
    )
    _place: str = PrivateAttr(default="")

    def __eq__(self, other: object) -> bool:
        # Where a price is written is no part of it.
        return isinstance(other, PriceSpec) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash(tuple(self.__dict__.values()))

    @property
    def place(self) -> str:
        """The file and line that say so, "" where none is known."""
        return self._place

    def stands_at(self, place: str) -> None:
        """Note the file and line that say so."""
        self._place = place


def _check_days(prices: tuple[PriceSpec, ...]) -> tuple[PriceSpec, ...]:
    for index, (price, following) in enumerate(pairwise(prices), start=1):
        if following.since is None:
            message = "does not say from which day on it holds"
            raise refuse(message, at=(index,), hint="add from, for example from: 2026-12-01")
        if price.since is not None and following.since <= price.since:
            message, allowed = "is not later than the one before it", f"a day after {price.since}"
            raise refuse(message, at=(index, "from"), allowed=allowed)
    return prices


PriceSpecs = Annotated[
    Annotated[PriceSpec, Tag("one")]
    | Annotated[
        tuple[PriceSpec, ...], Field(min_length=1), AfterValidator(_check_days), Tag("list")
    ],
    Discriminator(lambda value: "list" if isinstance(value, list | tuple) else "one"),
]
"""One price, or several that follow on one another."""


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


RECORDED = "recorded"
"""The word that stands for every folder of recorded replies."""


class SamplingSpec(Section):
    """Sampling parameters for models that say nothing of their own."""

    temperature: Temperature | None = Field(default=0.0, description="0 to 2; null: not sent.")
    top_p: TopP | None = Field(default=None, description="Above 0, at most 1; null: not sent.")
    max_tokens: MaxTokens | None = Field(
        default=4096, description="Limit of a reply, thinking included [tokens]; null: not sent."
    )


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
    max_concurrency: Count | None = Field(
        default=None,
        description="Calls to this model under way at once; null: the suite's limit.",
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
        return self.api_base is not None

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


GROUP = "group:"
"""What stands before the name of a group where models are named."""
HUMAN = "human:"
"""What stands before the name of a person where models are named."""


def group_names(known: Mapping[str, ModelSpec]) -> tuple[str, ...]:
    """The groups that models belong to, in the order in which the file names them."""
    return tuple(dict.fromkeys(group for spec in known.values() for group in spec.groups))


def with_members(names: Sequence[str], known: Mapping[str, ModelSpec]) -> tuple[str, ...]:
    """The names with the members of a group in its place, each once; an unknown group stays."""
    groups = group_names(known)
    members: dict[str, None] = {}
    for name in names:
        group = name.removeprefix(GROUP)
        if name.startswith(GROUP) and group in groups:
            members |= {n: None for n, spec in known.items() if group in spec.groups}
        else:
            members[name] = None
    return tuple(members)


def unknown_model(name: str) -> str:
    """What is wrong with a name that is neither a model nor a group."""
    if name.startswith(GROUP):
        return "is no group of the models file"
    if name.startswith(HUMAN):
        return "is a person, who answers in `phyblock play`"
    return "is neither in the models file nor a built-in baseline"


_NAME = TypeAdapter(ModelName)


def load_models(path: Path) -> dict[str, ModelSpec]:
    """Read a models file: each name maps to a litellm id or to a mapping.

    Paths of replay folders come out absolute.
    Raises SpecError with all that is wrong.
    """
    source = read_yaml(path)
    data = {} if source.data is None else source.data
    if not isinstance(data, dict):
        wrong = Problem(source.where(()), "has the wrong type", "", show(data),
                        "a mapping: name: provider/model")  # fmt: skip
        raise SpecError([*source.problems, wrong])
    models: dict[str, ModelSpec] = {}
    problems: list[Problem] = []
    for name, entry in data.items():
        hints = max(0, MOST_HINTS - len(problems))
        spec, of_entry = _read_entry(name, entry, source, hints)
        problems += of_entry
        if spec is not None:
            models[name] = spec
    secrets = list(find_secrets(data, source))
    merged = merge_problems(source.problems, secrets, problems)
    if merged:
        raise SpecError(sort_problems(merged))
    return models


def _read_entry(
    name: str, entry: Any, source: YamlSource, hints: int
) -> tuple[ModelSpec | None, list[Problem]]:
    problems = _check_name(name, source)
    if not isinstance(entry, str | dict):
        wrong = Problem(source.where((name,)), "has the wrong type", name, show(entry),
                        "a litellm id (provider/model), or a mapping")  # fmt: skip
        return None, [*problems, wrong]
    spec, of_entry = check(ModelSpec, {"id": entry} if isinstance(entry, str) else entry, source,
                        (name,), hints)  # fmt: skip
    problems += of_entry
    if spec is None:
        return None, problems
    for index, price in enumerate(spec.prices):
        line = source.where((name, "price", index)).split(":")[-2]
        price.stands_at(f"{Path(source.label).name} line {line}")
    if spec.replay is not None:
        try:
            folder = str(expand(spec.replay, Path(source.label).parent))
        except ValueError as error:
            where = source.where((name, "replay"))
            return None, [*problems, Problem(where, str(error), f"{name}.replay", spec.replay)]
        spec = spec.model_copy(update={"replay": folder})
    return spec, problems


def _check_name(name: str, source: YamlSource) -> list[Problem]:
    where = source.where((name,), key=True)
    if name in (*baseline_names(), RECORDED):
        taken = ", ".join((*baseline_names(), RECORDED))
        return [Problem(where, "is a name of phyblock's own", name, allowed=f"not {taken}",
                        hint="choose another name")]  # fmt: skip
    if name.startswith(GROUP):
        message, hint = f"begins with {GROUP}, which names groups", "choose another name"
        return [Problem(where, message, name, show(name), hint=hint)]
    try:
        _NAME.validate_python(name)
    except ValidationError:
        allowed = "up to 80 letters, digits and . _ : + -, starting with a letter or digit"
        return [Problem(where, "is not a usable name", name, show(name), allowed)]
    return []
