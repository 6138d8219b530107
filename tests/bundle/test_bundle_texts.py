"""Texts of one machine are taken out of a bundle, and nothing else."""

from __future__ import annotations

import json
from typing import Any

import pytest

from phyblock.bundle import model_name, portable, portable_manifest
from phyblock.records.files import known_records
from phyblock.records.manifest import Manifest
from tests.web.factory import manifest, record

SERVERS = ["http://10.0.0.5:8000/v1", "http://gpu-7.lab:9000/v1"]
AT_HOME = "/srv/models/Qwen2-VL"


def run_manifest(**more: Any) -> Manifest:
    fields = manifest(models=["alpha"])
    fields["models"] = [{**fields["models"][0], "kind": "litellm", "served_at": SERVERS, **more}]
    return Manifest.model_validate(fields)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (AT_HOME, "Qwen2-VL"),
        (f"hosted_vllm/{AT_HOME}", "hosted_vllm/Qwen2-VL"),
        ("hosted_vllm/~/Qwen", "hosted_vllm/Qwen"),
        ("D:\\models\\Qwen", "Qwen"),
        ("openai/gpt-4o", "openai/gpt-4o"),
        ("hosted_vllm/Qwen/Qwen2-VL", "hosted_vllm/Qwen/Qwen2-VL"),
    ],
)
def test_models_that_are_called_by_their_path_keep_its_last_part(before: str, after: str) -> None:
    assert model_name(before) == after
    one = run_manifest(id=before)
    found = portable_manifest(one)
    assert found.models[0].fields()["id"] == after
    assert found.identity == one.identity
    assert not found.models[0].served_at


def test_what_is_sent_to_a_model_stays_as_it_is() -> None:
    params = {"stop": ["/no_think", "/a/b"], "extra_body": {"path": "/v1/x"}}
    found = portable_manifest(run_manifest(id="openai/x", params=params))
    assert found.models[0].fields()["params"] == params


def test_a_failed_request_keeps_its_kind_alone_and_a_model_the_end_of_its_path() -> None:
    line = record(outcome="api_error")
    line["error"] |= {"message": "POST http://10.0.0.5:8000/v1/chat: open '/scratch/bob/keys.txt'"}
    named = record(scene="001", provider_model=f"hosted_vllm/{AT_HOME}")
    first, second = (portable(known_records().validate_python(fields)) for fields in (line, named))
    assert first.error is not None
    assert second.reply is not None
    assert json.loads(first.as_json()) == {**line, "error": {**line["error"], "message": ""}}
    assert second.reply.provider_model == "hosted_vllm/Qwen2-VL"
