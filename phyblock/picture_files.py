"""Pictures that come from outside, opened within bounds: a user's data set, the picture cache.

Four formats are opened, whatever a file is called: decoders of others start programs (EPS starts
Ghostscript) or are seldom looked after. The header's size is judged before anything is decoded.
"""

from __future__ import annotations

import functools
import hashlib
import io
import re
import warnings
from collections import OrderedDict
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from phyblock.bounded import read_bytes
from phyblock.errors import DataError, Problem, said

__all__ = ["LARGEST_PICTURE_BYTES", "decoded", "picture_size", "read_picture"]

LARGEST_PICTURE_BYTES = 32 * 1024 * 1024
"""Limit of a picture file [bytes]."""

_FORMATS = ("PNG", "JPEG", "GIF", "WEBP")
_ALLOWED = "PNG, JPEG, GIF or WebP"
_LEAST_SIDE_PX, _MOST_SIDE_PX, _MOST_PIXELS = 8, 10_000, 40_000_000
_ALLOWED_SIZE = (
    f"{_LEAST_SIDE_PX} to {_MOST_SIDE_PX:,} pixels a side, {_MOST_PIXELS // 10**6} million in all"
)
_KEPT = 10_000


def read_picture(path: Path) -> bytes:
    """The bytes of a picture file that can be decoded.

    Raises DataError when it is missing, too large, of another format, or damaged.
    """
    try:
        data = read_bytes(path, LARGEST_PICTURE_BYTES)
    except OSError as error:
        message = f"is not a readable picture: {said(error)}"
        raise DataError(Problem(str(path), message, allowed=_ALLOWED)) from error
    except ValueError as error:
        message = f"is not a readable picture: it {error}"
        raise DataError(Problem(str(path), message, allowed=_ALLOWED)) from error
    digest = hashlib.sha256(data).digest()
    if digest not in _known_sound():
        decoded(data, str(path)).close()
        _remember(digest)
    return data


def decoded(data: bytes, where: str) -> Image.Image:
    """The first frame of an encoded picture, decoded; DataError, at `where`, for a bad one."""
    picture = _opened(data, where)
    try:
        picture.load()
    except Exception as error:
        # The bytes steer the decoder, which can fail in any way.
        picture.close()
        raise DataError(_damaged(where, error)) from error
    return picture


def picture_size(data: bytes, where: str) -> tuple[int, int]:
    """Width and height [pixels] by the header alone; DataError for what `decoded` would refuse by
    its header.
    """
    with _opened(data, where) as picture:
        return picture.width, picture.height


def _opened(data: bytes, where: str) -> Image.Image:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            picture = Image.open(io.BytesIO(data), formats=_FORMATS)
    except UnidentifiedImageError as error:
        raise DataError(Problem(where, "is no picture", "", _begins(data), _ALLOWED)) from error
    except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
        pixels = re.search(r"\d+", str(error))
        found = f"{int(pixels[0]):,} pixels" if pixels else said(error)
        problem = Problem(where, "is a picture of a size that is not taken", "", found,
                          _ALLOWED_SIZE)  # fmt: skip
        raise DataError(problem) from error
    except Exception as error:
        raise DataError(_damaged(where, error)) from error
    width, height = picture.size
    small, large = min(width, height), max(width, height)
    if small < _LEAST_SIDE_PX or large > _MOST_SIDE_PX or small * large > _MOST_PIXELS:
        picture.close()
        found = f"{width:,} x {height:,} pixels"
        message = "is a picture of a size that is not taken"
        raise DataError(Problem(where, message, "", found, _ALLOWED_SIZE))
    return picture


def _damaged(where: str, error: Exception) -> Problem:
    return Problem(where, f"is not a readable picture: {said(error)}", allowed=_ALLOWED)


def _begins(data: bytes) -> str:
    return f"a file that begins with {data[:12]!r}" if data else "an empty file"


@functools.cache
def _known_sound() -> OrderedDict[bytes, None]:
    """Digests of files that were decoded: each is asked for several times in a run."""
    return OrderedDict()


def _remember(digest: bytes) -> None:
    known = _known_sound()
    known[digest] = None
    if len(known) > _KEPT:
        known.popitem(last=False)
