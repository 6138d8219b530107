"""A command that lists a model's servers, one address a line, run again while a run goes on."""

from __future__ import annotations

import asyncio
import contextlib
import os
import selectors
import signal
import subprocess
import time
from collections.abc import Sequence
from typing import IO

from phyblock.errors import Problem, SpecError, reason_of
from phyblock.models.address_file import LARGEST_BYTES, addresses_in
from phyblock.models.events import Tell
from phyblock.models.keys import environment_secrets, hidden
from phyblock.models.limits import Clock
from phyblock.text import one_line

__all__ = ["AddressCommand", "addresses_by"]

RUN_EVERY_S = 30.0
LONGEST_S = 20.0
_FIELD = "api_base_command"
_LONGEST_SAID = 300


class _Runs:
    """One command at a time, which can be ended from another thread."""

    def __init__(self, words: Sequence[str]) -> None:
        self._words = list(words)
        self._process: subprocess.Popen[bytes] | None = None

    def addresses(self) -> tuple[str, ...]:
        """Run it and read what it lists; see `addresses_by`."""
        try:
            text = self._output()
        except ValueError as error:
            raise self.fault(str(error)) from None
        except OSError as error:
            raise self.fault(f"cannot be run: {reason_of(error)}") from None
        return addresses_in(text, self.name, _FIELD)

    def end(self) -> None:
        """Kill what still runs, with all that it started."""
        process = self._process
        if process is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)

    def fault(self, message: str) -> SpecError:
        """What is wrong with it."""
        return SpecError(Problem(self.name, message, _FIELD))

    @property
    def name(self) -> str:
        """The program alone: its other words may hold what is worth hiding."""
        return f"the command {one_line(self._words[0])}"

    def _output(self) -> str:
        """What it prints; ValueError with a message for the user where that is of no use."""
        try:
            process = subprocess.Popen(
                self._words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            raise ValueError(f"cannot be run: {why}") from None
        self._process = process
        until_s = time.monotonic() + LONGEST_S
        with process:
            try:
                printed, complaint = _read_both(process, until_s)
                code = process.wait(max(0.0, until_s - time.monotonic()))
            except subprocess.TimeoutExpired:
                raise ValueError(f"does not end within {LONGEST_S:g} s") from None
            finally:
                self.end()
                process.wait()
                self._process = None
        if code != 0:
            said_by_it = hidden(complaint.decode("utf-8", "replace"), environment_secrets())
            words = one_line(said_by_it.strip())[-_LONGEST_SAID:]
            raise ValueError(f"ends with code {code}" + (f": {words}" if words else ""))
        try:
            # It has all keys of the environment at hand, and what it prints stands in messages.
            return hidden(printed.decode("utf-8"), environment_secrets(), guess=False)
        except UnicodeDecodeError:
            raise ValueError("prints what is no UTF-8") from None


def _read_both(process: subprocess.Popen[bytes], until_s: float) -> tuple[bytes, bytes]:
    """All of standard output, and the end of standard error; ValueError for too much.

    Raises subprocess.TimeoutExpired where they are not closed by then.
    """
    assert process.stdout is not None
    assert process.stderr is not None
    kept: dict[IO[bytes], bytes] = {process.stdout: b"", process.stderr: b""}
    with selectors.DefaultSelector() as selector:
        for pipe in kept:
            selector.register(pipe, selectors.EVENT_READ)
        while selector.get_map():
            left_s = until_s - time.monotonic()
            ready = selector.select(left_s) if left_s > 0 else []
            if not ready:
                raise subprocess.TimeoutExpired(process.args, LONGEST_S)
            for key, _ in ready:
                pipe = next(pipe for pipe in kept if pipe.fileno() == key.fd)
                piece = os.read(key.fd, 65536)
                if not piece:
                    selector.unregister(pipe)
                elif pipe is process.stderr:
                    kept[pipe] = (kept[pipe] + piece)[-4 * _LONGEST_SAID :]
                else:
                    kept[pipe] += piece
                    if len(kept[pipe]) > LARGEST_BYTES:
                        raise ValueError(f"prints more than {LARGEST_BYTES:,} bytes")
    return kept[process.stdout], kept[process.stderr]


def addresses_by(words: Sequence[str]) -> tuple[str, ...]:
    """The addresses that a command prints, as `addresses_in` reads them; it is run without a shell.

    Raises SpecError where it cannot be run, fails, takes longer than LONGEST_S or prints too much,
    and naming every line that is no address.
    """
    return _Runs(words).addresses()


class AddressCommand:
    """Runs the command now and then, beside the calls; what is wrong is told once until it changes.

    asyncio, one loop, in which it is first looked at. `listed` is what it printed a while ago: then
    it is first run when it is looked at, else when this is made. Raises SpecError as `addresses_by`
    does.
    """

    def __init__(
        self, words: Sequence[str], clock: Clock, tell: Tell, listed: tuple[str, ...] = ()
    ) -> None:
        self._runs = _Runs(words)
        self._clock = clock
        self._tell = tell
        self._told = ""
        self._run_at_s = clock.now() + (0.0 if listed else RUN_EVERY_S)
        self._running: asyncio.Task[tuple[str, ...]] | None = None
        self.addresses = listed or self._runs.addresses()
        """The last good list."""

    @property
    def look_every_s(self) -> float:
        """How long nothing needs to be looked at."""
        return RUN_EVERY_S if self._running is None else 1.0

    def has_changed(self) -> bool:
        """Run it, if it is time to, and take up what it printed; whether the list is new."""
        if self._running is None:
            now_s = self._clock.now()
            if now_s >= self._run_at_s:
                self._running = asyncio.create_task(self._run())
            return False
        if not self._running.done():
            return False
        running, self._running = self._running, None
        self._run_at_s = self._clock.now() + RUN_EVERY_S
        try:
            addresses = running.result()
        except SpecError as error:
            if str(error) != self._told:
                self._told = str(error)
                self._tell(f"the servers stay the same: {error}")
            return False
        self._told = ""
        is_new = addresses != self.addresses
        self.addresses = addresses
        return is_new

    async def _run(self) -> tuple[str, ...]:
        try:
            return await asyncio.to_thread(self._runs.addresses)
        except RuntimeError as error:
            # No thread is left to run it in.
            raise self._runs.fault(f"cannot be run: {reason_of(error)}") from None

    async def aclose(self) -> None:
        """End what still runs."""
        if self._running is not None:
            self._runs.end()
            await asyncio.gather(self._running, return_exceptions=True)
            self._running = None
