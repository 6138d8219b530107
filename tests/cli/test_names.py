"""Models that are named, and that cannot be called as they are."""

from __future__ import annotations

import pytest

from tests.workspace import Workspace


@pytest.mark.parametrize("names", ["", ",", "oracle,,random"])
def test_an_empty_name_does_not_mean_all_models(workspace: Workspace, names: str) -> None:
    workspace.write_suite(models=["oracle", "random"])
    done = workspace.run("--models", names)
    assert done.code == 2
    assert "--models: holds an empty name" in done.err
    assert not workspace.out.exists()


def test_a_server_without_an_address_is_an_error_before_anything_is_asked(
    workspace: Workspace,
) -> None:
    (workspace.root / "models.yaml").write_text("mine: hosted_vllm/some/model\n", encoding="utf-8")
    workspace.write_suite(models=["mine"])
    done = workspace.run()
    assert done.code == 2
    assert "models.yaml:1:7: mine.id: is behind a server of your own" in done.err
    assert not (workspace.out / "records.jsonl").exists()
