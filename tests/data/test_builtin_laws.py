"""Laws of the project's own format: what is written reads back, and nothing else crashes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from phyblock.data import AssemblyTask, read_builtin
from phyblock.domain import BLOCK_TYPES, COLORS, Block, Candidate, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from tests.data.broken import with_value, write_scenes

LENGTHS = st.floats(-10, 10).map(lambda x: x + 0.0)
ANGLES = st.sampled_from([0.0, 45.0, 90.0, 180.0, 270.0, -90.0, 12.5])
NAMES = st.from_regex(r"\A[A-Za-z0-9][A-Za-z0-9._-]{0,20}\Z")


@st.composite
def tasks(draw: st.DrawFn) -> AssemblyTask:
    """Any valid scene, with the candidates it needs and some that it does not."""
    n = draw(st.integers(1, 8))
    blocks: list[Block] = []
    orders = draw(st.lists(st.integers(1, 99), min_size=n, max_size=n, unique=True))
    for order in orders:
        carriers = (
            draw(st.lists(st.sampled_from(blocks), unique=True, max_size=3)) if blocks else []
        )
        blocks.append(
            Block(
                order,
                draw(st.sampled_from(BLOCK_TYPES)),
                draw(st.sampled_from(COLORS)),
                draw(st.tuples(LENGTHS, LENGTHS, LENGTHS)),
                draw(st.tuples(ANGLES, ANGLES, ANGLES)),
                tuple(block.order for block in carriers),
                1 + max((block.layer for block in carriers), default=0),
            )
        )
    extra = st.builds(
        Candidate,
        st.sampled_from(BLOCK_TYPES),
        st.sampled_from(COLORS),
        st.tuples(ANGLES, ANGLES, ANGLES),
    )
    wanted = [Candidate(b.type, b.color, b.euler_deg) for b in blocks]
    distinct = {c.look: c for c in wanted + draw(st.lists(extra, max_size=8))}
    candidates = CandidateSet(tuple(draw(st.permutations(list(distinct.values())))))
    levels = draw(st.sampled_from([(1,), (2,), (3,), (4,), (1, 2)]))
    parents = tuple(draw(st.lists(NAMES, min_size=1, max_size=2)))
    file_order = tuple(draw(st.permutations(blocks)))
    return AssemblyTask(Scene(draw(NAMES), levels, file_order, parents), candidates)


def as_json(task: AssemblyTask) -> dict[str, Any]:
    scene = task.scene
    return {
        "id": scene.id,
        "levels": scene.levels,
        "parents": scene.parents,
        "blocks": [
            {
                "order": block.order,
                "type": block.type,
                "color": block.color,
                "layer": block.layer,
                "depend": block.depend or [0],
                "position": block.position_m,
                "euler": block.euler_deg,
            }
            for block in scene.blocks
        ],
        "candidates": [
            {"type": c.type, "color": c.color, "euler": c.euler_deg, "required": 1}
            for c in task.candidates.candidates
        ],
    }


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(written=st.lists(tasks(), min_size=1, max_size=3, unique_by=lambda task: task.scene.id))
def test_any_valid_scene_reads_back_equal(tmp_path: Path, written: list[AssemblyTask]) -> None:
    read = read_builtin(write_scenes(tmp_path, *map(as_json, written)))
    assert read.tasks == tuple(sorted(written, key=lambda task: task.scene.id))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(task=tasks(), data=st.data())
def test_whatever_stands_in_a_field_is_read_or_refused_with_a_problem(
    tmp_path: Path, task: AssemblyTask, data: st.DataObject
) -> None:
    raw = as_json(task)
    path = data.draw(
        st.sampled_from(
            ["id", "levels", "parents", "blocks", "candidates", "blocks.0", "candidates.0"]
            + [f"blocks.0.{field}" for field in raw["blocks"][0]]
        )
    )
    junk = st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
        max_leaves=8,
    )
    broken = with_value(json.loads(json.dumps(raw)), path, data.draw(junk))
    problems: tuple[Problem, ...] = ()
    try:
        read_builtin(write_scenes(tmp_path, broken))
    except DataError as error:
        problems = error.problems
    assert all(problem.where.endswith("scenes.jsonl:1") for problem in problems)
