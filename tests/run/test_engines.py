"""Suites in either physics engine."""

from __future__ import annotations

import json

import pytest
import yaml

from phyblock.cli.main import phyblock
from phyblock.errors import SpecError
from phyblock.results.compare import compare_runs
from phyblock.results.load import load_run
from phyblock.run.rescore import rescore
from phyblock.sim.engine import ENGINES, described_engine, installed_engines
from tests.workspace import Raw, Workspace, candidates

SMALL = ("--set", "images.size_px=128", "--set", "seeds=[0]", "--no-report")
DATA = ("--set", "dataset.path=./data")


def unsteady_scene() -> Raw:
    """A plank that tips off its post until the second weight is on."""
    places = [("cube", [0, 0, 0.025], 0), ("cuboid3", [0, 0, 0.0625], 90)]
    places += [("cube", [0, 0.07, 0.1], 0), ("cube", [0, -0.07, 0.1], 0)]
    depends = [[0], [1], [2], [2]]
    blocks = [
        {
            "order": order,
            "type": block_type,
            "color": "red",
            "layer": min(order, 3),
            "depend": depends[order - 1],
            "position": position,
            "euler": [0, 0, turn],
        }
        for order, (block_type, position, turn) in enumerate(places, 1)
    ]
    plank = {"type": "cuboid3", "color": "red", "euler": [0, 0, 90], "required": 1}
    cubes = {**candidates()[0], "required": 3}
    others = [{**one, "required": 0} for one in candidates()[1:15]]
    named = {"id": "beam", "levels": [3], "parents": ["beam"]}
    return {**named, "blocks": blocks, "candidates": [cubes, plank, *others]}


@pytest.mark.skipif(len(installed_engines()) < 2, reason="one engine is installed")
def test_runs_in_two_engines_are_scored_anywhere_and_never_compared(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Falls are read from the records, whichever engine is here now."""
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    workspace.write_scenes(unsteady_scene())
    suite = ("--models", "oracle", *SMALL, *DATA, "--set", "steps.physics=strict")
    usual, other = (workspace.root / name for name in ENGINES)
    endings, names = {}, []
    for out in (usual, other):
        monkeypatch.setenv("PHYBLOCK_PHYSICS", out.name)
        names.append(described_engine())
        phyblock.main(["run", "steps", "--out", str(out), *suite], standalone_mode=False)
        manifest = yaml.safe_load((out / "run.yaml").read_bytes())
        (record,) = map(json.loads, (out / "records.jsonl").read_text().splitlines())
        assert record["engine"] == manifest["engine"]
        endings[manifest["engine"]] = record["ending"]
    assert endings == dict.fromkeys(names, "collapsed")

    scored = rescore(usual, None, None, None)
    assert (scored / "records.jsonl").read_text() == (usual / "records.jsonl").read_text()
    runs = [load_run(out) for out in (usual, other)]
    with pytest.raises(SpecError, match="physics: cannot be compared"):
        compare_runs(*runs, ())


def test_an_unknown_engine_is_refused_before_anything_is_made(workspace: Workspace) -> None:
    args = ("--out", workspace.out, "--models", "oracle", *SMALL, *DATA)
    done = workspace.phyblock("run", "steps", *args, env={"PHYBLOCK_PHYSICS": "bullet"})
    assert done.code == 2
    assert done.errors == [
        "error: PHYBLOCK_PHYSICS: is not known\n    found: bullet\n"
        f"    allowed: {', '.join(ENGINES)}"
    ]
    assert not workspace.out.exists()
