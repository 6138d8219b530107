"""CPU seconds to score all recorded replies, against one pass of a plain Algorithm 1.

    python benchmarks/perf/scoring.py ../shared/PhyBlock

Scores every recorded reply under both settings and both matchers with error types and the Level-1
criterion; the peer is a straight reading of the paper's Algorithm 1, setting A alone. Both parse
with the official expression, and both are timed without reading files.
"""

from __future__ import annotations

import json
import re
import sys
import time
from pathlib import Path

from phyblock.datasets import AssemblyTask, read_official, recorded_models
from phyblock.models import read_raw_reply
from phyblock.parsing import parse_plan
from phyblock.scoring.plan import AssemblyScorer

_INDEX = re.compile(r"block with index (\d+)")


def plain_algorithm_1(task: AssemblyTask, text: str) -> tuple[int, int, int]:
    """TP, FP, FN by a straight reading of the paper's Algorithm 1, setting A."""
    candidates = task.candidates.candidates
    steps = [int(number) for number in _INDEX.findall(text)]
    placed: set[int] = set()
    tp = fp = 0
    for step in steps:
        if not 1 <= step <= len(candidates):
            continue
        chosen = candidates[step - 1]
        for block in task.scene.blocks:
            if (
                block.order not in placed
                and block.type == chosen.type
                and block.color == chosen.color
                and block.euler_deg == chosen.euler_deg
                and all(order in placed for order in block.depend)
            ):
                placed.add(block.order)
                tp += 1
                break
        else:
            fp += 1
    return tp, fp, len(task.scene) - tp


def main() -> None:
    root = Path(sys.argv[1])
    tasks = {task.scene.id: task for task in read_official(root).tasks}
    replies = [
        (tasks[path.stem], read_raw_reply(json.loads(path.read_bytes()), str(path)).text)
        for folder in recorded_models(root).values()
        for path in sorted(folder.glob("*.json"))
        if path.stem in tasks
    ]
    start = time.process_time()
    plain = [plain_algorithm_1(task, text) for task, text in replies]
    plain_s = time.process_time() - start

    start = time.process_time()
    scorers = {key: AssemblyScorer(t.scene, t.candidates, ("A", "B")) for key, t in tasks.items()}
    ours = []
    for task, text in replies:
        plan = parse_plan(text, len(task.candidates), "official").plan
        scores = scorers[task.scene.id].score(plan, ("paper", "optimal"), "membership")
        ours.append((scores[0].counts.tp, scores[0].counts.fp, scores[0].counts.fn))
    ours_s = time.process_time() - start
    if ours != plain:
        sys.exit("the two do not agree: the benchmark compares different work")
    print(f"replies scored              {len(replies):>8,}")
    print(f"plain Algorithm 1, one pass {plain_s:>8.2f} s CPU")
    print(f"phyblock, 2 x 2 + Level 1   {ours_s:>8.2f} s CPU  ratio {ours_s / plain_s:.2f}")


if __name__ == "__main__":
    main()
