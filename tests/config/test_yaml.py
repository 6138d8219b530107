"""Reading YAML: what scalars mean, where things stand, what is refused."""

import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.yaml import dotted, dump_yaml, looks_secret, parse_yaml, read_yaml, shown
from phyblock.errors import SpecError

SCALARS = {
    **{text: text for text in ("on", "no", "Yes", "y", "1_000", "1:30", "2024-08-06", "4o")},
    **{"true": True, "False": False, "null": None, "~": None, "010": 10, "0o17": 15, "0x1F": 31},
    **{"1e-3": 1e-3, "1E5": 1e5, "-.5": -0.5, "1.": 1.0},
    **{"+7": 7, "'5'": "5", '"null"': "null", "!!str 5": "5", "!!float 5": 5.0},
}
TEXT = st.text(st.characters(exclude_characters="\x7f", exclude_categories=["Cs"]))
# A key that YAML can tell has 1,024 characters at most, and an escape may take 12.
KEYS = TEXT.filter(lambda text: len(text) <= 80)


def values(texts):
    numbers = st.integers(-(10**199), 10**199) | st.floats(allow_nan=False, allow_infinity=False)
    return st.recursive(
        st.none() | st.booleans() | numbers | texts,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
        max_leaves=8,
    )


@pytest.mark.parametrize(("text", "value"), SCALARS.items())
def test_scalars_follow_yaml_1_2_and_keys_are_text_as_written(text, value):
    found = parse_yaml(f"[a, {text}]", "x").data[1]
    assert (found, type(found)) == (value, type(value))
    if text.isalnum():
        assert parse_yaml(f"{text}: x", "x").data == {text: "x"}


@given(values(TEXT))
def test_json_is_read_as_json(value):
    assert parse_yaml(json.dumps(value), "x").data == value


@given(values(TEXT | st.sampled_from(list(SCALARS))))
def test_what_is_dumped_is_read_again(value):
    assert parse_yaml(dump_yaml(value), "x").data == value


def test_places_of_keys_and_values():
    source = parse_yaml("a: 1\nb:\n  - x\n  - {c: 2}\n", "f.yaml")
    # What is missing stands where what is around it does.
    values = {("a",): "1:4", ("b", 1, "c"): "4:9", ("b", 1): "4:5", ("b", 1, "x"): "4:5"}
    for path, place in values.items():
        assert source.where(path) == f"f.yaml:{place}"
    assert source.where(("x", "y")) == source.where(("a",), key=True) == "f.yaml:1:1"
    assert source.where(("b", 1, "c"), key=True) == "f.yaml:4:6"
    assert dotted(("images", "order", 1, "x")) == "images.order[1].x"
    source = parse_yaml("base: &b {x: 1, y: 2}\nsame: *b\n", "f")
    assert source.data["same"] == source.data["base"] == {"x": 1, "y": 2}


NESTED = "\n".join(
    ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
)
DEEP = "\n".join(["a0: &a0 x", *(f"a{i}: &a{i} [*a{i - 1}]" for i in range(1, 70))])
REFUSED = {
    "a: [1\nb: 2": "f:2:2: is not YAML",
    "a: b: c": "f:1:5: is not YAML",
    "a:\n\t- 1": "f:2:1: is not YAML",
    "a: 1\n---\nb: 2": "f:2:1: is not YAML",
    "a: *none": "f:1:4: is not YAML",
    'a: "open': "f:1:9: is not YAML",
    "a: \x07": "f:1:4: is not allowed in YAML",
    "a: &x [*x]": "f:1:4: a[0]: is nested",
    "a: !!python/object:os.system x": "f:1:4: a: has a tag that is not allowed",
    "a: !mine {b: 1}": "f:1:4: a: has a tag that is not allowed",
    "? [a, b]\n: 1": "f:1:3: has a key that is not plain text",
    "a: !!int x": "f:1:4: a: is not a finite number",
    'a: "\\ud800"': "f:1:4: a: holds half of a character",
    "a: {<<: {b: 1}}": "f:1:5: a.<<: is not supported",
    "a: 1\nb: {c: 1, c: 2}": "f:2:11: b.c: is written twice\n    hint: the first is at f:2:5",
    "a: 0x" + "f" * 299: "f:1:4: a: is a number that is too large",
    "a: -" + "9" * 6_000: "f:1:4: a: is a number that is too large",
    "a: [.inf]": "f:1:5: a[0]: is not a finite number",
    "a: " + "[" * 100_000: "f:1:",
    "- " * 100_000: "f:1:",
    "{a: " * 50_000: "f:1:",
    "#" * 300_000: "f: is too long",
    "a: &a 1\nb: [" + "*a, " * 50_000 + "]": "is one of more than 21,845 values",
    NESTED: "is one of more than 21,845 values",
    DEEP: "is nested more than 64 levels deep",
}


@pytest.mark.parametrize(("text", "said"), REFUSED.items(), ids=range(len(REFUSED)))
def test_what_is_not_plain_data_or_too_much_is_one_problem_at_its_place(text, said):
    with pytest.raises(SpecError) as caught:
        parse_yaml(text, "f")
    (problem,) = caught.value.problems
    assert said in str(problem)


@given(st.text())
def test_any_text_is_read_or_refused(text):
    try:
        places = [parse_yaml(text, "f").where(())]
    except SpecError as error:
        places = [problem.where for problem in error.problems]
    assert all(place.startswith("f") for place in places)


def test_files_that_cannot_be_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "big").write_bytes(b"a: 1\n" * 200_000)
    (tmp_path / "latin").write_bytes(b"a: 1\nb: \xff\n")
    for name, said in {
        "pipe": "cannot be read: is not a regular file",
        "big": r"is larger than 0\.25 MB",
        "latin": "is not UTF-8: invalid start byte at byte 8",
        "none": "cannot be read: No such file",
        ".": "cannot be read: Is a directory",
        "x" * 5_000: "cannot be read: File name too long",
    }.items():
        with pytest.raises(SpecError, match=said):
            read_yaml(tmp_path / name)
    (tmp_path / "marked").write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert read_yaml(tmp_path / "marked").data == {"a": 1}


@pytest.mark.parametrize(
    "text", ["-eyJ" * 50_000, "http://" + ":" * 200_000, "bearer " * 30_000, "hf" * 90_000]
)
def test_a_search_for_keys_takes_linear_time(text):
    assert not looks_secret(text)


@pytest.mark.parametrize(
    "value",
    [10**6000, {object(): 1}, {(1, 2): 3}, b"x", "\ud800", {"a": {1, 2}}, "x" * 10**6],
    ids=lambda value: type(value).__name__,
)
def test_any_value_can_be_shown(value):
    text = shown(value)
    assert len(text) <= 80
    text.encode()
