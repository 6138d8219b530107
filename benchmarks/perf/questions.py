"""What questions cost: drafts, verification and pictures a question, by subtask.

    python benchmarks/perf/questions.py [--count 4] [--subtasks SH,VP]

Each subtask drafts from scenes of the built-in set until --count questions are there; its time is
shared by the drafts that came of it. Those are verified, and all their pictures are drawn at 512
pixels. CPU milliseconds in this process. The floor is measured in the same run: the bare render of
one goal picture of 512 pixels; `x` columns are ratios to it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

from phyblock.datasets import read_builtin
from phyblock.domain import SUBTASKS, Question, Scene
from phyblock.errors import DataError
from phyblock.making.questions.question_production import make_questions, problem_of
from phyblock.making.workers import open_workers
from phyblock.resources import bundled
from phyblock.sim import PictureStyle, goal_png
from phyblock.sim.question_pictures import question_png

STYLE = PictureStyle()
MOST_SCENES = 64


def cpu_ms(work: Callable[[], Any]) -> float:
    start = time.process_time()
    work()
    return (time.process_time() - start) * 1000


def make(subtask: Any, scenes: list[Scene], count: int) -> list[Question]:
    """Questions of a few scenes, of more where those allow too few."""
    tried = 4 * count
    while True:
        try:
            with open_workers(1) as workers:
                return list(make_questions(scenes[:tried], {subtask: count}, 0, workers))
        except DataError:
            if tried >= MOST_SCENES:
                raise
            tried *= 2


def measure(subtask: Any, scenes: list[Scene], count: int, floor_ms: float) -> str:
    questions: list[Question] = []
    made_ms = cpu_ms(lambda: questions.extend(make(subtask, scenes, count))) / count
    verified_ms = cpu_ms(lambda: [problem_of(question) for question in questions]) / count
    pictures = [picture for question in questions for picture in question.pictures]
    drawn_ms = cpu_ms(lambda: [question_png(picture, STYLE) for picture in pictures]) / count
    numbers = (made_ms, verified_ms, drawn_ms)
    cells = [f"{number:9.1f} {number / floor_ms:7.2f}x" for number in numbers]
    return f"{subtask:8}{len(pictures) / count:9.1f}  " + "".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--subtasks", default=",".join(SUBTASKS))
    arguments = parser.parse_args()
    tasks = read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks
    scenes = [task.scene for task in tasks[:: len(tasks) // MOST_SCENES]]
    goal_png(scenes[0], STYLE)
    shown = scenes[:16]
    floor_ms = cpu_ms(lambda: [goal_png(scene, STYLE) for scene in shown]) / len(shown)
    print(f"floor: a goal picture, {floor_ms:.1f} ms")
    columns = "".join(f"{name:>18}" for name in ("made ms", "verified ms", "drawn ms"))
    print(f"{'subtask':8}{'pictures':>9}  {columns}")
    for subtask in arguments.subtasks.split(","):
        print(measure(subtask, scenes, arguments.count, floor_ms), flush=True)


if __name__ == "__main__":
    main()
