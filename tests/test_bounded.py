"""Files and JSON that would hang, exhaust memory or end the process are refused."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.bounded import load_json, read_bytes, read_text

_VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=("Cs",))),
    lambda below: st.lists(below) | st.dictionaries(st.text(), below),
)


@given(_VALUES)
def test_json_of_ordinary_size_is_read_as_json_reads_it(value: object) -> None:
    text = json.dumps(value)
    assert load_json(text) == json.loads(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 66 + "]" * 66, "nested"),
        ("[" * 100_000, "nested"),
        ('{"a":' * 100_000, "nested"),
        ("NaN", "NaN"),
        ("[-Infinity]", "-Infinity"),
        ("[1e999]", "outside the range"),
        ("1" * 400, "400 digits"),
        ("1" * 100_000, "digits"),
        ("{", "Expecting"),
    ],
)
def test_json_beyond_the_bounds_is_a_value_error(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_json(text)


def test_nesting_is_allowed_down_to_the_limit() -> None:
    assert load_json("[" * 64 + "]" * 64)


def test_a_file_is_read_up_to_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 100)
    assert read_bytes(path, 100) == b"x" * 100
    with pytest.raises(ValueError, match="larger than"):
        read_bytes(path, 99)


def test_pipes_and_devices_are_refused_at_once(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(ValueError, match="regular file"):
            read_bytes(path)
    with pytest.raises(IsADirectoryError):
        read_bytes(tmp_path)


def test_text_is_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes("\ufeffä".encode())
    assert read_text(path) == "ä"
    path.write_bytes(b"ab\xff")
    with pytest.raises(ValueError, match="at byte 2"):
        read_text(path)
