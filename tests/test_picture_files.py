"""Pictures from outside: four formats, within bounds, and nothing that is damaged."""

from __future__ import annotations

import contextlib
import io
import os
import struct
import zlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from PIL import Image, PngImagePlugin

from phyblock.errors import DataError
from phyblock.picture_files import decoded, picture_size, read_picture
from tests.fuzz.strategies import PICTURES, png_header

EPS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 90 90\nshowpage\n"


def encoded(format_name: str, size: tuple[int, int] = (64, 32), mode: str = "RGB") -> bytes:
    buffer = io.BytesIO()
    Image.linear_gradient("L").resize(size).convert(mode).save(buffer, format_name)
    return buffer.getvalue()


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def with_chunk(png: bytes, name: bytes, body: bytes) -> bytes:
    """The PNG with another chunk behind its header."""
    return png[:33] + chunk(name, body) + png[33:]


BOMB = zlib.compress(b"x" * (PngImagePlugin.MAX_TEXT_CHUNK + 1))
GOOD = {name: encoded(name) for name in ("PNG", "JPEG", "GIF", "WEBP")}
BAD = {
    "eps": (EPS, "is no picture"),
    "bmp": (encoded("BMP"), "is no picture"),
    "tiff": (encoded("TIFF"), "is no picture"),
    "text": (b"no picture", "is no picture"),
    "nothing": (b"", "an empty file"),
    "dot": (encoded("PNG", (1, 1)), "1 x 1 pixels"),
    "thin": (encoded("PNG", (64, 1)), "64 x 1 pixels"),
    "wide": (png_header(10_001, 8), "10,001 x 8 pixels"),
    "large": (png_header(8_000, 8_000), "8,000 x 8,000 pixels"),
    "bomb": (png_header(30_000, 30_000), "900,000,000 pixels"),
    "warned": (png_header(10_000, 10_000), "100,000,000 pixels"),
    "no-size": (png_header(0, 0), "pic.png"),
    "cut-png": (GOOD["PNG"][:-40], "is not a readable picture: "),
    "cut-jpeg": (GOOD["JPEG"][: len(GOOD["JPEG"]) // 2], "is not a readable picture: "),
    "cut-webp": (GOOD["WEBP"][: len(GOOD["WEBP"]) // 2], "pic.png"),
    "empty-data": (png_header(64, 64), "is not a readable picture: "),
    "text-bomb": (with_chunk(GOOD["PNG"], b"zTXt", b"a\0\0" + BOMB), "is not a readable picture: "),
    "unicode": (with_chunk(GOOD["PNG"], b"iTXt", b"a\0\1\0\0\0" + BOMB), "pic.png"),
    "crc": (GOOD["PNG"][:30] + b"\0" + GOOD["PNG"][31:], "pic.png"),
}


@pytest.mark.parametrize("format_name", GOOD)
def test_four_formats_are_read(format_name: str, tmp_path: Path) -> None:
    path = tmp_path / "any.name"
    path.write_bytes(GOOD[format_name])
    assert read_picture(path) == GOOD[format_name]
    assert picture_size(GOOD[format_name], "x") == (64, 32)
    assert decoded(GOOD[format_name], "x").size == (64, 32)


@pytest.mark.parametrize(("data", "told"), BAD.values(), ids=BAD)
def test_a_bad_picture_is_refused(data: bytes, told: str, tmp_path: Path) -> None:
    path = tmp_path / "pic.png"
    path.write_bytes(data)
    with pytest.raises(DataError) as caught:
        read_picture(path)
    (problem,) = caught.value.problems
    assert problem.where == str(path)
    assert told in str(problem)
    assert problem.allowed


def test_no_program_is_started_for_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = tmp_path / "started"
    script = tmp_path / "gs"
    script.write_text(f"#!/bin/sh\ntouch {told}\n")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    path = tmp_path / "000.png"
    path.write_bytes(EPS)
    with pytest.raises(DataError, match="is no picture"):
        read_picture(path)
    assert not told.exists()


def test_what_is_no_file_or_too_large(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="is not a regular file"):
        read_picture(tmp_path / "pipe")
    with pytest.raises(DataError, match="Is a directory"):
        read_picture(tmp_path)
    with pytest.raises(DataError, match="No such file"):
        read_picture(tmp_path / "none.png")
    with (tmp_path / "big.png").open("wb") as file:
        file.truncate(40 * 2**20)
    with pytest.raises(DataError, match="is larger than 32 MB"):
        read_picture(tmp_path / "big.png")


@settings(deadline=None)
@given(PICTURES)
def test_any_bytes_are_a_picture_or_a_data_error(data: bytes) -> None:
    with contextlib.suppress(DataError):
        picture = decoded(data, "pic")
        assert 8 <= min(picture.size) <= max(picture.size) <= 10_000
        assert picture_size(data, "pic") == picture.size
