"""The suites, the models file and the JSON Schemas that come with the project."""

import contextlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from jsonschema import Draft202012Validator
from pydantic import ValidationError

from phyblock.config.models import load_models, resolve_models
from phyblock.config.suite import load_suite, suite_model
from phyblock.config.yaml import read_yaml
from phyblock.errors import SpecError
from tests.documents import SCHEMAS
from tests.fuzz.strategies import SOUND_SUITES

ROOT = Path(__file__).parents[2]
SUITES = sorted((ROOT / "benchmarks").glob("*.yaml"))
STAMP = re.compile(r"# yaml-language-server: \$schema=(\S+)\n")

OFFICIAL_ONLY = {"paper-table1", "paper-random"}


@pytest.mark.parametrize("path", [*SUITES, ROOT / "models.yaml"], ids=lambda path: path.name)
def test_a_shipped_file_is_valid_by_the_schema_it_names(path):
    stamp = STAMP.match(path.read_text(encoding="utf-8"))
    schema = json.loads((path.parent / stamp[1]).read_text(encoding="utf-8"))
    Draft202012Validator(schema).validate(read_yaml(path).data)


@pytest.mark.parametrize("path", SUITES, ids=lambda path: path.stem)
def test_a_shipped_suite_loads_and_its_models_are_known(path, tmp_path):
    if path.stem in OFFICIAL_ONLY:
        with pytest.raises(SpecError, match=r"dataset\.path: .*\n.*--set dataset\.path=FOLDER"):
            load_suite(path)
    loaded = load_suite(path, [f"dataset.path={tmp_path}"] * (path.stem in OFFICIAL_ONLY))
    assert loaded.name == path.stem
    assert loaded.description
    if loaded.models != "recorded":
        assert resolve_models(loaded.models, load_models(ROOT / "models.yaml"), str)


SUITE_MODEL = suite_model()
MADE = {path.name: json.loads(path.read_bytes()) for path in SCHEMAS.glob("*.json")}
SUITE = Draft202012Validator(MADE["suite.schema.json"])
MODELS = Draft202012Validator(MADE["models.schema.json"])


def test_the_committed_schemas_are_those_of_the_models(tmp_path):
    made = [sys.executable, "-m", "tests.documents", str(tmp_path)]
    subprocess.run(made, check=True, cwd=ROOT)
    for name, schema in MADE.items():
        Draft202012Validator.check_schema(schema)
        made_now = (tmp_path / name).read_bytes()
        assert made_now == (SCHEMAS / name).read_bytes(), "run python -m tests.documents"


@pytest.mark.parametrize("schema", MADE.values(), ids=MADE)
def test_every_key_is_described(schema):
    definitions = schema.get("$defs", {})
    told = {f"#/$defs/{name}" for name, part in definitions.items() if part.get("description")}
    for part in (schema, *definitions.values()):
        for name, field in part.get("properties", {}).items():
            assert field.get("description") or field.get("$ref") in told, name


@given(raw=SOUND_SUITES)
def test_valid_suites_are_valid_by_the_schema(raw):
    for suite in (raw, SUITE_MODEL.model_validate(raw).model_dump(mode="json")):
        assert SUITE.is_valid(suite)


BROKEN = [
    *({"levls": [1]}, {"name": "A B"}, {"models": []}, {"models": "oracle"}, {"levels": [6]}),
    *({"models": ["a", "a"]}, {"levels": [True]}, {"settings": "A"}, {"seeds": [-1]}),
    *({"prompt": "oficial"}, {"images": {"size_px": 100}}, {"scoring": {"level1": "x"}}),
    *({"images": {"order": ["goal", "goal"]}}, {"sampling": {"top_p": 0}}),
    *({"limits": {"max_cost_usd": -1}}, {"dataset": {"path": ""}}),
]


@pytest.mark.parametrize("change", BROKEN, ids=str)
def test_what_the_reader_refuses_the_schema_refuses(change):
    good = {"name": "s", "models": ["oracle"]}
    assert SUITE.is_valid(good)
    assert not SUITE.is_valid({**good, **change})
    with pytest.raises(ValidationError):
        SUITE_MODEL.model_validate({**good, **change})


GOOD = ("openai/gpt-4o", {"id": "a/b", "temperature": None}, {"replay": "x", "size_b": 7})
BAD = ({"replay": "x"}, {"rpm": 0}, {"price": {"input": 1}}, {"api_key": "x"}, {"api_base": "h"})
ENTRIES = (*GOOD, "gpt-4o", {}, 5, *({"id": "a/b"} | more for more in BAD))


@pytest.mark.parametrize("entry", ENTRIES)
def test_models_by_the_schema_and_by_the_reader(tmp_path, entry):
    assert MODELS.is_valid({"m": entry}) is (entry in GOOD)
    assert not any(MODELS.is_valid({name: entry}) for name in ("a b", ""))
    path = tmp_path / "m.yaml"
    path.write_text(json.dumps({"m": entry}))
    with contextlib.nullcontext() if entry in GOOD else pytest.raises(SpecError):
        assert load_models(path)
