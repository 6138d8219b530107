"""What plans with poses are worth that are known to be right, or off by a known noise.

    python benchmarks/evidence/pose.py [--data phyblock-400] [--every 1] [--orders 1] [--seed 0]
        [--baselines oracle,oracle-noise-1mm] [--rotation candidate] [--processes 2] [--list]
    python benchmarks/evidence/pose.py --engines [--every 4] [--baselines oracle,...]

Every scene of a data set (a bundled name, a folder, or an official checkout) is answered by each
baseline in so many valid orders, and judged as a run judges it. A row says how many plans and
steps there were, how many of the steps stand and in how many plans all do, the least and the mean
IoU of what stands in the end with the goal, F1 in C at every tolerance and aligned, how long it
took, and the most memory that a process had after a tenth of the plans and in the end. `--list`
names the plans of the oracle in which a step did not stand.

With `--engines` the same plans are carried out in every engine that is installed, and a row says
how many steps end alike in both, each plan carried out from its beginning in each; `--list` names
the plans in which a verdict differs.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from phyblock.datasets import AssemblyTask
from phyblock.datasets.named import read_data_set
from phyblock.sim.carry import CarryLimits
from phyblock.sim.registry import PHYSICS_VARIABLE, installed_engines
from phyblock.tracks.pose_planning.baselines import POSE_RULES, PoseSubject
from phyblock.tracks.pose_planning.judging import PoseJudgement, PoseRules
from phyblock.tracks.pose_planning.track import PosePlanning
from phyblock.words import PoseRotation

NOISE = ("oracle", "oracle-noise-1mm", "oracle-noise-3mm", "oracle-noise-1cm")


@dataclass(frozen=True)
class Plan:
    """One scene answered once."""

    task: AssemblyTask
    baseline: str
    seed: int
    rotation: PoseRotation


@dataclass(frozen=True)
class Verdict:
    """What came of a plan."""

    scene: str
    n_blocks: int
    ends: tuple[str, ...]
    iou: float
    right: tuple[int, ...]
    aligned: tuple[int, ...]
    peak_mb: float


def judged(plan: Plan, engine: str | None = None) -> Verdict:
    """Judge one plan, in a process of its own where an engine is named."""
    if engine is not None:
        os.environ[PHYSICS_VARIABLE] = engine
    rules = PoseRules(plan.rotation, ("A",), ("optimal",), CarryLimits(), 1.0, 10.0)
    track = PosePlanning(rules)
    item = track.shown(plan.task, plan.seed)
    subject = PoseSubject(item.scene, item.candidates, rules.is_free)
    text = POSE_RULES[plan.baseline](subject, np.random.default_rng(plan.seed))
    found: PoseJudgement = track.judge(item, text)
    absolute, aligned = found.poses
    ends = tuple(step.end for step in found.ended.steps)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    iou, n_blocks = found.ended.iou, len(item.scene)
    return Verdict(item.key, n_blocks, ends, iou, absolute.right, aligned.right, peak_mb)


def f1(verdicts: Sequence[Verdict], place: int, *, aligned: bool = False) -> float:
    """F1 [%] at a tolerance by its place."""
    right = sum((v.aligned if aligned else v.right)[place] for v in verdicts)
    whole = sum(len(v.ends) + v.n_blocks for v in verdicts)
    return 200 * right / whole


def row(verdicts: Sequence[Verdict], seconds: float) -> Iterator[str]:
    """What a baseline came to."""
    ends = [end for verdict in verdicts for end in verdict.ends]
    yield f"{len(verdicts):,} plans, {len(ends):,} steps in {seconds:.0f} s"
    yield f"  stand: {100 * ends.count('stands') / len(ends):.2f} % of steps, all steps in "
    yield f"{sum(set(v.ends) == {'stands'} for v in verdicts):,} plans\n"
    ious = [verdict.iou for verdict in verdicts]
    yield f"  IoU: least {min(ious):.4f}, mean {np.mean(ious):.4f}, below 0.98 in "
    yield f"{sum(iou < 0.98 for iou in ious)} plans\n"
    curve = ", ".join(f"{f1(verdicts, place):.1f}" for place in range(4))
    moved = np.mean([f1(verdicts, place, aligned=True) for place in range(4)])
    yield f"  F1 at 0.5, 1, 2, 4 cm: {curve}; aligned, mean: {moved:.1f}\n"
    peaks = [verdict.peak_mb for verdict in verdicts]
    first = max(peaks[: max(1, len(peaks) // 10)])
    yield f"  most memory of a process: {first:.0f} MB after a tenth of the plans, "
    yield f"{max(peaks):.0f} MB in the end"


def agreement(plans: Sequence[Plan], processes: int, is_list: bool) -> None:
    """Print how far the installed engines agree."""
    engines = installed_engines()
    found = {}
    for engine in engines:
        with ProcessPoolExecutor(processes) as pool:
            found[engine] = list(pool.map(partial(judged, engine=engine), plans, chunksize=4))
    first, second = (found[engine] for engine in engines[:2])
    same = total = 0
    stands = [0, 0]
    for one, other in zip(first, second, strict=True):
        pairs = list(zip(one.ends, other.ends, strict=True))
        total += len(pairs)
        same += sum(a == b for a, b in pairs)
        stands[0] += sum(a == "stands" for a, _ in pairs)
        stands[1] += sum(b == "stands" for _, b in pairs)
        if is_list and one.ends != other.ends:
            place = next(i for i, (a, b) in enumerate(pairs) if a != b)
            print(f"    {one.scene}: from step {place + 1}, {' and '.join(pairs[place])}")
    names = " and ".join(engines[:2])
    print(f"  {names}: {100 * same / total:.2f} % of {total:,} steps of {len(plans)} plans alike")
    print(f"  stand: {100 * stands[0] / total:.2f} % and {100 * stands[1] / total:.2f} %")


def main() -> None:
    """Print a block of lines for each baseline."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", default="phyblock-400")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--orders", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--baselines", default=",".join(NOISE))
    parser.add_argument("--rotation", default="candidate", choices=("candidate", "free"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--engines", action="store_true")
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    tasks = read_data_set(options.data).tasks[:: options.every]
    for name in options.baselines.split(","):
        seeds = range(options.seed, options.seed + options.orders)
        plans = [Plan(task, name, seed, options.rotation) for task in tasks for seed in seeds]
        print(f"{name}, {options.rotation}: ", end="", flush=True)
        if options.engines:
            print()
            agreement(plans, options.processes, options.list)
            continue
        start = time.perf_counter()
        with ProcessPoolExecutor(options.processes) as pool:
            verdicts = list(pool.map(judged, plans, chunksize=4))
        print("".join(row(verdicts, time.perf_counter() - start)).replace(" s  ", " s\n  "))
        if options.list and name == "oracle":
            for verdict in verdicts:
                if set(verdict.ends) != {"stands"} or verdict.iou < 0.98:
                    wrong = [
                        f"{n} {end}" for n, end in enumerate(verdict.ends, 1) if end != "stands"
                    ]
                    print(f"    {verdict.scene}: IoU {verdict.iou:.4f}, steps {', '.join(wrong)}")


if __name__ == "__main__":
    main()
