"""`phyblock scenes complete`: positions become a data set, or are refused with the reason."""

import json
import re

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data.scenes import read_builtin
from phyblock.errors import InputError
from phyblock.making.checks import verify_scene
from phyblock.making.files import check_sums
from phyblock.making.scenes.completing import GivenScene, complete, derived, read_given
from tests.data.broken import with_value, without
from tests.shipped import TASKS
from tests.tracks.conftest import raw_of
from tests.workspace import SCENES

GABLES = [
    {"type": "cube", "color": "red", "position": [0, -0.05, 0.025]},
    {"type": "cube", "color": "red", "position": [0, 0.05, 0.025]},
    {"type": "cuboid3", "color": "yellow", "position": [0, 0, 0.0625], "euler": [0, 0, 90]},
    {"type": "triangle", "color": "orange", "position": [0, -0.0375, 0.075]},
    {"type": "triangle", "color": "orange", "position": [0, 0.0375, 0.075]},
]


def of(*blocks, **fields):
    return GivenScene.model_validate({"id": "mine", "blocks": list(blocks), **fields})


@pytest.mark.parametrize("every", [80, pytest.param(1, marks=pytest.mark.slow)])
def test_scenes_that_are_stripped_come_back(every):
    """Of what a person would write there is no more than where blocks are."""
    for task in TASKS[::every]:
        raw, scene = raw_of(task), task.scene
        blocks = [without(without(one, "depend"), "layer") for one in raw.pop("blocks")]
        assert derived(of(*blocks, **without(raw, "candidates"))) == scene


@given(order=st.permutations(range(5)))
@settings(max_examples=20)
def test_blocks_may_be_listed_in_any_order(order):
    scene = derived(of(*(GABLES[i] for i in order)))
    placed = [(block.order, block.layer, block.depend) for block in scene.blocks]
    assert placed == [(1, 1, ()), (2, 1, ()), (3, 2, (1, 2)), (4, 3, (3,)), (5, 3, (3,))]


def put(number, *place_m):
    return with_value(GABLES, (number, "position"), place_m)


@pytest.mark.parametrize(
    ("blocks", "said"),
    [
        (put(2, 0, 0, 0.0605), "block 3 overlaps block 1 by 2.00 mm"),
        (put(0, 0, -0.05, 0.023), "block 1 overlaps the ground by 2.00 mm"),
        (put(4, 0, 0.0375, 0.085), "block 5 floats 10.00 mm above its support"),
        (put(4, 0, 0.1175, 0.075), "floats"),
        (put(2, 0, 0.02, 0.0625)[:3:2], "block 2 falls"),
        ([*put(0, 0, 0, 0.025)[0:3:2], put(0, 0, -0.07, 0.1)[0], put(0, 0, 0.07, 0.1)[0]],
         "hint: list blocks so that each can be placed"),
    ],
)  # fmt: skip
def test_what_cannot_be_built_is_refused(blocks, said):
    problems = complete((of(*blocks), "mine.yaml:3:1")).problems
    assert any(said in str(problem) for problem in problems)
    assert all(problem.where == "mine.yaml:3:1" for problem in problems)


def test_what_is_unusual_is_noted_and_what_is_given_wrong_is_derived():
    blocks = [*GABLES[:2], {**GABLES[2], "depend": [1], "layer": 3, "order": 1}, *GABLES[3:]]
    done = complete((of(*blocks, levels=[1]), "here"))
    assert done.scene.levels == (1,)
    assert (done.scene.blocks[2].depend, done.scene.blocks[2].layer) == ((1, 2), 2)
    assert done.notes == ("scene mine: wrong size, 5, 1 to 4 at level 1",)


ONE = {"id": "gables", "blocks": GABLES}
FORMS = {
    "one.yaml": yaml.safe_dump(ONE),
    "list.yml": yaml.safe_dump([ONE]),
    "named.json": json.dumps({"scenes": [ONE]}),
    "gables.json": json.dumps({"blocks": GABLES}),
}


@pytest.mark.parametrize("form", FORMS)
def test_scenes_are_read_in_any_form(tmp_path, form):
    path = tmp_path / form
    path.write_text(FORMS[form], encoding="utf-8")
    ((given, _),) = read_given(path)
    assert (given.id, given.blocks) == ("gables", of(*GABLES).blocks)


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
    with pytest.raises(InputError, match=re.escape(said)):
        read_given(path)


def test_what_is_completed_is_a_data_set_beside_its_source(workspace):
    """The tutorial of the first scenes validates and runs one."""
    tower = without(without(SCENES[0], "levels"), "parents")
    source = workspace.write_yaml("gables.yaml", {"scenes": [ONE, tower | {"id": "tower"}]})
    before = source.read_bytes()
    workspace.does("scenes", "complete", "gables.yaml", "--jobs", "1")
    folder = workspace.root / "gables-set"
    gables, tower = read_builtin(folder).tasks
    assert (len(gables.candidates), len(tower.candidates)) == (16, 16)
    assert [c.look for c in tower.candidates.candidates][:1] == [tower.scene.blocks[0].look]
    assert not verify_scene(gables)
    assert check_sums(folder) == (3, ())
    assert source.read_bytes() == before
    again = workspace.phyblock("scenes", "complete", "gables.yaml", "--jobs", "1")
    assert (again.code, "give another --out" in again.err) == (2, True)
