"""Which process holds something, by a name that says to others on its machine when it has ended.

Linux alone tells that. A process is named by the boot of its machine, its namespaces of process ids
and of time (containers have their own), its id, and its start: an id is given again.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

__all__ = ["holder_name", "is_holder_gone"]

_PROC = Path("/proc")
_NAME = re.compile(r"(?P<realm>\S+) (?P<pid>[1-9]\d{0,9}) (?P<start>\d{1,20})")


def holder_name() -> str:
    """The name of this process; empty where the system cannot say what tells it from all others."""
    realm = _realm()
    start = _start(os.getpid())
    return f"{realm} {os.getpid()} {start}" if realm and start else ""


def is_holder_gone(name: str) -> bool:
    """Whether the process of that name has surely ended. One that is stopped has not; of one on
    another machine or in another container nothing is known, nor of a name that is no such name.
    """
    named = _NAME.fullmatch(name)
    if named is None or named["realm"] != _realm():
        return False
    pid = int(named["pid"])
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        pass  # Another user's, maybe; what is hidden of it in /proc counts as alive.
    start = _start(pid)
    return start is not None and start != named["start"]


def _realm() -> str:
    """Within which process ids and starts mean the same; empty where that cannot be told."""
    try:
        if os.readlink(_PROC / "self") != str(os.getpid()):
            return ""  # The /proc of another namespace than ours.
        boot = (_PROC / "sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        spaces = [os.readlink(_PROC / "self/ns/pid")]
        if (_PROC / "self/ns/time").exists():
            spaces.append(os.readlink(_PROC / "self/ns/time"))
    except (OSError, ValueError):
        return ""
    realm = "/".join((boot, *spaces))
    return realm if boot and realm.split() == [realm] else ""


def _start(pid: int) -> str | None:
    """When a process began [ticks since boot]; "0" once it has ended and nobody has seen to it;
    None where that cannot be told.
    """
    try:
        stat = (_PROC / str(pid) / "stat").read_bytes()
        # Behind the program's name, which may hold anything.
        fields = stat[stat.rindex(b")") + 1 :].decode("ascii").split()
        state, threads, start = fields[0], int(fields[17]), fields[19]
    except (OSError, ValueError, IndexError):
        return None
    return "0" if state in "ZX" and threads <= 1 else start
