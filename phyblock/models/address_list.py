"""Where a model's list of servers comes from: its configuration, a file or a command."""

from __future__ import annotations

from typing import Protocol

from phyblock.models.address_command import AddressCommand, addresses_by
from phyblock.models.address_file import AddressFile, read_addresses
from phyblock.models.config import ModelConfig
from phyblock.models.events import Tell
from phyblock.models.limits import Clock

__all__ = ["AddressList", "addresses_of", "changing_list"]


class AddressList(Protocol):
    """A list of servers that may change while a run goes on."""

    @property
    def addresses(self) -> tuple[str, ...]:
        """The last good list."""

    @property
    def look_every_s(self) -> float:
        """How long nothing needs to be looked at."""

    def has_changed(self) -> bool:
        """Look, if it is time to; whether the list is new."""

    async def aclose(self) -> None:
        """Look no more."""


def addresses_of(config: ModelConfig) -> tuple[str | None, ...]:
    """Every address at which a model is served now; None stands for its provider's.

    Raises SpecError as `read_addresses` and `addresses_by` do.
    """
    if config.api_base_file is not None:
        return read_addresses(config.api_base_file)
    if config.api_base_command:
        return addresses_by(config.api_base_command)
    return config.addresses or (None,)


def changing_list(config: ModelConfig, clock: Clock, tell: Tell) -> AddressList | None:
    """The list of a model's servers where it may change, read for the first time.

    Raises SpecError as `addresses_of` does.
    """
    if config.api_base_file is not None:
        return AddressFile(config.api_base_file, clock, tell)
    if config.api_base_command:
        return AddressCommand(config.api_base_command, clock, tell, config.listed)
    return None
