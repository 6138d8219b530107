"""What users bring: prompts beside the suite, modules that add to tracks."""

import pytest

from tests.servers.openai_chat import OpenAIChat


def test_a_prompt_beside_the_suite_is_used(workspace):
    (workspace.root / "prompts").mkdir()
    text = "{% block user %}Which of the {{ n_candidates }}?{% endblock %}"
    (workspace.root / "prompts" / "full_planning.j2").write_text(text, encoding="utf-8")
    with workspace.served(OpenAIChat()) as server:
        workspace.completed()
    assert {seen.parts[-1] for seen in server.seen} == {"Which of the 16?"}


@pytest.mark.parametrize("suite", ["quick", "steps", "vqa", "sensitivity"])
def test_what_init_lays_out_is_sound_and_its_prompts_are_used(workspace, suite):
    workspace.does("init", "mine", "--suite", suite)
    root = workspace.root / "mine"
    workspace.write_yaml("mine/models.yaml", {"alpha": "openai/some-model"})
    prompts = sorted((root / "prompts").glob("*.j2"))
    prompt = prompts[0]
    assert prompt.with_name(f"{prompt.stem}_json.j2") in prompts
    words = ("run", f"mine/benchmarks/{suite}.yaml", "--models", "alpha", "--limit", "3")
    words += ("--dry-run", "--models-file", "mine/models.yaml")
    out = workspace.does(*words).out
    assert "calls, unknown cost of 1 model" in out
    assert "would not begin:\nmine/models.yaml:1:8: alpha.id: needs an API key" in out
    prompt.write_text("{% block user %}{{ gone }}{% endblock %}", encoding="utf-8")
    assert f"prompts/{prompt.name}:1: block user: " in workspace.phyblock(*words).err


PLUGIN = """
from phyblock.registry import add_baseline

def backwards(subject, rng):
    return "Step1: Move block with index 16"

add_baseline("full_planning", "backwards", backwards)
"""


def test_a_module_is_loaded_by_its_name_or_by_an_entry_point(workspace):
    workspace.write_suite(models=["backwards"])
    (workspace.root / "mine.py").write_text(PLUGIN, encoding="utf-8")
    words = ("run", "suite.yaml", "--out", "named", "--no-report")
    workspace.does("--plugin", "mine", *words, fresh=True)
    about = workspace.root / "mine-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[phyblock.plugins]\nmine = mine\n")
    path = f"{workspace.env['PYTHONPATH']}:{workspace.root}"
    workspace.completed(env={"PYTHONPATH": path}, fresh=True)
    plans = {tuple(record["parse"]["plan"]) for record in workspace.records()}
    assert plans == {(16,)}
    (workspace.root / "mine.py").write_text("1 / 0\n", encoding="utf-8")
    done = workspace.run(env={"PYTHONPATH": path}, fresh=True)
    assert done.code == 2
    assert "plugin mine: cannot be imported: ZeroDivisionError" in done.err
    assert "mine.py:1" in done.err
