"""The reader of scenes: what is sound reads back, what is broken is named in few words."""

import contextlib
import json
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data.official import read_candidates
from phyblock.data.scenes import StoredScene, read_builtin
from phyblock.domain import scene as domain
from phyblock.domain.blocks import BLOCK_TYPES, COLORS
from phyblock.errors import DataError
from tests.data.broken import sound_scene, with_value, without, write_scenes
from tests.fuzz.strategies import CANDIDATES, SCENES

SCENE = sound_scene()
CUBE, ARCH = SCENE["blocks"]
LENGTHS = st.floats(-10, 10).map(lambda x: round(x, 6) + 0.0)
ANGLES = st.sampled_from([0.0, 45.0, 90.0, 180.0, 270.0, -90.0, 12.5])
LOOKS = st.builds(
    domain.Candidate,
    st.sampled_from(BLOCK_TYPES),
    st.sampled_from(COLORS),
    st.tuples(ANGLES, ANGLES, ANGLES),
)
NAMES = st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9._-]{0,20}\Z")


def problems_of(folder):
    with pytest.raises(DataError) as caught:
        read_builtin(folder)
    return caught.value.problems


def test_the_digest_tells_scenes_apart_but_not_spellings_or_orders_of_lines(tmp_path):
    def digest(*scenes):
        return read_builtin(write_scenes(tmp_path, *scenes)).sha256

    same = with_value(SCENE, "blocks.0.position", [-0.0, 0.0, 25e-3])
    moved = with_value(SCENE, "blocks.0.position", [0.001, 0, 0.025])
    turned = with_value(SCENE, "candidates.1.euler", [0, 90, 0])
    assert len({digest(SCENE), digest(same), digest(moved), digest(turned)}) == 3
    assert digest(SCENE) == digest(same)
    scenes = [{**SCENE, "id": name} for name in ("c", "a", "b")]
    assert digest(*scenes[:2]) != digest(*scenes[::-1]) == digest(*scenes)
    assert [task.scene.id for task in read_builtin(tmp_path).tasks] == ["a", "b", "c"]


def test_either_name_of_an_orientation_and_any_end_of_a_line_are_read(tmp_path):
    tasks = read_builtin(write_scenes(tmp_path, SCENE)).tasks
    blocks = [{**without(one, "euler"), "orientation": one["euler"]} for one in SCENE["blocks"]]
    assert read_builtin(write_scenes(tmp_path, {**SCENE, "blocks": blocks})).tasks == tasks
    # Unicode's own line ends inside a string end no line.
    scenes = [{**SCENE, "id": name, "note": "a\u2028b\x85c"} for name in "ab"]
    lines = [json.dumps(scene, ensure_ascii=False) for scene in scenes]
    for text in ("\n".join(lines), "\r\n".join(lines) + "\r\n"):
        (tmp_path / "scenes.jsonl").write_bytes(text.encode())
        assert len(read_builtin(tmp_path).tasks) == 2


BROKEN_VALUES = [
    # path, value, field of the problem
    *(("id", value, "id") for value in (3, "../s1", "a\nb")),
    *(("levels", value, "levels") for value in ([6], [1, 3], [])),
    ("levels", [True], "levels[0]"),
    ("parents", [3], "parents[0]"),
    ("parents", [], "parents"),
    ("blocks", [], "blocks"),
    ("blocks.1", [1], "blocks[1]"),
    *(("blocks.0.order", value, "blocks[0].order") for value in (0, True, 10_000)),
    *(("blocks.1.order", value, "blocks[1].order") for value in (2.5, 1)),
    ("blocks.1.type", "arc", "blocks[1].type"),
    ("blocks.0.color", "pink", "blocks[0].color"),
    *(("blocks.0.layer", value, "blocks[0].layer") for value in (0, 10**18)),
    ("blocks.1.layer", 1, "blocks[1].layer"),
    ("blocks.0.position", [0, 0, float("nan")], ""),
    ("blocks.0.position", [0, 0, 1e999], ""),
    ("blocks.0.position", [0, 0, "1"], "blocks[0].position[2]"),
    ("blocks.0.position", [0, 0], "blocks[0].position"),
    ("blocks.0.position", [101, 0, 0], "blocks[0].position[0]"),
    ("blocks.1.euler", [0, 0, True], "blocks[1].euler[2]"),
    ("blocks.1.euler", [0, 0, 1e9], "blocks[1].euler[2]"),
    *(("blocks.1.depend", value, "blocks[1].depend") for value in ([7], [], [2])),
    ("blocks.0.depend", [2], "blocks[0].depend"),
    ("blocks.1.depend", [10**18], "blocks[1].depend[0]"),
    ("candidates", [], "candidates"),
    ("candidates.1.euler", [0, 0, 270], "candidates[2]"),
    ("candidates.0.type", "cuboid", "candidates[0].type"),
    ("candidates.2.color", "blue", "candidates"),
    ("format", 2, "format"),
]


@pytest.mark.parametrize(("path", "value", "field"), BROKEN_VALUES)
def test_a_broken_value_is_named_with_file_line_and_field(tmp_path, path, value, field):
    sound = {**SCENE, "id": "s0"}
    (problem,) = problems_of(write_scenes(tmp_path, sound, with_value(SCENE, path, value)))
    assert (problem.where, problem.field) == (f"{tmp_path / 'scenes.jsonl'}:2", field)
    assert problem.found or not field


def test_a_missing_field_is_said_once(tmp_path):
    blocks = [f"blocks.0.{field}" for field in CUBE]
    candidates = [f"candidates.1.{field}" for field in ("type", "color", "euler")]
    for path in (*SCENE, *blocks, *candidates):
        (problem,) = problems_of(write_scenes(tmp_path, without(SCENE, path)))
        field = path.replace(".0.", "[0].").replace(".1.", "[1].")
        assert (problem.field, problem.message) == (field, "is missing")


def test_everything_that_is_wrong_is_said_at_once(tmp_path):
    first = with_value(SCENE | {"levels": [9]}, "blocks.0.depend", [2])
    first = with_value(first, "candidates.0.color", "pink")
    second = with_value(SCENE | {"id": "s2"}, "blocks.1.layer", 7)
    found = problems_of(write_scenes(tmp_path, first, second, *[SCENE | {"id": "s3"}] * 2))
    assert [f"{p.where.rpartition(':')[2]} {p.field}" for p in found] == [
        *("1 levels", "1 blocks[0].depend", "1 candidates[0].color", "2 blocks[1].layer", "4 id")
    ]
    assert "jsonl:3" in found[-1].message
    (tmp_path / "scenes.jsonl").write_text("x\n" * 200_000)
    assert len(problems_of(tmp_path)) == 1_002


MANY = [
    ("blocks", [CUBE] * 41),
    ("blocks", [CUBE] * 2_000),
    ("candidates", SCENE["candidates"][:1] * 17),
    ("candidates", [1] * 20_000),
    ("levels", [1] * 20_000),
    ("parents", ["x/"] * 20_000),
    ("blocks.0.depend", [1] * 20_000),
]


@pytest.mark.parametrize(("at", "value"), MANY, ids=range(len(MANY)))
def test_a_list_that_is_too_long_is_refused_in_few_words(tmp_path, at, value):
    found = problems_of(write_scenes(tmp_path, with_value(SCENE, at, value)))
    assert len(found) <= 100
    assert all(problem.allowed for problem in found)
    assert {problem.field.partition("[")[0] for problem in found} == {at.partition(".")[0]}


BROKEN_TEXTS = [
    # bytes, what stands after the file name in `where`, words of the message
    (b"", "", "holds no scenes"),
    ("{}".encode("utf-16"), "", "holds no scenes"),
    (b"\n\n", ":1:1", "not JSON"),
    (b'{"id": "s1" 7}', ":1:13", "not JSON"),
    (b'{"id": "s1", "levels": [', ":1:25", "not JSON"),
    (b"{} {}", ":1:4", "not JSON"),
    (b"\xef\xbb\xbf{}", ":1:1", "not JSON"),
    (b"[]", ":1", "wrong type"),
    (b"null", ":1", "wrong type"),
    (b'{"id": "\xff"}', ":1", "UTF-8"),
    (b'{"id": ' + b"1" * 5000 + b"}", ":1", "of 5,000 digits"),
    (b"[" * 200_000, ":1", "nested more than 64 levels"),
    (b"[" * 80 + b"]" * 80, ":1", "nested more than 64 levels"),
]


@pytest.mark.parametrize(("data", "place", "message"), BROKEN_TEXTS, ids=range(len(BROKEN_TEXTS)))
def test_a_broken_text_is_named_with_its_place(tmp_path, data, place, message):
    (tmp_path / "scenes.jsonl").write_bytes(data)
    problem = problems_of(tmp_path)[0]
    assert problem.where == f"{tmp_path / 'scenes.jsonl'}{place}"
    assert message in problem.message


def test_a_missing_file_and_what_is_no_file_are_named(tmp_path):
    with pytest.raises(DataError, match=r"scenes\.jsonl: .*No such file(?s:.*)bundled"):
        read_builtin(tmp_path)
    os.mkfifo(tmp_path / "scenes.jsonl")
    with pytest.raises(DataError, match=r"scenes\.jsonl: .*is not a regular file"):
        read_builtin(tmp_path)


@st.composite
def tasks(draw):
    """Any valid scene, with the candidates it needs and some that it does not."""
    offered = draw(st.lists(LOOKS, min_size=1, max_size=16, unique_by=lambda one: one.look))
    blocks = []
    for order in draw(st.lists(st.integers(1, 99), min_size=1, max_size=8, unique=True)):
        some = st.lists(st.sampled_from(blocks), unique=True, max_size=3) if blocks else st.just([])
        carriers, one = draw(some), draw(st.sampled_from(offered))
        place_m = draw(st.tuples(LENGTHS, LENGTHS, LENGTHS))
        depend = tuple(block.order for block in carriers)
        layer = 1 + max((block.layer for block in carriers), default=0)
        # A whole turn more looks the same.
        turn = (*one.euler_deg[:2], one.euler_deg[2] - draw(st.sampled_from([0.0, 360.0])))
        blocks.append(domain.Block(order, *one.kind, place_m, turn, depend, layer))
    levels = draw(st.sampled_from([(1,), (2,), (3,), (4,), (1, 2)]))
    parents = tuple(draw(st.lists(NAMES, min_size=1, max_size=2)))
    scene = domain.Scene(draw(NAMES), levels, tuple(draw(st.permutations(blocks))), parents)
    return domain.AssemblyTask(scene, domain.CandidateSet(tuple(offered)))


@given(written=st.lists(tasks(), min_size=1, max_size=3, unique_by=lambda task: task.scene.id))
def test_any_valid_scene_reads_back_equal(tmp_path_factory, written):
    folder = tmp_path_factory.getbasetemp()
    lines = [StoredScene.of(task.scene, task.candidates).as_json() for task in written]
    (folder / "scenes.jsonl").write_text("\n".join(lines), encoding="utf-8")
    read = read_builtin(folder)
    assert read.tasks == tuple(sorted(written, key=lambda task: task.scene.id))


@settings(max_examples=40)
@given(SCENES)
def test_any_scene_is_read_or_refused(tmp_path_factory, line):
    folder = tmp_path_factory.getbasetemp()
    (folder / "scenes.jsonl").write_bytes(line)
    with contextlib.suppress(DataError):
        for task in read_builtin(folder).tasks:
            assert max(map(abs, (x for b in task.scene.blocks for x in b.position_m))) <= 100


@settings(max_examples=40)
@given(CANDIDATES)
def test_any_candidate_set_is_read_or_refused(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "c.json"
    path.write_bytes(data)
    with contextlib.suppress(DataError):
        assert 1 <= len(read_candidates(path)) <= domain.MAX_CANDIDATES
