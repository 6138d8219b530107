"""Models files: how models are called, what they cost, and which groups they belong to."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import re
import urllib.parse
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ConfigDict, Field, JsonValue, RootModel
from pydantic.json_schema import SkipJsonSchema

from phyblock.config import validation
from phyblock.config.validation import Cost, Count, Fault, Section, TimeoutS, Unique, checked, form
from phyblock.config.yaml import read_yaml
from phyblock.errors import Problem, SpecError
from phyblock.registry import baseline_names
from phyblock.text import did_you_mean
from phyblock.types import BATCH_PROVIDERS, ImageDetail

Kind = Literal["litellm", "replay", "baseline", "human"]

RECORDED = "recorded"
"""The word for every folder of recorded replies."""
GROUP = "group:"
"""The prefix of a group's name in lists of models."""
HUMAN = "human:"
"""The prefix of a person's name in lists of models."""
DIRECT_PROVIDERS = ("openai", "hosted_vllm", "lm_studio")
"""Provider prefixes of the plain OpenAI protocol, for which litellm has nothing to translate."""
OWN_SERVER = "a server of one's own"
"""Placeholder in identities for the address of any server that is not the provider's."""
ADDRESS_ALLOWED = "http://... or https://..., without user, password, query and fragment"

_SELF_HOSTED = (
    "hosted_vllm", "lm_studio", "llamafile", "custom_openai", "xinference", "litellm_proxy",
)  # fmt: skip
"""Providers that need an address, from `api_base` or the variable PROVIDER_API_BASE: otherwise
litellm sends their prompts to api.openai.com, except llamafile's."""
_RENAMES_PARAMETERS = re.compile(r"o\d|gpt-5")
_OWN_BODY = (
    "model", "messages", "n", "best_of", "stream", "max_tokens", "max_completion_tokens",
)  # fmt: skip
"""Fields of a request's body that phyblock writes, or that multiply the cost."""


def is_address(url: str) -> bool:
    """True if a model can be called at this address, which has no user, query or fragment.

    Addresses are stored and shown, so they must hold no secret; a refused one is not shown.
    """
    has_form = re.fullmatch(r"(?i)https?://[^\s/@]+(/[!-~]*)?", url)
    if not has_form or len(url) > 1000 or not url.isprintable() or set(url) & set("?#\\"):
        return False
    try:
        parts = urllib.parse.urlsplit(url)
        host = parts.hostname or ""
        if "[" in parts.netloc:
            ipaddress.IPv6Address(host.partition("%")[0])
        else:
            host.encode("idna")
        return bool(host) and parts.port != 0
    except ValueError:
        return False


def host_of(url: str) -> str:
    """Return only host and port, or "an unreadable address"."""
    with contextlib.suppress(ValueError):
        if host := urllib.parse.urlsplit(url).netloc.rpartition("@")[2].lower():
            return host
    return "an unreadable address"


def _one_or_list(value: object) -> object:
    if value == []:
        raise validation.fault(Fault("has too few items", "at least 1"))
    return () if value is None else value if isinstance(value, list | tuple) else (value,)


class Price(Section):
    """Prices of tokens [USD per million]."""

    input: Cost
    """Prompt tokens [USD per million]."""
    output: Cost
    """Reply tokens [USD per million]."""
    cached: Cost | None = None
    """Prompt tokens read from the provider's cache [USD per million]; null: the price of input."""
    cache_write: Cost | None = None
    """Prompt tokens written to the provider's cache [USD per million]; null: the price of input."""


class Tariff(Price):
    """The price of a model, if litellm's price map does not have it or is wrong."""

    batch: Price | None = None
    """Prices in batches; null: half at OpenAI's, Anthropic's and Google's addresses, else full."""
    up_to: Count | None = None
    """Longest prompt for which the price holds [tokens]; the cost of longer ones is unknown, and
    under a cost limit they are not sent. null: any."""


def _address_faults(url: str) -> Iterator[Fault]:
    if not is_address(url):
        hint = "for example http://localhost:8000/v1; keys go into a variable: api_key_env"
        yield Fault("is not an address that can be used", ADDRESS_ALLOWED, "", hint=hint)


def _body_faults(body: dict[str, JsonValue]) -> Iterator[Fault]:
    for key in sorted(body.keys() & set(_OWN_BODY)):
        yield Fault("cannot be set in extra_body", at=(key,), key=True)


_Variable = Annotated[str, form(r"^[A-Za-z_][A-Za-z0-9_]*$", "a name such as MY_KEY")]
_Group = Annotated[str, form(r"^[a-z0-9][a-z0-9-]{0,39}$", f"up to 40 {validation.HYPHENATED}")]
_ID_ALLOWED = "provider/model: openai/gpt-4o-2024-08-06, hosted_vllm/NAME on your own server"
_Id = Annotated[str, form(r"^[^/ ]+/[^ ]+$", _ID_ALLOWED)]
_HTTP = Field(json_schema_extra={"pattern": "^https?://"})
_Address = Annotated[str, checked(_address_faults), _HTTP]
_Effort = Literal["none", "minimal", "low", "medium", "high", "xhigh", "max"]
_Temperature = Annotated[float, Field(strict=True, ge=0, le=2)]
_TopP = Annotated[float, Field(strict=True, gt=0, le=1)]


class SamplingSpec(Section):
    """Sampling parameters for models that set none."""

    temperature: _Temperature | None = 0.0
    """0 to 2; null: not sent."""
    top_p: _TopP | None = None
    """Above 0, at most 1; null: not sent."""
    max_tokens: Count | None = 4096
    """Limit of a reply, including thinking [tokens]; null: not sent."""


class ModelConfig(Section):
    """One model: its address and parameters.

    Exactly one of `id` and `replay` is given; a built-in baseline and a person have only a name. A
    missing field takes the suite's value (`with_defaults`).
    """

    model_config = ConfigDict(
        json_schema_extra={"oneOf": [{"required": ["id"]}, {"required": ["replay"]}]}
    )

    name: SkipJsonSchema[str] = Field(default="", exclude=True)
    id: _Id = ""
    """litellm id with its provider: openai/gpt-4o-2024-08-06."""
    addresses: Annotated[
        Unique[_Address],
        BeforeValidator(_one_or_list, json_schema_input_type=_Address | list[_Address] | None),
    ] = Field(default=(), alias="api_base")
    """Address of an OpenAI-compatible server (vLLM, Ollama, LM Studio), such as
    http://localhost:8000/v1; a list if several serve the same model. Each request goes to the one
    with the fewest in progress; one that cannot be reached is set aside and tried again."""
    revision: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    """Name of the weights, if the id does not identify them. Two servers with the same id count as
    the same model, unless their revisions differ."""
    api_key_env: _Variable | None = None
    """Environment variable that holds the key, if not the provider's usual one; never the key."""
    transport: Literal["auto", "litellm", "direct"] = "auto"
    """litellm: by the library. direct: HTTP in OpenAI's chat protocol. auto: direct if possible."""
    batch: validation.Flag = False
    """Send requests in the provider's batches (OpenAI and servers with its /files and /batches,
    Anthropic, Gemini): up to a day slower, and cheaper. It may change before a run continues."""
    max_concurrency: Count = 64
    """Maximum number of concurrent calls to this model. If missing: the suite's."""
    rpm: Count | None = None
    """Maximum requests per minute, which start evenly."""
    tpm: Count | None = None
    """Maximum tokens per minute, of prompts and replies. A reply counts with its longest possible
    length until it has arrived; a request larger than the limit is sent, and the next one waits."""
    temperature: _Temperature | None = None
    """0 to 2. If missing: the suite's; null: not sent."""
    top_p: _TopP | None = None
    """Above 0, at most 1. If missing: the suite's; null: not sent."""
    max_tokens: Count | None = None
    """Limit of a reply [tokens]. If missing: the suite's; null: not sent."""
    reasoning_effort: _Effort | None = None
    """Effort of a reasoning model; null: not sent."""
    image_detail: ImageDetail | None = None
    """Detail of pictures: `detail` of OpenAI and compatible servers (auto, low, high, original),
    Gemini's media resolution (low, medium, high, ultra_high); null: the provider's default. A
    provider refuses or ignores other values."""
    extra_body: Annotated[dict[str, JsonValue], checked(_body_faults)] = Field(default_factory=dict)
    """Further fields of the request body, sent unchanged; not model, messages, n, best_of, stream,
    max_tokens, max_completion_tokens."""
    price: Tariff | None = None
    """Price; null: that of litellm's price map, else unknown."""
    seed: Literal["auto", "always", "never"] = "auto"
    """auto: sent if litellm knows that the provider accepts seeds, and to servers named by
    api_base. always, never: sent, or not, in any case. Without seeds, repeats are independent."""
    response_format: Literal["auto", "always", "never"] = "auto"
    """With answer_format: json_schema. auto: the schema is sent if litellm knows that the model
    accepts one, and to servers named by api_base. always, never: sent, or not, in any case."""
    timeout_s: TimeoutS = 300.0
    """Maximum wait for a whole reply [s]. If missing: the suite's."""
    published: validation.Text | None = None
    """Name of its row in the paper's tables."""
    size_b: TimeoutS | None = None
    """Parameters [billions], if known."""
    groups: Unique[_Group] = ()
    """Its groups; group:NAME in a suite or --models means all models of a group, in file order."""
    replay: validation.Text | None = None
    """Folder of recorded replies to use instead of an id, relative to this file."""

    def faults(self) -> Iterator[Fault]:
        """Yield fields that conflict with others or with the provider."""
        provider = self.provider
        if self.replay is not None:
            with_replay = ("groups", "published", "replay", "size_b")
            for key in sorted(self.model_fields_set - {"name", *with_replay}):
                at, allowed = (type(self).model_fields[key].alias or key,), ", ".join(with_replay)
                yield Fault("has no meaning for a replay", allowed, at=at, key=True)
            return
        if self.transport == "direct" and not self.addresses and provider != "openai":
            # A direct call would take the provider's key to OpenAI.
            message = f"needs api_base, the address of the server that speaks for {provider}"
            yield Fault(message, at=("transport",))
        if self.batch and provider not in BATCH_PROVIDERS:
            message = f"is not possible: phyblock does not speak the batches of {provider}"
            allowed = ", ".join(f"{name}/..." for name in BATCH_PROVIDERS)
            yield Fault(message, allowed, at=("batch",))
        if self.batch and len(self.addresses) > 1:
            message = "is not possible with a list of servers: a batch is at one of them"
            yield Fault(message, at=("batch",))

    @property
    def kind(self) -> Kind:
        """The kind of model: network, recording, baseline, or person."""
        if self.replay is not None:
            return "replay"
        if self.id:
            return "litellm"
        return "human" if self.name.startswith(HUMAN) else "baseline"

    @property
    def provider(self) -> str:
        """The part of the id before the first slash, or ""."""
        return self.id.partition("/")[0]

    @property
    def provider_model(self) -> str:
        """The id without the provider: the provider's name for the model."""
        return self.id.partition("/")[2]

    @property
    def api_base(self) -> str | None:
        """The address, if there is exactly one."""
        return self.addresses[0] if len(self.addresses) == 1 else None

    def at(self, address: str | None) -> Self:
        """Return the model at one server's address; None is its provider's."""
        return self.model_copy(update={"addresses": () if address is None else (address,)})

    @property
    def is_direct(self) -> bool:
        """True if calls go straight to the server instead of through litellm.

        With `auto`, this holds if `api_base` names a server, unless litellm renames parameters.
        """
        if self.transport != "auto":
            return self.transport == "direct"
        return (
            bool(self.addresses)
            and self.provider in DIRECT_PROVIDERS
            and _RENAMES_PARAMETERS.match(self.provider_model) is None
        )

    @property
    def params(self) -> dict[str, Any]:
        """Sampling parameters to send, by their OpenAI names."""
        names = ("temperature", "top_p", "max_tokens", "reasoning_effort")
        params = {name: value for name in names if (value := getattr(self, name)) is not None}
        return {**params, "extra_body": self.extra_body} if self.extra_body else params

    def with_defaults(self, values: Mapping[str, Any]) -> Self:
        """Return the model with values for the fields that its entry does not set."""
        missing = {name: v for name, v in values.items() if name not in self.model_fields_set}
        return self.model_copy(update=missing)

    def identity(self) -> dict[str, object]:
        """Return everything that affects replies, as JSON data: not limits, price, transport or the
        address of a custom server. It does record that the server is custom, or the replies of a
        stand-in could pass for the provider's. Fields that are not set are omitted.
        """
        optional = {
            "revision": self.revision,
            "response_format": self.response_format == "always" or None,
            "image_detail": self.image_detail,
        }
        return {
            "kind": self.kind,
            "id": self.id or self.name,
            "api_base": OWN_SERVER if self.addresses else None,
            "params": self.params,
            "sends_seed": self.seed != "never",
            "recording": self.replay,
            **{name: value for name, value in optional.items() if value is not None},
        }


def _entry(value: object) -> object:
    if isinstance(value, Mapping) and "name" in value:
        raise validation.fault(Fault("is not a known key", found="", at=("name",), key=True))
    return {"id": value} if isinstance(value, str) else value


def _entry_faults(config: ModelConfig) -> Iterator[Fault]:
    variable = f"{config.provider.upper()}_API_BASE"
    if not config.id and config.replay is None:
        yield Fault("needs an id, or a replay folder", hint="for example id: openai/gpt-4o")
    elif config.provider in _SELF_HOSTED and not (config.addresses or os.environ.get(variable)):
        # litellm would send prompts to a public provider.
        message = "is behind a server of your own: it needs an address"
        hint = f"add api_base: http://localhost:8000/v1, or set {variable}"
        yield Fault(message, found=config.id, at=("id",), hint=hint)


def _name_faults(name: str) -> Iterator[Fault]:
    own = (*baseline_names(), RECORDED)
    if name in own:
        yield Fault("is a reserved name", f"not {', '.join(own)}", "", key=True)
    if name.startswith((GROUP, HUMAN)):
        yield Fault("begins with a reserved prefix", f"not {GROUP}, {HUMAN}", "", key=True)


_Entry = Annotated[
    ModelConfig,
    BeforeValidator(_entry, json_schema_input_type=_Id | ModelConfig),
    checked(_entry_faults),
]


class ModelsFile(RootModel[dict[Annotated[validation.ModelName, checked(_name_faults)], _Entry]]):
    """Models by the names used in suites."""

    model_config = ConfigDict(json_schema_extra={"additionalProperties": False})


def load_models(path: Path) -> dict[str, ModelConfig]:
    """Read a models file: each name maps to a litellm id or to a mapping.

    Paths of replay folders become absolute. Raises SpecError with all problems.
    """
    source = read_yaml(path)
    source.data = {} if source.data is None else source.data
    models = dict(validation.read_section(ModelsFile, source).root)
    for name, config in models.items():
        update = {"name": name}
        if config.replay is not None:
            update["replay"] = str(source.file(config.replay, (name, "replay")))
        models[name] = config.model_copy(update=update)
    return models


def with_members(names: Sequence[str], known: Mapping[str, ModelConfig]) -> tuple[str, ...]:
    """Return the names, with groups replaced by their members; unknown groups are kept."""
    members: dict[str, None] = {}
    for name in names:
        group = name.removeprefix(GROUP) if name.startswith(GROUP) else None
        of_group = [n for n, config in known.items() if group in config.groups]
        members |= dict.fromkeys(of_group or [name])
    return tuple(members)


def resolve_models(
    names: Sequence[str], known: Mapping[str, ModelConfig], where: Callable[[int], str]
) -> dict[str, ModelConfig]:
    """Return the models of these names in their order, with groups replaced by their members.

    Raises SpecError, at its place, for a name that is no model, group or built-in baseline.
    """
    named = {**{name: ModelConfig(name=name) for name in baseline_names()}, **known}
    groups = dict.fromkeys(group for config in known.values() for group in config.groups)
    allowed = [*named, *(GROUP + group for group in groups)]
    problems = []
    for index, name in enumerate(names):
        if name in allowed:
            continue
        message = "is neither in the models file nor a built-in baseline"
        if name.startswith(GROUP):
            message = "is not a group of the models file"
        elif name.startswith(HUMAN):
            message = "is a person, who answers in `phyblock play`"
        hint = did_you_mean(name, allowed) or "list them: phyblock models"
        place = where(index)
        field = "" if place == "--models" else f"models[{index}]"
        problems.append(Problem(place, message, field, name, hint=hint))
    if problems:
        raise SpecError(problems)
    return {name: named[name] for name in with_members(names, known)}
