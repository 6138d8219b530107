"""Work that kills the process that does it; a module that imports nothing more."""

import os
import signal
from pathlib import Path


def killed(marks: Path, times: int) -> str:
    """Kill the process that this runs in, so many times; then work."""
    if len(list(marks.iterdir())) < times:
        (marks / str(os.getpid())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"
