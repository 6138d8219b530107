"""Models files: how models are called, what they cost, and which groups they belong to."""

from __future__ import annotations

import ipaddress
import math
import os
import re
import urllib.parse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    JsonValue,
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
    check,
    check_unique,
    find_secrets,
    merge_problems,
    refuse,
)
from phyblock.config.yaml import YamlSource, expand, read_yaml, show, sort_problems
from phyblock.errors import Problem, SpecError
from phyblock.registry import baseline_names
from phyblock.types import BATCH_PROVIDERS, ImageDetail, SendMode, TransportName

Kind = Literal["litellm", "replay", "baseline", "human"]
Effort = Literal["none", "minimal", "low", "medium", "high", "xhigh", "max"]

RECORDED = "recorded"
"""The word that stands for every folder of recorded replies."""
GROUP = "group:"
"""The prefix of a group's name where models are named."""
HUMAN = "human:"
"""The prefix of a person's name where models are named."""
DIRECT_PROVIDERS = ("openai", "hosted_vllm", "lm_studio")
"""Provider prefixes that mean the plain OpenAI protocol: litellm has nothing to translate."""
OWN_SERVER = "a server of one's own"
"""Stands for an address where it decides nothing but that it is no provider's."""
LARGEST_REPLY_BYTES = 32 * 1024 * 1024
"""Default limit of a reply's body [bytes]: a hundred times what the longest thoughts take."""

_SELF_HOSTED = ("hosted_vllm", "lm_studio", "llamafile")
"""Providers that are nowhere unless `api_base`, or the variable PROVIDER_API_BASE, says where."""
_RENAMES_PARAMETERS = re.compile(r"o\d|gpt-5")
_OWNERS = (("gpt", "openai"), ("o1", "openai"), ("o3", "openai"), ("claude", "anthropic"),
           ("gemini", "gemini"), ("qwen-vl", "dashscope"))  # fmt: skip
_OPENAI_DETAILS = ("auto", "low", "high", "original")
_DETAILS: Mapping[str, tuple[str, ...]] = {
    "openai": _OPENAI_DETAILS,
    "azure": _OPENAI_DETAILS,
    "gemini": ("low", "medium", "high", "ultra_high"),
    "anthropic": (),
}
"""Values of `image_detail` by provider; of all others nothing is known."""
_WITH_REPLAY = {"name", "groups", "replay", "published", "size_b"}
_OWN_BODY = ("model", "messages", "n", "stream", "max_tokens", "max_completion_tokens")
"""Fields of a request's body that phyblock writes: others in their place would cost unforeseen."""


@dataclass(frozen=True)
class AddressFault:
    """Why an address is refused, a way out, and whether a secret may stand in it."""

    message: str
    hint: str
    may_hold_secret: bool


def address_fault(url: str) -> AddressFault | None:
    """Return why a model cannot be called at this address; None where it can.

    An address stands in run folders, in the reply cache and in messages. So it may hold nothing
    that is worth hiding, and no fault of one is described by showing it.
    """
    scheme, mark, rest = url.partition("://")
    host = re.split(r"[/?#\\]", rest if mark else url, maxsplit=1)[0]
    by_variable = "put the key alone into an environment variable and name that in api_key_env"
    if "@" in host:
        return AddressFault("holds a user name or a password", by_variable, may_hold_secret=True)
    if "?" in url or "#" in url:
        message = "holds a query or a fragment, where keys are often written"
        return AddressFault(message, by_variable, may_hold_secret=True)
    if not mark or scheme.lower() not in ("http", "https"):
        message = "is not the address of a server"
    elif len(url) > 1_000 or "\\" in url or any(not "!" <= c <= "~" for c in rest[len(host) :]):
        message = "is too long, or holds characters that must be escaped in an address"
    elif not _is_host(host):
        message = "names no host, or one that cannot be read"
    else:
        return None
    example = "for example http://localhost:8000/v1"
    return AddressFault(message, example, may_hold_secret="@" in url)


def _is_host(host: str) -> bool:
    """True if `host` is a name or an IP address, with or without a port."""
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


def host_of(url: str) -> str:
    """Return host and port alone; "an unreadable address" where there are none."""
    try:
        parts = urllib.parse.urlsplit(url)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        host, port = "", None
    if not host:
        return "an unreadable address"
    shown = f"[{host}]" if ":" in host else host
    return shown if port is None else f"{shown}:{port}"


UsdPerMillion = Annotated[float, Field(strict=True, ge=0, le=1e9, allow_inf_nan=False)]


def _read_day(value: object) -> date:
    if isinstance(value, date):
        return value
    try:
        if isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value):
            return date.fromisoformat(value)
    except ValueError:
        pass
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


def _check_id(model_id: str) -> str:
    provider, slash, rest = model_id.partition("/")
    if slash and provider and rest and " " not in model_id:
        return model_id
    owner = next((who for start, who in _OWNERS if model_id.lower().startswith(start)), None)
    own = f", behind a server of your own hosted_vllm/{model_id}" if " " not in model_id else ""
    hint = f"for example openai/gpt-4o-2024-08-06{own}"
    hint = f"did you mean {owner}/{model_id}?" if owner else hint
    raise refuse("is not a litellm id", allowed="provider/model", hint=hint)


def _check_address(url: str) -> str:
    fault = address_fault(url)
    if fault is None:
        return url
    allowed = "http://... or https://..., without user, password, query and fragment"
    raise refuse(fault.message, allowed=allowed, hint=fault.hint, hides=fault.may_hold_secret)


def _as_list(value: object) -> object:
    if value == []:
        raise refuse("is empty", allowed="at least one address")
    if value is None or isinstance(value, str):
        return () if value is None else (value,)
    if isinstance(value, list | tuple):
        return value
    raise refuse("has the wrong type", allowed="text, the address of a server, or a list of them")


Address = Annotated[str, AfterValidator(_check_address)]


def _either(schema: dict[str, Any]) -> None:
    """Say in the schema that one address may stand without brackets."""
    one = {"type": "string", "pattern": "^https?://"}
    several = {"type": schema.pop("type"), "items": one, "minItems": 1, "uniqueItems": True}
    schema |= {"anyOf": [one, several, {"type": "null"}]}
    del schema["items"], schema["default"]


def _check_body(body: dict[str, JsonValue]) -> dict[str, JsonValue]:
    for key in body:
        if key in _OWN_BODY:
            hint = "set max_tokens beside extra_body" if "tokens" in key else "take it out"
            raise refuse("is not for extra_body to say", at=(key,), key=True, hint=hint)
    stack: list[tuple[tuple[str | int, ...], JsonValue]] = [((), body)]
    while stack:
        path, value = stack.pop()
        if isinstance(value, float) and not math.isfinite(value):
            raise refuse("is not a number that JSON can carry", at=path)
        if isinstance(value, int) and abs(value) >= 2**64:
            allowed = "whole numbers of 64 bits"
            raise refuse("is larger than servers can read", at=path, allowed=allowed, hides=True)
        if isinstance(value, dict):
            stack.extend(((*path, key), item) for key, item in value.items())
        elif isinstance(value, list):
            stack.extend(((*path, index), item) for index, item in enumerate(value))
    return body


class SamplingSpec(Section):
    """Sampling parameters for models that say nothing of their own."""

    temperature: Temperature | None = Field(default=0.0, description="0 to 2; null: not sent.")
    top_p: TopP | None = Field(default=None, description="Above 0, at most 1; null: not sent.")
    max_tokens: MaxTokens | None = Field(
        default=4096, description="Limit of a reply, thinking included [tokens]; null: not sent."
    )


class ModelConfig(Section):
    """One model: where it is and how it is asked.

    Exactly one of `id` and `replay` is given; a built-in baseline and a person have a name alone.
    A field that is left out takes the suite's value (`with_defaults`); a sampling parameter that is
    null is not sent.
    """

    name: str = Field(default="", exclude=True)
    most_body_bytes: int = Field(default=LARGEST_REPLY_BYTES, exclude=True)
    id: Annotated[
        str,
        AfterValidator(_check_id),
        Field(json_schema_extra={"pattern": r"^[A-Za-z0-9_.-]+/\S+$"}),
    ] = Field(default="", description="litellm id with its provider: openai/gpt-4o-2024-08-06.")
    addresses: Annotated[
        tuple[Address, ...], AfterValidator(check_unique), BeforeValidator(_as_list)
    ] = Field(
        default=(),
        alias="api_base",
        description="Address of an OpenAI-compatible server (vLLM, Ollama, LM Studio), such as "
        "http://localhost:8000/v1; a list where several serve the same model. The one with the "
        "least to do is asked, one that is gone is left out and tried again.",
        json_schema_extra=_either,
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
    max_concurrency: Count = Field(
        default=64, description="Calls to this model under way at once. Left out: the suite's."
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
    extra_body: Annotated[dict[str, JsonValue], AfterValidator(_check_body)] = Field(
        default_factory=dict,
        description=f"Further fields of the request body, sent as they are; not "
        f"{', '.join(_OWN_BODY)}.",
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
    timeout_s: TimeoutS = Field(
        default=300.0,
        description="Longest wait for one reply, to the last of its bytes [s]. Left out: the "
        "suite's.",
    )
    published: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description="Name of its row in the paper's tables."
    )
    size_b: Annotated[float, Field(strict=True, gt=0, le=1e9, allow_inf_nan=False)] | None = Field(
        default=None, description="Parameters [billions], where known."
    )
    groups: Unique[Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]] = Field(
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
    def _check_fields(self) -> Self:
        provider = self.provider
        if self.replay is not None:
            for key in sorted(self.model_fields_set - _WITH_REPLAY):
                allowed = ", ".join(sorted(_WITH_REPLAY - {"name"}))
                at = (type(self).model_fields[key].alias or key,)
                message, hint = "has no meaning for a replay", "keep either id or replay"
                raise refuse(message, at=at, key=True, allowed=allowed, hint=hint)
            return self
        if self.transport == "direct" and not self.has_address and provider != "openai":
            # A direct call would take the provider's key to OpenAI.
            raise refuse(
                f"needs the address of the server that speaks for {provider}",
                at=("transport",),
                allowed="direct with an api_base, else auto or litellm",
                hint="add api_base, or take the line out",
            )
        known = _DETAILS.get(provider)
        if self.image_detail is not None and known is not None and self.image_detail not in known:
            # It would be ignored, or refused with every request.
            allowed = ", ".join(known) or f"none: {provider} has no such choice"
            raise refuse(f"is not known to {provider}", at=("image_detail",), allowed=allowed)
        if self.batch and provider not in BATCH_PROVIDERS:
            raise refuse(
                f"is not possible: phyblock does not speak the batches of {provider}",
                at=("batch",),
                allowed=", ".join(f"{name}/..." for name in BATCH_PROVIDERS),
                hint="where the provider has the /files and /batches of OpenAI, use openai/... "
                "with its api_base; else take the line out",
            )
        if self.batch and len(self.addresses) > 1:
            message = "is not possible with a list of servers: a batch lies at one"
            raise refuse(message, at=("batch",), hint="give one api_base, or take the line out")
        return self

    @property
    def kind(self) -> Kind:
        """How it answers: over the network, from a recording, by a rule, or by hand."""
        if self.replay is not None:
            return "replay"
        if self.id:
            return "litellm"
        return "human" if self.name.startswith(HUMAN) else "baseline"

    @property
    def recording(self) -> Path | None:
        """The folder of recorded replies."""
        return None if self.replay is None else Path(self.replay)

    @property
    def provider(self) -> str:
        """The part of the id before the first slash, "" when there is none."""
        return self.id.partition("/")[0] if "/" in self.id else ""

    @property
    def provider_model(self) -> str:
        """The id without the provider: the model's name as the provider knows it."""
        return self.id.partition("/")[2] if "/" in self.id else self.id

    @property
    def api_base(self) -> str | None:
        """The address where there is one alone."""
        return self.addresses[0] if len(self.addresses) == 1 else None

    @property
    def has_address(self) -> bool:
        """True if it is served elsewhere than at its provider's address."""
        return bool(self.addresses)

    def at(self, address: str | None) -> Self:
        """Return the model as one server serves it; None is its provider's."""
        return self.model_copy(update={"addresses": () if address is None else (address,)})

    @property
    def is_direct(self) -> bool:
        """True if calls go straight to the server instead of through litellm.

        With `auto`: an OpenAI-compatible server that is named by `api_base`, unless the model is
        one of those for which litellm renames parameters.
        """
        if self.transport != "auto":
            return self.transport == "direct"
        return (
            self.has_address
            and self.provider in DIRECT_PROVIDERS
            and _RENAMES_PARAMETERS.match(self.provider_model) is None
        )

    @property
    def sends_format(self) -> bool:
        """True if a request's `response_format` is sent; else the prompt alone says the form."""
        return self.response_format == "always"

    @property
    def params(self) -> dict[str, Any]:
        """Sampling parameters to send, by their OpenAI names."""
        names = ("temperature", "top_p", "max_tokens", "reasoning_effort")
        params = {name: value for name in names if (value := getattr(self, name)) is not None}
        return {**params, "extra_body": self.extra_body} if self.extra_body else params

    @property
    def prices(self) -> tuple[PriceSpec, ...]:
        """Its own prices in the order of their days."""
        return (self.price,) if isinstance(self.price, PriceSpec) else self.price or ()

    def with_defaults(self, values: Mapping[str, Any]) -> Self:
        """Return the model with values for those fields that its entry leaves out."""
        missing = {name: v for name, v in values.items() if name not in self.model_fields_set}
        return self.model_copy(update=missing)

    def identity(self) -> dict[str, object]:
        """Return what changes replies, JSON-able: not the limits, the price, the transport, nor at
        which address a custom server is. That it is no provider's does count, or the replies of a
        stand-in would pass for the provider's. What a model has not is not said.
        """
        identity: dict[str, object] = {
            "kind": self.kind,
            "id": self.id or self.name,
            "api_base": OWN_SERVER if self.has_address else None,
            "params": self.params,
            "sends_seed": self.seed != "never",
            "recording": self.replay,
        }
        if self.revision is not None:
            identity["revision"] = self.revision
        if self.sends_format:
            identity["response_format"] = True
        if self.image_detail is not None:
            identity["image_detail"] = self.image_detail
        return identity


def load_models(path: Path) -> dict[str, ModelConfig]:
    """Read a models file: each name maps to a litellm id or to a mapping.

    Paths of replay folders come out absolute. Raises SpecError with all that is wrong.
    """
    source = read_yaml(path)
    data = {} if source.data is None else source.data
    if not isinstance(data, dict):
        wrong = Problem(source.where(()), "has the wrong type", "", show(data),
                        "a mapping: name: provider/model")  # fmt: skip
        raise SpecError([*source.problems, wrong])
    models: dict[str, ModelConfig] = {}
    problems: list[Problem] = []
    for name, entry in data.items():
        problems += _check_name(name, source)
        config, of_entry = _read_entry(name, entry, source, max(0, MOST_HINTS - len(problems)))
        problems += of_entry
        if config is not None:
            models[name] = config
    secrets = list(find_secrets(data, source))
    merged = merge_problems(source.problems, secrets, problems)
    if merged:
        raise SpecError(sort_problems(merged))
    return models


def _read_entry(
    name: str, entry: Any, source: YamlSource, hints: int
) -> tuple[ModelConfig | None, list[Problem]]:
    if not isinstance(entry, str | dict):
        wrong = Problem(source.where((name,)), "has the wrong type", name, show(entry),
                        "a litellm id (provider/model), or a mapping")  # fmt: skip
        return None, [wrong]
    fields = {"id": entry} if isinstance(entry, str) else entry
    if unknown := [key for key in ("name", "most_body_bytes") if key in fields]:
        where = source.where((name, unknown[0]), key=True)
        return None, [Problem(where, "is not a known key", f"{name}.{unknown[0]}")]
    config, problems = check(ModelConfig, fields, source, (name,), hints)
    if config is None:
        return None, problems
    where = source.where((name,))
    if not config.id and config.replay is None:
        message, hint = "needs an id (or a replay folder)", "for example id: openai/gpt-4o"
        return None, [Problem(where, message, name, show(entry), hint=hint)]
    variable = f"{config.provider.upper()}_API_BASE"
    if config.provider in _SELF_HOSTED and not (config.has_address or os.environ.get(variable)):
        message = "is behind a server of your own: it needs an address"
        hint = f"add api_base: http://localhost:8000/v1, or set {variable}"
        field = f"{name}.id"
        return None, [Problem(source.where((name, "id")), message, field, config.id, hint=hint)]
    if config.replay is None:
        return config.model_copy(update={"name": name}), []
    try:
        replay = str(expand(config.replay, Path(source.label).parent))
    except ValueError as error:
        where = source.where((name, "replay"))
        return None, [Problem(where, str(error), f"{name}.replay", config.replay)]
    return config.model_copy(update={"name": name, "replay": replay}), []


def _check_name(name: str, source: YamlSource) -> list[Problem]:
    where, hint = source.where((name,), key=True), "choose another name"
    own = (*baseline_names(), RECORDED)
    if name in own:
        allowed = f"not {', '.join(own)}"
        return [Problem(where, "is a name of phyblock's own", name, allowed=allowed, hint=hint)]
    for prefix, named in ((GROUP, "groups"), (HUMAN, "people")):
        if name.startswith(prefix):
            message = f"begins with {prefix}, which names {named}"
            return [Problem(where, message, name, show(name), hint=hint)]
    try:
        TypeAdapter(ModelName).validate_python(name)
    except ValidationError:
        allowed = "up to 80 letters, digits and . _ : + -, starting with a letter or digit"
        return [Problem(where, "is not a usable name", name, show(name), allowed)]
    return []


def group_names(known: Mapping[str, ModelConfig]) -> tuple[str, ...]:
    """Return the groups that models belong to, in the order in which the file names them."""
    return tuple(dict.fromkeys(group for config in known.values() for group in config.groups))


def with_members(names: Sequence[str], known: Mapping[str, ModelConfig]) -> tuple[str, ...]:
    """Return the names with the members of a group in its place; an unknown group stays."""
    groups = group_names(known)
    members: dict[str, None] = {}
    for name in names:
        group = name.removeprefix(GROUP)
        if name.startswith(GROUP) and group in groups:
            members |= {n: None for n, config in known.items() if group in config.groups}
        else:
            members[name] = None
    return tuple(members)


def unknown_model(name: str) -> str:
    """Return what is wrong with a name that is neither a model nor a group."""
    if name.startswith(GROUP):
        return "is no group of the models file"
    if name.startswith(HUMAN):
        return "is a person, who answers in `phyblock play`"
    return "is neither in the models file nor a built-in baseline"
