"""A file that lists a model's servers, one address a line, and may be written anew at any time."""

from __future__ import annotations

from pathlib import Path

from phyblock.config.models import AddressFault, address_fault
from phyblock.errors import Problem, SpecError
from phyblock.files import read_text
from phyblock.models.events import Tell
from phyblock.models.limits import Clock

__all__ = ["LARGEST_BYTES", "AddressFile", "addresses_in", "read_addresses"]

LOOK_EVERY_S = 5.0
LARGEST_BYTES = 1024 * 1024
_TWICE = AddressFault("stands twice in this list", "keep one of them", may_hold_secret=False)
_HALF_WRITTEN = AddressFault(
    "does not end with a line break, so it may be half written",
    "write the file under another name, then rename it",
    may_hold_secret=True,
)


def read_addresses(path: Path) -> tuple[str, ...]:
    """The addresses in a file: one a line, without empty lines and those that begin with `#`.

    Raises SpecError naming every line that is no address, stands twice or is not ended, and where
    the file cannot be read or lists none.
    """
    try:
        text = read_text(path, LARGEST_BYTES)
    except (OSError, ValueError) as error:
        why = f"cannot be read: {error.strerror}" if isinstance(error, OSError) else str(error)
        raise SpecError(Problem(str(path), why, "api_base_file")) from None
    return addresses_in(text, str(path), "api_base_file", ends_lines=True)


def addresses_in(text: str, where: str, field: str, *, ends_lines: bool = False) -> tuple[str, ...]:
    """The addresses in a text that comes from `where`, as `field` says; with `ends_lines`, a last
    line without a line break is refused.

    Raises SpecError naming every line that is no address or stands twice, and where there is none.
    """
    addresses: list[str] = []
    problems = []
    for number, line in enumerate(text.splitlines(keepends=True), 1):
        address = line.strip()
        if not address or address.startswith("#"):
            continue
        fault = address_fault(address)
        if fault is None and address in addresses:
            fault = _TWICE
        if fault is None and ends_lines and line == line.rstrip("\r\n"):
            fault = _HALF_WRITTEN
        if fault is not None:
            shown = "" if fault.may_hold_secret else address
            place = f"{where}:{number}"
            problems.append(Problem(place, fault.message, field, shown, hint=fault.hint))
        addresses.append(address)
    if not addresses:
        hint = "one address a line, for example http://localhost:8000/v1"
        problems.append(Problem(where, "lists no address", field, hint=hint))
    if problems:
        raise SpecError(problems)
    return tuple(addresses)


class AddressFile:
    """Looks at the file now and then; what is wrong with it is told once, until it changes."""

    def __init__(self, path: Path, clock: Clock, tell: Tell) -> None:
        self._path = path
        self._clock = clock
        self._tell = tell
        self._look_at_s = clock.now() + LOOK_EVERY_S
        self._state = self._stat()
        self.addresses = read_addresses(path)
        """The last good list."""

    @property
    def look_every_s(self) -> float:
        """How long nothing needs to be looked at."""
        return LOOK_EVERY_S

    def has_changed(self) -> bool:
        """Look, if it is time to, and read the file if it was written; whether the list is new."""
        now_s = self._clock.now()
        if now_s < self._look_at_s:
            return False
        self._look_at_s = now_s + LOOK_EVERY_S
        state = self._stat()
        if state == self._state:
            return False
        self._state = state
        try:
            addresses = read_addresses(self._path)
        except SpecError as error:
            self._tell(f"the servers stay the same: {error}")
            return False
        is_new = addresses != self.addresses
        self.addresses = addresses
        return is_new

    async def aclose(self) -> None:
        """Look no more."""

    def _stat(self) -> tuple[int, ...]:
        """What differs when the file was written; nothing where it is not there."""
        try:
            status = self._path.stat()
        except OSError:
            return ()
        return (status.st_ino, status.st_size, status.st_mtime_ns)
