"""`phyblock scenes complete`: positions become a data set, or are refused with the reason."""

import json

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data.scenes import read_builtin
from phyblock.errors import DataError
from phyblock.making.checks import verify_scene
from phyblock.making.files import check_sums
from phyblock.making.scenes.completing import GivenScene, ReadScene, complete, derived, read_given
from tests.shipped import TASKS
from tests.workspace import SCENES, write_lines

GABLES = [
    {"type": "cube", "color": "red", "position": [0, -0.05, 0.025]},
    {"type": "cube", "color": "red", "position": [0, 0.05, 0.025]},
    {"type": "cuboid3", "color": "yellow", "position": [0, 0, 0.0625], "euler": [0, 0, 90]},
    {"type": "triangle", "color": "orange", "position": [0, -0.0375, 0.075]},
    {"type": "triangle", "color": "orange", "position": [0, 0.0375, 0.075]},
]


def stripped(scene):
    """Return a scene as a person would write it: no more than where its blocks are."""
    blocks = [
        {"order": b.order, "type": b.type, "color": b.color, "position": place, "euler": turn}
        for b in scene.blocks
        for place, turn in [(list(b.position_m), list(b.euler_deg))]
    ]
    about = {"levels": list(scene.levels), "parents": list(scene.parents)}
    return GivenScene.model_validate({"id": scene.id, **about, "blocks": blocks})


def of(*blocks, **fields):
    return GivenScene.model_validate({"blocks": list(blocks), **fields})


@pytest.mark.parametrize("every", [80, pytest.param(1, marks=pytest.mark.slow)])
def test_scenes_that_are_stripped_come_back(every):
    for scene in (task.scene for task in TASKS[::every]):
        assert derived(scene.id, stripped(scene), scene.id) == scene


@given(order=st.permutations(range(5)))
@settings(max_examples=20)
def test_blocks_may_be_listed_in_any_order(order):
    scene = derived("gables", of(*(GABLES[i] for i in order)), "here")
    assert [block.order for block in scene.blocks] == [1, 2, 3, 4, 5]
    assert scene.graph.is_valid(range(5))
    assert [block.layer for block in scene.blocks] == [1, 1, 2, 3, 3]
    (deck,) = (block for block in scene.blocks if block.type == "cuboid3")
    assert set(deck.depend) == {1, 2}


def moved(number, *by_m):
    block = {**GABLES[number]}
    block["position"] = [at + by for at, by in zip(block["position"], by_m, strict=True)]
    return [*GABLES[:number], block, *GABLES[number + 1 :]]


@pytest.mark.parametrize(
    ("blocks", "said"),
    [
        (moved(2, 0, 0, -0.002), "block 3 overlaps block 1 by 2.00 mm"),
        (moved(0, 0, 0, -0.002), "block 1 overlaps the ground by 2.00 mm"),
        (moved(4, 0, 0, 0.01), "block 5 floats 10.00 mm above its support"),
        (moved(4, 0, 0.08, 0), "floats"),
        ([GABLES[0], {**GABLES[2], "position": [0, 0.02, 0.0625]}], "block 2 falls"),
        ([{**GABLES[0], "order": 1}, {**GABLES[1], "order": 1}], "a unique order for every block"),
        ([GABLES[0], {**GABLES[1], "order": 1}], "a unique order for every block"),
        ([{**GABLES[2], "order": 1}, {**GABLES[0], "order": 2}, {**GABLES[1], "order": 3}],
         "hint: order blocks so that each can be placed"),
    ],
)  # fmt: skip
def test_what_cannot_be_built_is_refused(blocks, said):
    problems = complete(ReadScene("mine", of(*blocks), "mine.yaml:3:1")).problems
    assert any(said in str(problem) for problem in problems)
    assert all(problem.where == "mine.yaml:3:1" for problem in problems)


def test_what_is_unusual_is_noted_and_what_is_given_wrong_is_derived():
    blocks = [*GABLES[:2], {**GABLES[2], "depend": [1], "layer": 3}, *GABLES[3:]]
    done = complete(ReadScene("mine", of(*blocks, levels=[1]), "here"))
    assert done.scene.levels == (1,)
    assert (done.scene.blocks[2].depend, done.scene.blocks[2].layer) == ((1, 2), 2)
    assert done.notes == ("wrong size, 5, 1 to 4 at level 1",)


@pytest.mark.parametrize("form", ["one.yaml", "list.yml", "named.json", "lines.jsonl", "folder"])
def test_scenes_are_read_in_any_form(tmp_path, form):
    one = {"id": "gables", "blocks": GABLES}
    path = tmp_path / form
    if form == "one.yaml":
        path.write_text(yaml.safe_dump(one), encoding="utf-8")
    elif form == "list.yml":
        path.write_text(yaml.safe_dump([one]), encoding="utf-8")
    elif form == "named.json":
        path.write_text(json.dumps({"scenes": [one]}), encoding="utf-8")
    elif form == "lines.jsonl":
        write_lines(path, [one])
    else:
        path.mkdir()
        (path / "gables.json").write_text(json.dumps({"blocks": GABLES}), encoding="utf-8")
    (read,) = read_given(path)
    assert read.name == "gables"
    assert read.given.blocks == of(*GABLES).blocks


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("blocks:\n  - {type: cube, color: red}\n", "yaml:2:5: blocks[0].position: is missing"),
        ("blocks:\n  - {type: cube, color: rot, position: [0, 0, 0]}\n", "mine.yaml:2:25"),
        ("blocks:\n  - {type: cube, color: red, positon: [0, 0, 0]}\n", "positon: is not a"),
        ("blocks: [\n", "mine.yaml"),
        ("", "has the wrong type"),
        ("[{id: a, blocks: [{type: cube, color: red, position: [0, 0, 0.025]}]},"
         " {id: a, blocks: [{type: cube, color: red, position: [0, 0, 0.025]}]}]", "is used by"),
    ],
)  # fmt: skip
def test_a_file_that_is_wrong_is_said_with_its_line(tmp_path, text, said):
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError) as caught:
        read_given(path)
    assert said in str(caught.value)


def test_what_is_completed_is_a_data_set_beside_its_source(workspace):
    """The tutorial of the first scenes validates and runs one."""
    source = workspace.write_yaml("gables.yaml", {"scenes": [
        {"id": "gables", "blocks": GABLES},
        {"id": "tower", "blocks": [{k: v for k, v in block.items() if k not in ("depend", "layer")}
                                   for block in SCENES[0]["blocks"]],
         "candidates": SCENES[0]["candidates"]},
    ]})  # fmt: skip
    before = source.read_bytes()
    workspace.does("scenes", "complete", "gables.yaml", "--jobs", "1")
    folder = workspace.root / "gables-set"
    gables, tower = read_builtin(folder).tasks
    assert (len(gables.candidates), len(tower.candidates)) == (16, 16)
    assert [c.look for c in tower.candidates.candidates][:1] == [tower.scene.blocks[0].look]
    assert not verify_scene((gables.scene, gables.candidates))
    assert check_sums(folder) == (3, ())
    assert source.read_bytes() == before
    again = workspace.phyblock("scenes", "complete", "gables.yaml", "--jobs", "1")
    assert (again.code, "give another --out" in again.err) == (2, True)
