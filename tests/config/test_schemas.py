"""The JSON Schemas: generated, committed, and of one mind with the reader."""

from __future__ import annotations

import contextlib
import copy
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from pydantic import ValidationError

from phyblock.config.models import load_models
from phyblock.config.schema import models_schema, render, suite_schema
from phyblock.config.suite import suite_model
from phyblock.errors import SpecError
from tests.config.strategies import SUITES

SUITE_MODEL = suite_model()

SCHEMAS = Path(__file__).parents[2] / "benchmarks" / "schemas"
SUITE = Draft202012Validator(suite_schema())
MODELS = Draft202012Validator(models_schema())


@pytest.mark.parametrize("schema", [suite_schema(), models_schema()])
def test_a_schema_is_a_schema(schema: dict[str, Any]) -> None:
    Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize(("name", "make"), [("suite", suite_schema), ("models", models_schema)])
def test_the_committed_schema_is_the_generated_one(name: str, make: Any) -> None:
    committed = (SCHEMAS / f"{name}.schema.json").read_text(encoding="utf-8")
    assert committed == render(make()), "rewrite it: python -m phyblock.config"


def test_the_module_writes_both(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "phyblock.config", str(tmp_path)], check=True)
    for name in ("suite.schema.json", "models.schema.json"):
        assert (tmp_path / name).read_bytes() == (SCHEMAS / name).read_bytes()


def _properties(schema: Any) -> list[tuple[str, dict[str, Any]]]:
    found = []
    for definition in (schema, *schema["$defs"].values()):
        found += list(definition.get("properties", {}).items())
    return found


@pytest.mark.parametrize("schema", [suite_schema(), models_schema()])
def test_every_key_is_described(schema: dict[str, Any]) -> None:
    told = {f"#/$defs/{name}" for name, part in schema["$defs"].items() if part.get("description")}
    silent = [
        name
        for name, field in _properties(schema)
        if not field.get("description") and field.get("$ref") not in told
    ]
    assert silent == []


@given(raw=SUITES)
def test_valid_suites_are_valid_by_the_schema(raw: dict[str, Any]) -> None:
    assert SUITE.is_valid(raw)
    assert SUITE.is_valid(SUITE_MODEL.model_validate(raw).model_dump(mode="json"))


BROKEN = [
    ("levls", [1]),
    ("name", "A B"),
    ("name", 5),
    ("models", []),
    ("models", "oracle"),
    ("models", ["a", "a"]),
    ("models", ["a b"]),
    ("models", None),
    ("levels", [5]),
    ("levels", []),
    ("levels", [1, 1]),
    ("levels", ["1"]),
    ("levels", [True]),
    ("settings", "A"),
    ("seeds", [-1]),
    ("seeds", [2**31]),
    ("seeds", [0.5]),
    ("prompt", "oficial"),
    ("parser", None),
    ("images", {"size_px": 100}),
    ("images", {"order": ["goal"]}),
    ("images", {"order": ["goal", "goal"]}),
    ("images", 5),
    ("scoring", {"matchers": []}),
    ("scoring", {"level1": "x"}),
    ("sampling", {"temperature": 2.5}),
    ("sampling", {"top_p": 0}),
    ("sampling", {"max_tokens": "5"}),
    ("limits", {"timeout_s": 0}),
    ("limits", {"max_cost_usd": -1}),
    ("tables", ["table9"]),
    ("dataset", {"format": "x"}),
    ("dataset", {"path": ""}),
]


@pytest.mark.parametrize(("key", "value"), BROKEN)
def test_what_the_reader_refuses_the_schema_refuses(key: str, value: object) -> None:
    good = {"name": "s", "models": ["oracle"]}
    assert SUITE.is_valid(good)
    bad = {**good, key: value}
    assert not SUITE.is_valid(bad)
    with pytest.raises(ValidationError):
        SUITE_MODEL.model_validate(bad)


@given(raw=SUITES, data=st.data())
def test_a_key_left_out_or_unknown(raw: dict[str, Any], data: st.DataObject) -> None:
    sections = [raw, *(value for value in raw.values() if isinstance(value, dict))]
    index = data.draw(st.integers(0, len(sections) - 1))
    bad = copy.deepcopy(raw)
    section = [bad, *(value for value in bad.values() if isinstance(value, dict))][index]
    section["no_such_key"] = 1
    assert not SUITE.is_valid(bad)
    bad = {key: value for key, value in raw.items() if key != "models"}
    assert not SUITE.is_valid(bad)


@pytest.mark.parametrize(
    ("entry", "good"),
    [
        ("openai/gpt-4o", True),
        ("gpt-4o", False),
        ({"id": "openai/gpt-4o", "temperature": None}, True),
        ({"replay": "x", "published": "GPT-4o"}, True),
        ({"id": "a/b", "replay": "x"}, False),
        ({}, False),
        ({"id": "a/b", "rpm": 0}, False),
        ({"id": "a/b", "price": {"input": 1}}, False),
        ({"id": "a/b", "api_key": "x"}, False),
        ({"id": "a/b", "api_base": "localhost"}, False),
        (5, False),
    ],
)
def test_models_by_the_schema_and_by_the_reader(tmp_path: Path, entry: Any, good: bool) -> None:
    assert MODELS.is_valid({"m": entry}) is good
    path = tmp_path / "m.yaml"
    path.write_text(json.dumps({"m": entry}))
    with contextlib.nullcontext() if good else pytest.raises(SpecError):
        assert load_models(path)


@pytest.mark.parametrize("name", ["random", "oracle", "recorded", "a b", ""])
def test_names_that_models_may_not_have(name: str) -> None:
    assert not MODELS.is_valid({name: "openai/gpt-4o"})


def test_schemas_hold_no_title_of_the_generator() -> None:
    titles = [
        field["title"] for schema in (suite_schema(), models_schema())
        for _, field in _properties(schema) if "title" in field
    ]  # fmt: skip
    assert titles == []
    assert json.loads(render(suite_schema()))["title"] == "phyblock suite"
