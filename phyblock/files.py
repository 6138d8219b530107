"""Writing a file so that nobody ever sees half of it."""

from __future__ import annotations

from pathlib import Path
from uuid import uuid4

__all__ = ["atomic_write"]


def atomic_write(path: Path, data: bytes | str) -> None:
    """Write a whole file, text as UTF-8, or leave what was there and nothing beside it.

    Its permissions are those of any new file. Raises OSError where the disk refuses.
    """
    # A name of its own: two processes may write the same file at the same time.
    partial = path.with_name(f".{uuid4().hex}.part")
    try:
        with partial.open("xb") as file:
            file.write(data.encode() if isinstance(data, str) else data)
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
