"""Bodies that a server compressed: unpacked piece by piece, never beyond a limit."""

from __future__ import annotations

import zlib
from collections.abc import Callable

__all__ = ["ACCEPTED_ENCODINGS", "BodyReader"]

ACCEPTED_ENCODINGS = "gzip, deflate"
"""What a server is told that it may use; their unpacking can be bounded by the standard library."""

_GZIP = 16 + zlib.MAX_WBITS
_PLAIN = ("", "identity")


class BodyReader:
    """Takes a body in pieces, as they arrive; counts them before and after unpacking."""

    def __init__(
        self, encoding: str, most_bytes: int, sink: Callable[[bytes], object] | None = None
    ) -> None:
        """`sink` takes what is unpacked where the body is too large to be kept in memory.

        ValueError for an encoding that was not offered, or for several on top of another.
        """
        name = encoding.strip().lower()
        if name not in (*_PLAIN, "gzip", "x-gzip", "deflate"):
            raise ValueError(f"has an encoding that was not asked for ({name[:40]!r})")
        self._name = name
        self._most_bytes = most_bytes
        self._arrived_bytes = 0
        self._pieces: list[bytes] = []
        self._sink = self._pieces.append if sink is None else sink
        self._length_bytes = 0
        self._unpacker: zlib._Decompress | None = None

    def add(self, piece: bytes) -> None:
        """Take the next piece.

        Raises ValueError for what cannot be unpacked and for more than the limit.
        """
        self._arrived_bytes += len(piece)
        if self._arrived_bytes > self._most_bytes:
            raise self._too_large()
        if self._name in _PLAIN:
            self._keep(piece)
            return
        try:
            while piece:
                piece = self._unpack(piece)
        except zlib.error:
            raise ValueError(f"is not {self._name} as it says it is") from None

    def body(self) -> bytes:
        """All of it that no sink took; ValueError when a compressed body is not whole."""
        if self._unpacker is not None and not self._unpacker.eof:
            raise ValueError("breaks off in the middle of its compression")
        return b"".join(self._pieces)

    def _unpack(self, piece: bytes) -> bytes:
        """Unpack a piece; returns the rest, which begins the next member of a gzip body."""
        if self._unpacker is None or self._unpacker.eof:
            self._unpacker = zlib.decompressobj(self._window(piece))
        room = self._most_bytes - self._length_bytes
        # One byte more than there is room for tells a full body from one that is too large.
        self._keep(self._unpacker.decompress(piece, room + 1))
        return self._unpacker.unused_data if self._unpacker.eof else b""

    def _window(self, start: bytes) -> int:
        """How zlib has to read what begins so; some servers leave out the header of deflate."""
        if self._name != "deflate":
            return _GZIP
        return zlib.MAX_WBITS if start[0] & 0x0F == 8 else -zlib.MAX_WBITS

    def _keep(self, piece: bytes) -> None:
        self._length_bytes += len(piece)
        if self._length_bytes > self._most_bytes:
            raise self._too_large()
        self._sink(piece)

    def _too_large(self) -> ValueError:
        return ValueError(f"is larger than {self._most_bytes / 2**20:g} MB")
