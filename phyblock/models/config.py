"""What the run layer says of a model: the runtime counterpart of an entry in models.yaml."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from phyblock.config.models import address_fault
from phyblock.errors import Problem, SpecError
from phyblock.models.prices import Prices
from phyblock.types import ImageDetail, SendMode, TransportName

__all__ = [
    "DIRECT_PROVIDERS",
    "LARGEST_REPLY_BYTES",
    "Kind",
    "ModelConfig",
]

Kind = Literal["litellm", "replay", "baseline", "human"]

DIRECT_PROVIDERS = ("openai", "hosted_vllm", "lm_studio")
"""Provider prefixes that mean the plain OpenAI protocol: litellm has nothing to translate."""

LARGEST_REPLY_BYTES = 32 * 1024 * 1024
"""Default limit of a reply's body [bytes]: a hundred times what the longest thoughts take."""

OWN_SERVER = "a server of one's own"
"""What stands for an address where it decides nothing but that it is no provider's."""

_RENAMES_PARAMETERS = re.compile(r"o\d|gpt-5")


@dataclass(frozen=True)
class ModelConfig:
    """One model.

    `name` is what the tables show; `id` the litellm id (`openai/gpt-4o-2024-08-06`), a baseline's
    name, or the model to read out of a recorded run. It is served at `api_base`, or at each of
    `api_bases`; where neither is given, at its provider's. `api_key_env` names the environment
    variable that holds the key; None means the provider's usual one. `params` are sampling
    parameters by their OpenAI names; they win over a request's, and None there means "do not send".
    At most `max_concurrency` requests are under way at once. `rpm` and `tpm` are limits a minute,
    None for none. `prices` None means litellm's map is asked. `sends_seed`: `auto` sends seeds
    until the provider refuses, `always` takes a refusal as an error, `never` sends none. `revision`
    tells apart models of one id, as other weights behind another address. With `sends_format` a
    request's `response_format` is sent, without it the prompt alone says the form. `image_detail`
    is how closely pictures are looked at, None as the provider does. `timeout_s` bounds a request
    from its first byte to the last of its answer, `most_body_bytes` that answer's body, packed and
    unpacked. With `batch` requests go out in the provider's batches.

    Raises SpecError for an address that is none, or that holds a key or a password.
    """

    name: str
    kind: Kind
    id: str = ""
    api_base: str | None = None
    api_bases: tuple[str, ...] = ()
    api_key_env: str | None = None
    transport: TransportName = "auto"
    params: Mapping[str, object] = field(default_factory=dict)
    max_concurrency: int = 32
    rpm: int | None = None
    tpm: int | None = None
    prices: Prices | None = None
    recording: Path | None = None
    sends_seed: SendMode = "auto"
    revision: str | None = None
    sends_format: bool = False
    image_detail: ImageDetail | None = None
    timeout_s: float = 600.0
    most_body_bytes: int = LARGEST_REPLY_BYTES
    batch: bool = False

    def __post_init__(self) -> None:
        for address in self.addresses:
            fault = address_fault(address)
            if fault is not None:
                where = f"model {self.name}"
                raise SpecError(Problem(where, fault.message, "api_base", hint=fault.hint))

    @property
    def addresses(self) -> tuple[str, ...]:
        """Where it is served; none is the provider's address."""
        return self.api_bases if self.api_base is None else (self.api_base,)

    @property
    def has_address(self) -> bool:
        """Whether it is served elsewhere than at its provider's address."""
        return bool(self.addresses)

    def at(self, address: str | None) -> ModelConfig:
        """The model as one of its servers serves it."""
        return replace(self, api_base=address, api_bases=())

    @property
    def provider(self) -> str:
        """The part of the id before the first slash, "" when there is none."""
        return self.id.partition("/")[0] if "/" in self.id else ""

    @property
    def provider_model(self) -> str:
        """The id without the provider: the model's name as the provider knows it."""
        return self.id.partition("/")[2] if "/" in self.id else self.id

    @property
    def is_direct(self) -> bool:
        """Whether calls go straight to the server instead of through litellm.

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

    def identity(self) -> dict[str, object]:
        """The part that changes replies, JSON-able: not the limits, the price, the transport, nor
        at which address a server of one's own is. That it is no provider's does count, or the
        replies of a stand-in would pass for the provider's. What a model has not is not said.
        """
        identity: dict[str, object] = {
            "kind": self.kind,
            "id": self.id,
            "api_base": OWN_SERVER if self.has_address else None,
            "params": dict(self.params),
            "sends_seed": self.sends_seed != "never",
            "recording": str(self.recording) if self.recording else None,
        }
        if self.revision is not None:
            identity["revision"] = self.revision
        if self.sends_format:
            identity["response_format"] = True
        if self.image_detail is not None:
            identity["image_detail"] = self.image_detail
        return identity
