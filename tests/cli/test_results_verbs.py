"""The verbs that read a finished run: report, compare, figures, export."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from phyblock.cli.main import phyblock
from phyblock.errors import SpecError, StoreError
from tests.web.factory import LEVELS, manifest, record, score, write_run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    records = [
        record(model, scene, seed, [score(tp, 4 - tp, 4 - tp), score(tp, 0, 1, setting="B")])
        for model, tp in (("alpha", 4), ("beta", 1))
        for scene in LEVELS
        for seed in (0, 1)
    ]
    facts = manifest(models=[("alpha", "GPT-4.1"), "beta"])
    return write_run(tmp_path / "run", records, facts)


def call(*words: str | Path) -> Result:
    return CliRunner().invoke(phyblock, [str(word) for word in words], catch_exceptions=False)


def test_tables_print_all_or_one_in_any_form(folder: Path) -> None:
    everything = call("report", folder, "--print").output
    for caption in ("Assembly planning", "Wrong steps by type", "Coverage", "Tokens, cost"):
        assert caption in everything
    one = call("report", folder, "--print", "--only", "errors", "--format", "md").output
    assert one.startswith("**Wrong steps by type (%)")
    assert (
        r"\begin{tabular}"
        in call("report", folder, "--print", "--only", "cost", "--format", "tex").output
    )
    with pytest.raises(SpecError, match="no such table"):
        call("report", folder, "--print", "--only", "table9")
    assert not (folder / "tables").exists()


def test_compare_says_the_verdict(folder: Path, tmp_path: Path) -> None:
    done = call("compare", folder, "--models", "alpha,beta", "--out", tmp_path / "out")
    # Five base scenes are too few for five comparisons.
    assert "cannot tell" in done.output
    assert (tmp_path / "out" / "comparison.tex").exists()
    assert call("compare", folder, "--track", "full_planning").output.startswith("Models compared")
    with pytest.raises(SpecError, match="no such track to compare"):
        call("compare", folder, "--track", "vqa")
    with pytest.raises(SpecError, match="no such model"):
        call("compare", folder, "--models", "alpha,delta")
    with pytest.raises(SpecError, match="a model twice"):
        call("compare", folder, "--models", "alpha,alpha")
    assert "empty name" in call("compare", folder, "--models", "alpha,").output
    with pytest.raises(StoreError, match=r"holds no run\.yaml"):
        call("compare", folder, tmp_path)


def test_figures_and_exports_name_what_they_wrote(folder: Path) -> None:
    done = call("figures", folder, "--only", "errors")
    assert done.output.split() == [
        str(folder / "paper" / f"errors.{e}") for e in ("pdf", "svg", "png", "txt", "tex")
    ]
    done = call("figures", folder, "--only", "losses", "--models", "alpha", "--out", folder / "x")
    assert (folder / "x" / "losses.pdf").is_file()
    for wrong in ("--width wide", "--width 20", "--font comic"):
        refused = call("figures", folder, *wrong.split())
        assert refused.exit_code == 2, wrong
        assert "Invalid value" in refused.output
    with pytest.raises(SpecError, match="no such model"):
        call("figures", folder, "--models", "omega")
    with pytest.raises(SpecError, match="no such figure"):
        call("figures", folder, "--only", "radar")
    for ignored in ((folder, "--to", "csv", "--limit", 3), ("--to", "lmms-eval", "--data", "no")):
        refused = call("export", *ignored, "--out", folder / "x")
        assert (refused.exit_code, "leave it out" in refused.output) == (2, True)
    done = call("export", folder, "--to", "csv")
    assert done.output.strip() == str(folder / "export" / "csv" / "records.csv")
