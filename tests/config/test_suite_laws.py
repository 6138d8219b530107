"""Laws of suites: reading gives back what was written; --set equals editing the file."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from phyblock.config.suite import Suite, load_suite, suite_model
from phyblock.config.yaml import CoreLoader
from phyblock.errors import SpecError
from tests.config.strategies import FIELDS, REQUIRED, SECTIONS, SUITES

SUITE_MODEL = suite_model()


class CoreDumper(yaml.SafeDumper):
    """Quotes what the loader would otherwise not read as text."""


CoreDumper.yaml_implicit_resolvers = CoreLoader.yaml_implicit_resolvers


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("suites")
    (folder / "data" / "phyblock-400").mkdir(parents=True)
    return folder


def load(folder: Path, text: str, *overrides: str) -> Suite:
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    return load_suite(path, overrides, data_dir=folder / "data")


@given(raw=SUITES)
def test_a_dumped_suite_loads_equal(folder: Path, raw: dict[str, Any]) -> None:
    spec = SUITE_MODEL.model_validate(raw)
    dumped = spec.model_dump(mode="json")
    again = yaml.dump(dumped, Dumper=CoreDumper, allow_unicode=True)
    for text in (again, json.dumps(dumped), json.dumps(raw)):
        assert load(folder, text).model_dump() == spec.model_dump()


@given(raw=SUITES)
def test_identity_is_json_and_holds_no_bounds(raw: dict[str, Any]) -> None:
    spec = SUITE_MODEL.model_validate(raw)
    identity = spec.identity()
    assert json.loads(json.dumps(identity)) == identity
    assert not {"description", "limits", "models", "tables"} & set(identity)
    # A suite that asks for text is the run that it was before there was another format.
    assert identity.get("answer_format", "text") == spec.answer_format
    assert ("answer_format" in identity) == (spec.answer_format != "text")
    kept = {k: v for k, v in raw.items() if k not in ("description", "limits", "tables")}
    assert SUITE_MODEL.model_validate(kept).identity() == identity


@given(raw=SUITES, key=st.sampled_from(["seeds", "levels", "settings", "name"]))
def test_identity_tells_apart_what_matters(raw: dict[str, Any], key: str) -> None:
    changed = {
        "seeds": [7, 8, 9, 10, 11],
        "levels": [4, 3],
        "settings": ["B", "A"],
        "name": "another-name-that-is-longer",
    }
    spec = SUITE_MODEL.model_validate(raw)
    other = SUITE_MODEL.model_validate({**raw, key: changed[key]})
    assert (spec.identity() == other.identity()) == (spec == other)


CHANGES = st.fixed_dictionaries(
    {},
    optional={
        **FIELDS,
        **REQUIRED,
        "images.source": st.sampled_from(["render", "dataset", "renderr"]),
        "tables": st.just(["published"]),
        "models": st.sampled_from(["recorded", ["oracle"], 5]),
        **{
            f"{section}.{name}": values | st.just({"no": "such value"})
            for section, fields in SECTIONS.items()
            for name, values in fields.items()
        },
    },
)


def edited(raw: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """The file as a person would change it, in the order of the --set texts."""
    result = copy.deepcopy(raw)
    for key, value in changes.items():
        section, _, name = key.rpartition(".")
        place = result.setdefault(section, {}) if section else result
        place[name] = value
    return result


def outcome(folder: Path, raw: dict[str, Any], *overrides: str) -> object:
    """The suite, or the set of what is wrong with which field."""
    try:
        return load(folder, json.dumps(raw), *overrides)
    except SpecError as error:
        return {(problem.field, problem.message) for problem in error.problems}


@given(raw=SUITES, changes=CHANGES)
def test_overrides_equal_editing_the_file(
    folder: Path, raw: dict[str, Any], changes: dict[str, Any]
) -> None:
    texts = [f"{key}={json.dumps(value)}" for key, value in changes.items()]
    assert outcome(folder, raw, *texts) == outcome(folder, edited(raw, changes))


@given(raw=SUITES)
def test_a_suite_made_in_python_obeys_the_rules_between_fields(raw: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="recorded replies come with the official data"):
        SUITE_MODEL.model_validate({**raw, "models": "recorded"})


@given(raw=SUITES)
def test_identity_does_not_depend_on_where_things_lie(raw: dict[str, Any]) -> None:
    here = {**raw, "dataset": {"path": "./a"}, "prompt": "a.j2"}
    there = {**raw, "dataset": {"path": "/b"}, "prompt": "b/c.j2"}
    default = {**raw, "dataset": {}, "prompt": "default"}
    identity = SUITE_MODEL.model_validate(here).identity()
    assert SUITE_MODEL.model_validate(there).identity() == identity
    assert SUITE_MODEL.model_validate(default).identity() != identity
