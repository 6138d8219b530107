"""What the documentation says of the files of a run is what reads them."""

from __future__ import annotations

import json

import jsonschema
import pytest

from tests.documents import ROOT, make_documents
from tests.records.damage import DAMAGED, lines_before


def test_tables_and_schemas_are_current() -> None:
    for path, text in make_documents().items():
        assert (ROOT / path).read_text(encoding="utf-8") == text, "run python -m tests.documents"


@pytest.fixture(scope="module")
def schema() -> jsonschema.Draft202012Validator:
    text = (ROOT / "benchmarks" / "schemas" / "record.schema.json").read_text(encoding="utf-8")
    jsonschema.Draft202012Validator.check_schema(json.loads(text))
    return jsonschema.Draft202012Validator(json.loads(text))


def test_the_schema_takes_records_of_every_track(schema: jsonschema.Draft202012Validator) -> None:
    for line in lines_before():
        schema.validate(json.loads(line))


@pytest.mark.parametrize("name", ["huge-number", "number-for-text", "word", "score", "track"])
def test_the_schema_refuses_what_the_models_refuse(
    schema: jsonschema.Draft202012Validator, name: str
) -> None:
    assert not schema.is_valid(json.loads(DAMAGED[name][0]))
