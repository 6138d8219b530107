"""What is of one machine is taken out of a bundle, and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from phyblock.bundle.portable import portable_manifest, portable_records
from phyblock.bundle.texts import model_name
from phyblock.records.files import known_records
from phyblock.records.manifest import Manifest
from tests.report.factory import manifest, record

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


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("POST http://10.0.0.5:8000/v1/chat: busy", "POST SERVER busy"),
        ("Cannot connect to host gpu-7.lab:9000 ssl", "Cannot connect to host SERVER ssl"),
        ("host='gpu-7.lab', port=9000", "host='SERVER', port=9000"),
        ("no answer of node12:8001", "no answer of SERVER"),
        ("127.0.0.1 said no, [::1]:80 too", "SERVER said no, SERVER too"),
        (f"The model `{AT_HOME}` does not exist", "The model `Qwen2-VL` does not exist"),
        (f"hosted_vllm/{AT_HOME} failed", "hosted_vllm/Qwen2-VL failed"),
        ("open '/scratch/bob/keys.txt'", "open 'keys.txt'"),
        ("at C:\\Users\\bob\\x.py", "at x.py"),
        ("meta/llama/3 and 1/2: 429, 12:30", "meta/llama/3 and 1/2: 429, 12:30"),
    ],
)
def test_errors_name_no_server_and_no_path(before: str, after: str, tmp_path: Path) -> None:
    line = record(outcome="api_error")
    line["error"]["message"] = before
    named = record(scene="001", provider_model=f"hosted_vllm/{AT_HOME}")
    records = [known_records().validate_python(fields) for fields in (line, named)]
    first, second = portable_records(records, run_manifest(), tmp_path / "run")
    assert first.error is not None
    assert second.reply is not None
    assert first.error.message == after
    assert second.reply.provider_model == "hosted_vllm/Qwen2-VL"
