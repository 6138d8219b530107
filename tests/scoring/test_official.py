"""Official and bundled data: known counts, valid orders, averages as they are published."""

import itertools
import math

import numpy as np
import pytest

from phyblock.data.scenes import read_builtin
from phyblock.domain.question import CATEGORIES
from phyblock.domain.scene import Plan
from phyblock.parsing.plan import parse_plan
from phyblock.results.tables import published_table
from phyblock.scoring.plan import AssemblyScorer, Goal, chance, match_plan
from phyblock.scoring.steps import Assembly, gated
from phyblock.types import GATINGS, SETTINGS
from tests.shipped import DATA, official_tasks, reply_texts
from tests.workspace import csv_rows


def test_known_counts_match_row_for_row(official_dir, official_checkout):
    columns = ("model", "scene", "setting", "criterion", "level", "tp", "fp", "fn")
    rows = csv_rows(official_dir / "expected" / "assembly_counts.csv")
    known = {tuple(row[column] for column in columns) for row in rows}
    assert len(known) == len(rows) >= 6250
    models, found = {row[0] for row in known}, set()
    tasks = {task.scene.id: task for task in official_tasks(official_checkout)}
    scorers = {
        name: AssemblyScorer(task.scene, task.candidates, SETTINGS) for name, task in tasks.items()
    }
    for (model, name), text in reply_texts(official_checkout).items():
        plan = parse_plan(text, len(tasks[name].candidates), "official").plan
        for one in scorers[name].score(plan, ("paper",), "membership") if model in models else ():
            level = 1 if one["criterion"] == "membership" else tasks[name].scene.level
            counts = map(str, (level, one["tp"], one["fp"], one["fn"]))
            found.add((model, name, one["setting"], one["criterion"], *counts))
    assert found == known


BUNDLED = sorted(path.parent.name for path in DATA.glob("*/scenes.jsonl"))


@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("source", ["official", *BUNDLED])
def test_valid_orders_score_1_and_none_of_their_moves_fails(source, every, request):
    if source == "official":
        tasks = official_tasks(request.getfixturevalue("official_checkout"))
    else:
        tasks = read_builtin(DATA / source).tasks
    rng = np.random.default_rng(0)
    for task in tasks[::every]:
        scene, graph = task.scene, task.scene.graph
        numbers = [task.candidates.index_of(block.look) for block in scene.blocks]
        assert None not in numbers, scene.id
        goals = [Goal(scene, task.candidates, setting) for setting in SETTINGS]
        for order in {graph.random_order(rng) for _ in range(200)}:
            plan = Plan(tuple(numbers[vertex] for vertex in order))
            for goal in goals:
                assert match_plan(goal, plan, "optimal").counts.f1 == 1, (scene.id, order)
        for setting, gating, _ in itertools.product(SETTINGS, GATINGS, range(20)):
            assembly = Assembly(scene, task.candidates, setting, gating)
            order = gated(scene, gating).graph.random_order(rng)
            outcomes = {assembly.move(numbers[vertex]).outcome for vertex in order}
            assert outcomes == {"placed"}, (scene.id, setting, gating, order)
            assert assembly.is_complete


OTHERWISE_AVERAGED = {
    "Claude-3.7 Sonnet": 53.65,
    "Gemini-1.5-flash": 53.75,
    "Qwen-VL-Max": 51.45,
    "Qwen2.5-VL-72B-Instruct": 46.825,
    "Random": 23.90,
}
"""Rows whose printed overall number is not the mean of the printed categories, and that mean."""


def test_published_means_are_those_of_their_parts_but_the_overall_of_five_rows():
    others, rounding = {}, 0.05 + 1e-9
    for model, rows in published_table(2).groupby("model"):
        cells = rows.set_index(["category", "subtask"])["value"]
        for category, subtasks in CATEGORIES.items():
            mean = cells[category][list(subtasks)].mean()
            assert abs(mean - cells[category, "average"]) <= rounding, (model, category)
        mean = np.mean([cells[category, "average"] for category in CATEGORIES])
        if abs(mean - cells["overall", "average"]) > rounding:
            others[model] = mean
    assert others == pytest.approx(OTHERWISE_AVERAGED)


def test_chance_of_an_order_is_one_in_all_permutations():
    assert chance("SH") == 0.25
    assert chance("OR") == pytest.approx(1 / math.factorial(4))
    assert chance("VP", 2) == 0.5
