"""Models files: how models are called, what they cost, and which groups they belong to."""

from __future__ import annotations

import ipaddress
import json
import os
import re
import urllib.parse
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    JsonValue,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from phyblock.config.validation import (
    Count,
    Flag,
    ModelName,
    Section,
    Temperature,
    TimeoutS,
    TopP,
    Unique,
    check,
    check_unique,
    joined,
    refuse,
)
from phyblock.config.yaml import YamlSource, expand, read_yaml, show
from phyblock.errors import Problem, SpecError
from phyblock.registry import baseline_names
from phyblock.text import did_you_mean
from phyblock.types import BATCH_PROVIDERS, ImageDetail, SendMode, TransportName

Kind = Literal["litellm", "replay", "baseline", "human"]
Text = Annotated[str, Field(min_length=1)]
UsdPerMillion = Annotated[float, Field(strict=True, ge=0, le=1e9, allow_inf_nan=False)]

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

_SELF_HOSTED = (
    "hosted_vllm", "lm_studio", "llamafile", "custom_openai", "xinference", "litellm_proxy",
)  # fmt: skip
"""Providers that are nowhere unless `api_base`, or the variable PROVIDER_API_BASE, says where:
litellm sends their prompts to api.openai.com otherwise, but for llamafile's."""
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
_OWN_BODY = (
    "model", "messages", "n", "best_of", "stream", "max_tokens", "max_completion_tokens",
)  # fmt: skip
"""Fields of a request's body that phyblock writes, or that multiply what is billed."""


def address_fault(url: str) -> tuple[str, str] | None:
    """Return why a model cannot be called at this address, and a way out; None where it can.

    An address stands in run folders, in the reply cache and in messages. So it may hold nothing
    that is worth hiding, and no fault of one is described by showing it.
    """
    scheme, mark, rest = url.partition("://")
    host = re.split(r"[/?#\\]", rest if mark else url, maxsplit=1)[0]
    hint = "put the key alone into an environment variable and name that in api_key_env"
    if "@" in host:
        return "holds a user name or a password", hint
    if "?" in url or "#" in url:
        return "holds a query or a fragment, where keys are often written", hint
    hint = "for example http://localhost:8000/v1"
    if not mark or scheme.lower() not in ("http", "https"):
        return "is not the address of a server", hint
    if len(url) > 1_000 or "\\" in url or any(not "!" <= c <= "~" for c in rest[len(host) :]):
        return "is too long, or holds characters that must be escaped in an address", hint
    try:
        parts = urllib.parse.urlsplit(f"//{host}")
        name = parts.hostname or ""
        is_host = parts.port != 0 and host.isprintable() and not re.search(r"\s", host)
        if ":" in name or host.startswith("["):
            is_host &= bool(ipaddress.IPv6Address(name.partition("%")[0]))
        else:
            is_host &= bool(name.encode("idna"))
    except ValueError:
        is_host = False
    return None if is_host else ("names no host, or one that cannot be read", hint)


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


def _one_or_list(value: object) -> object:
    if value == []:
        raise refuse("is empty", allowed="at least one")
    return () if value is None else value if isinstance(value, list | tuple) else (value,)


def _say_one_or_list(schema: dict[str, Any]) -> None:
    """Say in a JSON Schema that one item may stand without brackets."""
    several = {key: schema.pop(key) for key in ("type", "items", "uniqueItems") if key in schema}
    schema.pop("default", None)
    schema["anyOf"] = [several["items"], {**several, "minItems": 1}, {"type": "null"}]


class Price(Section):
    """Prices of tokens [USD per million]."""

    input: UsdPerMillion
    """Prompt tokens [USD per million]."""
    output: UsdPerMillion
    """Reply tokens [USD per million]."""
    cached: UsdPerMillion | None = None
    """Prompt tokens that the provider has in its cache [USD per million]; null: as the others."""
    cache_write: UsdPerMillion | None = None
    """Prompt tokens that it puts into its cache [USD per million]; null: as the others."""


class Rate(Price):
    """Prices of tokens."""

    batch: Price | None = None
    """What they cost in batches; null: half at OpenAI's, Anthropic's and Google's own addresses,
    and at others as outside of batches."""


class Tier(Rate):
    """Prices of tokens in calls with long prompts."""

    above: Count
    """Prompts of more tokens than this."""


def _check_rising(tiers: tuple[Tier, ...]) -> tuple[Tier, ...]:
    for index, (tier, following) in enumerate(pairwise(tiers), start=1):
        if following.above <= tier.above:
            message, allowed = "is not above the one before it", f"more than {tier.above}"
            raise refuse(message, at=(index, "above"), allowed=allowed)
    return tiers


class Tariff(Rate):
    """The price of a model, where litellm's price map does not know it or is wrong."""

    tiers: Annotated[tuple[Tier, ...], AfterValidator(_check_rising)] = ()
    """Other prices of calls with long prompts, by rising `above`."""


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
    if (fault := address_fault(url)) is None:
        return url
    allowed = "http://... or https://..., without user, password, query and fragment"
    raise refuse(fault[0], allowed=allowed, hint=fault[1], hides=True)


def _check_body(body: dict[str, JsonValue]) -> dict[str, JsonValue]:
    for key in body:
        if key in _OWN_BODY:
            hint = "set max_tokens beside extra_body" if "tokens" in key else "take it out"
            raise refuse("is not for extra_body to say", at=(key,), key=True, hint=hint)
    try:
        json.dumps(body, allow_nan=False)
    except ValueError:
        raise refuse("holds a number that JSON cannot carry") from None
    return body


class SamplingSpec(Section):
    """Sampling parameters for models that say nothing of their own."""

    temperature: Temperature | None = 0.0
    """0 to 2; null: not sent."""
    top_p: TopP | None = None
    """Above 0, at most 1; null: not sent."""
    max_tokens: Count | None = 4096
    """Limit of a reply, thinking included [tokens]; null: not sent."""


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
    ] = ""
    """litellm id with its provider: openai/gpt-4o-2024-08-06."""
    addresses: Annotated[
        tuple[
            Annotated[
                str,
                AfterValidator(_check_address),
                Field(json_schema_extra={"pattern": "^https?://"}),
            ],
            ...,
        ],
        AfterValidator(check_unique),
        BeforeValidator(_one_or_list),
    ] = Field(default=(), alias="api_base", json_schema_extra=_say_one_or_list)
    """Address of an OpenAI-compatible server (vLLM, Ollama, LM Studio), such as
    http://localhost:8000/v1; a list where several serve the same model. The one with the least to
    do is asked, one that is gone is left out and tried again."""
    revision: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    """Which weights answer, where the id does not say it. An address does not tell models apart:
    one id on two servers is one model, unless revisions differ."""
    api_key_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Name of the environment variable that holds the key, where it is not the provider's usual
    one. Never the key itself."""
    transport: TransportName = "auto"
    """litellm: through the library. direct: straight HTTP, for servers that speak the OpenAI chat
    protocol. auto: direct where it can."""
    batch: Flag = False
    """Send requests in the provider's batches (OpenAI and servers with its /files and /batches,
    Anthropic, Gemini): slower, by up to a day, and cheaper. How a model is asked is no part of a
    run: it may change when the run goes on."""
    max_concurrency: Count = 64
    """Calls to this model under way at once. Left out: the suite's."""
    rpm: Count | None = None
    """Requests a minute at most."""
    tpm: Count | None = None
    """Tokens a minute at most."""
    temperature: Temperature | None = None
    """0 to 2. Left out: the suite's; null: not sent."""
    top_p: TopP | None = None
    """Above 0, at most 1. Left out: the suite's; null: not sent."""
    max_tokens: Count | None = None
    """Limit of a reply [tokens]. Left out: the suite's; null: not sent."""
    reasoning_effort: Literal["none", "minimal", "low", "medium", "high", "xhigh", "max"] | None = (
        None
    )
    """How much a reasoning model thinks; null: not sent."""
    image_detail: ImageDetail | None = None
    """How closely pictures are looked at: the `detail` of OpenAI and compatible servers (auto, low,
    high, original), the media resolution of Gemini (low, medium, high, ultra_high); null: as the
    provider does where nothing is said."""
    extra_body: Annotated[dict[str, JsonValue], AfterValidator(_check_body)] = Field(
        default_factory=dict
    )
    """Further fields of the request body, sent as they are; not model, messages, n, best_of,
    stream, max_tokens, max_completion_tokens."""
    price: Tariff | None = None
    """Price; null: that of litellm's price map, or unknown."""
    max_cost_usd: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] | None = None
    """The model is asked no more before it costs more than this in a run [USD]; null: the run's
    limit alone."""
    seed: SendMode = "auto"
    """auto: seeds are sent until the provider refuses one, then repeats are independent. always: a
    refused seed is an error. never: none is sent."""
    response_format: SendMode = "auto"
    """With answer_format: json_schema in the suite. auto: the schema is sent where litellm knows
    the model to take one, and to OpenAI-compatible servers named by api_base. always, never:
    whatever is known. The prompt says the form all the same."""
    timeout_s: TimeoutS = 300.0
    """Longest wait for one reply, to the last of its bytes [s]. Left out: the suite's."""
    published: Text | None = None
    """Name of its row in the paper's tables."""
    size_b: Annotated[float, Field(strict=True, gt=0, le=1e9, allow_inf_nan=False)] | None = None
    """Parameters [billions], where known."""
    groups: Unique[Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]] = ()
    """Groups that it belongs to: group:NAME in a suite or after --models stands for all of a group,
    in the order of this file."""
    replay: Text | None = None
    """Folder of recorded replies that stands in for the model (then no id), relative to this
    file."""

    @model_validator(mode="after")
    def _check_fields(self) -> Self:
        provider = self.provider
        if self.replay is not None:
            with_replay = ("groups", "published", "replay", "size_b")
            for key in sorted(self.model_fields_set - {"name", *with_replay}):
                at = (type(self).model_fields[key].alias or key,)
                message, hint = "has no meaning for a replay", "keep either id or replay"
                raise refuse(message, at=at, key=True, allowed=", ".join(with_replay), hint=hint)
        elif self.transport == "direct" and not self.has_address and provider != "openai":
            # A direct call would take the provider's key to OpenAI.
            message = f"needs the address of the server that speaks for {provider}"
            allowed = "direct with an api_base, else auto or litellm"
            hint = "add api_base, or take the line out"
            raise refuse(message, at=("transport",), allowed=allowed, hint=hint)
        known = _DETAILS.get(provider)
        if self.image_detail is not None and known is not None and self.image_detail not in known:
            # It would be ignored, or refused with every request.
            allowed = ", ".join(known) or f"none: {provider} has no such choice"
            raise refuse(f"is not known to {provider}", at=("image_detail",), allowed=allowed)
        if self.batch and provider not in BATCH_PROVIDERS:
            message = f"is not possible: phyblock does not speak the batches of {provider}"
            allowed = ", ".join(f"{name}/..." for name in BATCH_PROVIDERS)
            hint = "where the provider has the /files and /batches of OpenAI, use openai/... with "
            hint += "its api_base; else take the line out"
            raise refuse(message, at=("batch",), allowed=allowed, hint=hint)
        if self.batch and len(self.addresses) > 1:
            message = "is not possible with a list of servers: a batch lies at one"
            raise refuse(message, at=("batch",), hint="give one api_base, or take the line out")
        return self

    @property
    def kind(self) -> Kind:
        """The kind of answers: over the network, from a recording, by a rule, or by hand."""
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
        config, of_entry = _read_entry(name, entry, source)
        problems += [*_check_name(name, source), *of_entry]
        if config is not None:
            models[name] = config
    if problems or source.problems:
        raise SpecError(joined(source, problems))
    return models


def _read_entry(
    name: str, entry: Any, source: YamlSource
) -> tuple[ModelConfig | None, list[Problem]]:
    if not isinstance(entry, str | dict):
        wrong = Problem(source.where((name,)), "has the wrong type", name, show(entry),
                        "a litellm id (provider/model), or a mapping")  # fmt: skip
        return None, [wrong]
    fields = {"id": entry} if isinstance(entry, str) else entry
    if unknown := [key for key in ("name", "most_body_bytes") if key in fields]:
        where = source.where((name, unknown[0]), key=True)
        return None, [Problem(where, "is not a known key", f"{name}.{unknown[0]}")]
    config, problems = check(ModelConfig, fields, source, (name,))
    if config is None:
        return None, problems
    where = source.where((name,))
    if not config.id and config.replay is None:
        message, hint = "needs an id (or a replay folder)", "for example id: openai/gpt-4o"
        return None, [Problem(where, message, name, show(entry), hint=hint)]
    variable = f"{config.provider.upper()}_API_BASE"
    if config.provider in _SELF_HOSTED and not (config.has_address or os.environ.get(variable)):
        # litellm would send prompts to a public provider.
        message = "is behind a server of your own: it needs an address"
        hint = f"add api_base: http://localhost:8000/v1, or set {variable}"
        where = source.where((name, "id"))
        return None, [Problem(where, message, f"{name}.id", config.id, hint=hint)]
    if config.replay is None:
        return config.model_copy(update={"name": name}), []
    try:
        replay = str(expand(config.replay, Path(source.label).parent))
    except ValueError as error:
        where = source.where((name, "replay"))
        return None, [Problem(where, str(error), f"{name}.replay", config.replay)]
    return config.model_copy(update={"name": name, "replay": replay}), []


def _check_name(name: str, source: YamlSource) -> list[Problem]:
    own = (*baseline_names(), RECORDED)
    if name in own:
        message, allowed = "is a name of phyblock's own", f"not {', '.join(own)}"
    elif prefix := next((one for one in (GROUP, HUMAN) if name.startswith(one)), ""):
        message, allowed = f"begins with {prefix}, which names others", ""
    else:
        try:
            TypeAdapter(ModelName).validate_python(name)
        except ValidationError:
            message = "is not a usable name"
            allowed = "up to 80 letters, digits and . _ : + -, starting with a letter or digit"
        else:
            return []
    where = source.where((name,), key=True)
    return [Problem(where, message, name, show(name), allowed, "choose another name")]


def group_names(known: Mapping[str, ModelConfig]) -> tuple[str, ...]:
    """Return the groups that models belong to, in the order in which the file names them."""
    return tuple(dict.fromkeys(group for config in known.values() for group in config.groups))


def with_members(names: Sequence[str], known: Mapping[str, ModelConfig]) -> tuple[str, ...]:
    """Return the names with the members of a group in its place; an unknown group stays."""
    members: dict[str, None] = {}
    for name in names:
        group = name.removeprefix(GROUP) if name.startswith(GROUP) else None
        of_group = [n for n, config in known.items() if group in config.groups]
        members |= dict.fromkeys(of_group or [name])
    return tuple(members)


def resolve_models(
    names: Sequence[str], known: Mapping[str, ModelConfig], where: Callable[[int], str]
) -> dict[str, ModelConfig]:
    """Return the models of these names in their order, those of a group in its place.

    Raises SpecError for each name that is neither a model, a group nor a built-in baseline, at the
    place of its index.
    """
    built_in = {name: ModelConfig(name=name) for name in baseline_names()}
    allowed = [*built_in, *known, *(GROUP + name for name in group_names(known))]
    problems = []
    for index, name in enumerate(names):
        if name in allowed:
            continue
        message = "is neither in the models file nor a built-in baseline"
        if name.startswith(GROUP):
            message = "is no group of the models file"
        elif name.startswith(HUMAN):
            message = "is a person, who answers in `phyblock play`"
        hint = did_you_mean(name, allowed) or "list them: phyblock models"
        shown = ", ".join(allowed) if len(allowed) <= 12 else ""
        place = where(index)
        field = "" if place == "--models" else f"models[{index}]"
        problems.append(Problem(place, message, field, name, shown, hint))
    if problems:
        raise SpecError(problems[:100])
    return {name: {**built_in, **known}[name] for name in with_members(names, known)}
