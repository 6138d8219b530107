"""Reading YAML: what scalars mean, where things stand, what is refused."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.yaml import dotted, parse_yaml, read_yaml
from phyblock.errors import SpecError

SCALARS = {
    "on": "on",
    "no": "no",
    "Yes": "Yes",
    "y": "y",
    "true": True,
    "False": False,
    "null": None,
    "~": None,
    "": None,
    "1e-3": 1e-3,
    "1E5": 1e5,
    "-.5": -0.5,
    "1.": 1.0,
    ".inf": math.inf,
    "-.Inf": -math.inf,
    "010": 10,
    "0o17": 15,
    "0x1F": 31,
    "+7": 7,
    "1_000": "1_000",
    "1:30": "1:30",
    "2024-08-06": "2024-08-06",
    "4o": "4o",
    "'5'": "5",
    '"null"': "null",
    "!!str 5": "5",
    "!!float 5": 5.0,
}

TEXT = st.text(st.characters(exclude_characters="\x7f", exclude_categories=["Cs"]))
NUMBERS = st.integers() | st.floats(allow_nan=False, allow_infinity=False)
# A key that YAML can tell has 1,024 characters at most, and an escape may take 12.
KEYS = TEXT.filter(lambda text: len(text) <= 80)
JSON_VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize(("text", "value"), SCALARS.items())
def test_scalars_follow_yaml_1_2(text: str, value: object) -> None:
    found = parse_yaml(f"[a, {text}]" if text else "[a, ~]", "x").data[1]
    assert found == value
    assert type(found) is type(value)


def test_nan_is_read() -> None:
    assert math.isnan(parse_yaml(".NaN", "x").data)


@pytest.mark.parametrize("key", ["on", "no", "1", "1e-3", "null", "true", "2024-08-06", "010"])
def test_keys_are_text_as_written(key: str) -> None:
    assert parse_yaml(f"{key}: x", "x").data == {key: "x"}


@given(JSON_VALUES)
def test_json_is_read_as_json(value: object) -> None:
    assert parse_yaml(json.dumps(value), "x").data == value


def test_places_of_keys_and_values() -> None:
    source = parse_yaml("a: 1\nb:\n  - x\n  - {c: 2}\n", "f.yaml")
    assert source.where(("a",), key=True) == "f.yaml:1:1"
    assert source.where(("a",)) == "f.yaml:1:4"
    assert source.where(("b", 1)) == "f.yaml:4:5"
    assert source.where(("b", 1, "c")) == "f.yaml:4:9"
    assert source.where(("b", 1, "c"), key=True) == "f.yaml:4:6"


def test_a_missing_path_stands_where_its_parent_does() -> None:
    source = parse_yaml("a:\n  b: 1\n", "f.yaml")
    assert source.where(("a", "x")) == "f.yaml:2:3"
    assert source.where(("a", "x"), key=True) == "f.yaml:1:1"
    assert source.where(("x", "y")) == "f.yaml:1:1"


def test_anchors_and_merge_keys() -> None:
    text = "base: &b {x: 1, y: 2}\nmore: {<<: *b, y: 3}\nboth: {<<: [{x: 9}, *b]}\nsame: *b\n"
    data = parse_yaml(text, "x").data
    assert data["more"] == {"x": 1, "y": 3}
    assert data["both"] == {"x": 9, "y": 2}
    assert data["same"] == data["base"]


def test_a_merged_value_keeps_the_place_of_the_one_that_wins() -> None:
    source = parse_yaml("a: &b {x: 1}\nc:\n  x: 2\n  <<: *b\n", "f")
    assert source.where(("c", "x")) == "f:3:6"
    assert source.where(("c", "x"), key=True) == "f:3:3"


def test_every_duplicate_is_found() -> None:
    source = parse_yaml("a: 1\nb: {c: 1, c: 2}\na: 3\n", "f")
    assert [(p.where, p.field) for p in source.problems] == [("f:2:11", "b.c"), ("f:3:1", "a")]
    assert source.problems[1].hint == "the first is at f:1:1"


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("a: [1\nb: 2", "f:2:2"),
        ("a: b: c", "f:1:5"),
        ("a:\n\t- 1", "f:2:1"),
        ("a: 1\n---\nb: 2", "f:2:1"),
        ("a: *none", "f:1:4"),
        ('a: "open', "f:1:9"),
        ("a: 1\n  b: 2", "f:2:4"),
        ("a: \x07", "f:1:4"),
        ("a: &x [*x]", "f:1:4"),
        ("a: %b", "f:1:4"),
    ],
)
def test_what_is_not_yaml_is_refused_at_its_place(text: str, where: str) -> None:
    with pytest.raises(SpecError) as caught:
        parse_yaml(text, "f")
    assert [problem.where for problem in caught.value.problems] == [where]


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("a: !!python/object:os.system x", "f:1:4"),
        ("a: !mine {b: 1}", "f:1:4"),
        ("? [a, b]\n: 1", "f:1:3"),
        ("a: !!int x", "f:1:4"),
        ('a: "\\ud800"', "f:1:4"),
        ("a: {<<: 5}", "f:1:9"),
    ],
)
def test_what_is_not_plain_data_is_a_problem(text: str, where: str) -> None:
    assert [problem.where for problem in parse_yaml(text, "f").problems] == [where]


def test_a_bomb_of_anchors_is_refused() -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    with pytest.raises(SpecError, match="more than 20,000 values"):
        parse_yaml("\n".join(lines), "f")


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(SpecError, match="nested too deeply"):
        parse_yaml("[" * 5000, "f")


TOO_MUCH = {
    "hex": ("a: 0x" + "f" * 100_000, "f:1:4", "too long a number"),
    "octal": ("a: 0o" + "7" * 100_000, "f:1:4", "too long a number"),
    "digits": ("a: [1, -" + "9" * 6_000 + "]", "f:1:8", "too long a number"),
    "hex above doubles": ("a: 0x" + "f" * 290, "f:1:4", "too large a number"),
    "brackets": ("a: " + "[" * 100_000, None, "nested too deeply"),
    "dashes": ("- " * 100_000, "f:1:129", "nested too deeply"),
    "mappings": ("{a: " * 50_000, None, "nested too deeply"),
    "list": ("a: [" + "1, " * 50_000 + "]", None, "more than 20,000 values"),
    "keys": ("".join(f"k{i}: \n" for i in range(25_000)), None, "more than 20,000 values"),
    "aliases": ("a: &a 1\nb: [" + "*a, " * 50_000 + "]", None, "more than 20,000 values"),
    "merges": ("a: &a {x: 1}\nb: {<<: [" + "*a, " * 50_000 + "]}", None, "than 20,000 values"),
    "size": ("#" * 10_000_000, "f", "too long"),
    "documents": ("---\n" * 50_000, "f:2:1", "another document"),
    "cycle": ("a: &a {b: [*a]}", "f:1:4", "an anchor holds itself"),
}


@pytest.mark.parametrize(("text", "where", "said"), TOO_MUCH.values(), ids=TOO_MUCH)
def test_what_passes_a_bound_is_refused_at_its_place(
    text: str, where: str | None, said: str
) -> None:
    try:
        problems = parse_yaml(text, "f").problems
    except SpecError as error:
        problems = list(error.problems)
    (problem,) = problems
    assert problem.where == where or where is None
    assert said in problem.message
    assert len(str(problem)) < 500


def test_a_key_without_end_is_shown_in_part() -> None:
    (problem,) = parse_yaml("? " + "k" * 50_000 + "\n: !mine x", "f").problems
    assert len(str(problem)) < 500


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(SpecError, match="is not a regular file"):
        read_yaml(tmp_path / "pipe")
    with pytest.raises(SpecError, match="is not a regular file"):
        read_yaml(Path("/dev/zero"))
    (tmp_path / "big").write_bytes(b"a: 1\n" * 200_000)
    with pytest.raises(SpecError, match=r"is larger than 0\.25 MB"):
        read_yaml(tmp_path / "big")
    with pytest.raises(SpecError, match="File name too long"):
        read_yaml(tmp_path / ("x" * 5_000))


@given(st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        places = [parse_yaml(text, "f").where(())]
    except SpecError as error:
        places = [problem.where for problem in error.problems]
    assert all(place.startswith("f:") for place in places)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="cannot be read: No such file"):
        read_yaml(tmp_path / "none.yaml")


def test_a_folder_is_not_a_file(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="cannot be read: Is a directory"):
        read_yaml(tmp_path)


def test_bytes_that_are_not_utf8_are_placed(tmp_path: Path) -> None:
    path = tmp_path / "f.yaml"
    path.write_bytes(b"a: 1\nb: \xff\n")
    with pytest.raises(SpecError) as caught:
        read_yaml(path)
    assert caught.value.problems[0].where == f"{path}:2:4"


def test_a_byte_order_mark_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "f.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert read_yaml(path).data == {"a": 1}


def test_pyyaml_tags_no_code() -> None:
    source = parse_yaml("!!python/name:os.system", "f")
    assert source.data is None
    assert "python/name" in source.problems[0].found
    with pytest.raises(yaml.YAMLError):
        yaml.safe_load("!!python/name:os.system")


def test_dotted() -> None:
    assert dotted(("images", "order", 1, "x")) == "images.order[1].x"
    assert dotted(()) == ""
