"""What plans with poses are worth that are known to be right, or off by a known noise.

    python -m benchmarks.evidence.pose --oracle [--data phyblock-400,CHECKOUT] [--orders 3]
    python -m benchmarks.evidence.pose [--baselines oracle,oracle-noise-1mm] [--rotation candidate]
    python -m benchmarks.evidence.pose --engines [--every 4] [--baselines oracle-noise-1mm]
        each with [--data phyblock-400] [--every 1] [--orders 1] [--seed 0] [--processes 2] [--list]

Every scene of each data set (a bundled name, a folder, or an official checkout) is answered in so
many valid orders, and judged as a run judges it.

With `--oracle` by its true poses. For each data set a table says of how many scenes, of those that
stand when they are finished, all orders do what they should under each `pose.rotation`: every step
stands, what stands in the end has an IoU of 0.98 or more with the goal, and F1 is 100 at every
tolerance. Where the same blocks are put at the same poses under both, they are carried out once.
Plans that do not are listed with the reason.

Without it by each of some baselines. A row says how many plans and steps there were and the share
of steps that stand, the least and the mean IoU, F1 in C at every tolerance and aligned. Behind the
four that differ in their noise alone it says whether more noise is ever worth more.

With `--engines` the same plans are carried out in every engine that is installed, and a row says
how many steps end alike in both, each plan carried out from its beginning in each; `--list` names
the plans in which a verdict differs.

Each tells how long it took, by the clock and by the processor, how much of that judging took
(reading, scoring and carrying out, without making the plans), and the most memory that a process
had after a tenth of the plans and in the end.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from benchmarks.evidence.pose_plans import (
    LEAST_IOU,
    ROTATIONS,
    Plan,
    Verdict,
    ends_by_engine,
    judged,
    oracles,
)
from phyblock.datasets import AssemblyTask
from phyblock.datasets.named import read_data_set
from phyblock.sim.carry import CarriedStep
from phyblock.sim.registry import installed_engines

NOISE = ("oracle", "oracle-noise-1mm", "oracle-noise-3mm", "oracle-noise-1cm")
TOLERANCES = ("0.5", "1", "2", "4")


def oracle_table(name: str, tasks: Sequence[AssemblyTask], seeds: range, processes: int) -> None:
    """Print what true poses come to, and each plan that falls short."""
    begun = time.perf_counter()
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(partial(oracles, seeds=seeds), tasks, chunksize=2))
    standing = [verdicts for stands, verdicts in found if stands]
    print(f"oracle, {name}: {len(found)} scenes, {len(standing)} of which stand when finished")
    print(
        f"{f'of these, in {len(seeds)} orders each':38}" + "".join(r.rjust(11) for r in ROTATIONS)
    )
    demands: dict[str, Callable[[Verdict], bool]] = {
        "every step stands": lambda one: one.stands,
        f"IoU {LEAST_IOU} or more": lambda one: one.is_near,
        "F1 100 at 0.5, 1, 2 and 4 cm": lambda one: one.is_right,
        "all of it": lambda one: not one.faults,
    }
    for what, is_met in demands.items():
        met = [
            sum(all(is_met(pair[place]) for pair in scene) for scene in standing)
            for place in range(len(ROTATIONS))
        ]
        print(f"  {what:36}" + "".join(str(count).rjust(11) for count in met))
    pairs = [pair for _, verdicts in found for pair in verdicts]
    anew = sum(free.is_anew for _, free in pairs)
    print(f"carried out once for both rotations: {len(pairs) - anew:,} of {len(pairs):,} plans")
    print("".join(cost([one for pair in pairs for one in pair], time.perf_counter() - begun)))
    for scene in standing:
        for pair in scene:
            for rotation, one in zip(ROTATIONS, pair, strict=True):
                if one.faults and (rotation == "candidate" or one.faults != pair[0].faults):
                    print(f"    {one.scene}, order {one.seed + 1}, {rotation}: {one.faults}")


def f1(verdicts: Sequence[Verdict], place: int, *, aligned: bool = False) -> float:
    """F1 [%] at a tolerance by its place."""
    right = sum((v.aligned if aligned else v.right)[place] for v in verdicts)
    whole = sum(len(v.ends) + v.n_blocks for v in verdicts)
    return 200 * right / whole


def standing_share(verdicts: Sequence[Verdict]) -> float:
    """The share of steps that stand [%]."""
    ends = [end for verdict in verdicts for end in verdict.ends]
    return 100 * ends.count("stands") / len(ends)


def cost(verdicts: Sequence[Verdict], seconds: float) -> Iterator[str]:
    """What plans took."""
    judging = sum(one.judge_s for one in verdicts)
    yield f"  {seconds:.0f} s, {sum(one.cpu_s for one in verdicts):.0f} s of the processor, "
    yield f"{judging:.0f} s of these judging: {1000 * judging / len(verdicts):.0f} ms a plan\n"
    peaks = [verdict.peak_mb for verdict in verdicts]
    first = max(peaks[: max(1, len(peaks) // 10)])
    yield f"  most memory of a process: {first:.0f} MB after a tenth of the plans, "
    yield f"{max(peaks):.0f} MB in the end"


def row(verdicts: Sequence[Verdict], seconds: float) -> Iterator[str]:
    """What a baseline came to."""
    n_steps = sum(len(verdict.ends) for verdict in verdicts)
    yield f"{len(verdicts):,} plans, {n_steps:,} steps\n"
    yield f"  stand: {standing_share(verdicts):.2f} % of steps, all steps in "
    yield f"{sum(verdict.stands for verdict in verdicts):,} plans\n"
    ious = [verdict.iou for verdict in verdicts]
    yield f"  IoU: least {min(ious):.4f}, mean {np.mean(ious):.4f}, below {LEAST_IOU} in "
    yield f"{sum(not verdict.is_near for verdict in verdicts)} plans\n"
    curve = ", ".join(f"{f1(verdicts, place):.1f}" for place in range(4))
    moved = np.mean([f1(verdicts, place, aligned=True) for place in range(4)])
    yield f"  F1 at 0.5, 1, 2, 4 cm: {curve}; aligned, mean: {moved:.1f}\n"
    yield from cost(verdicts, seconds)


def noise_lines(found: Mapping[str, Sequence[Verdict]]) -> Iterator[str]:
    """What more noise takes, where all of `NOISE` were tried."""
    if not set(NOISE) <= set(found):
        return
    curves = {
        "share of steps that stand": [standing_share(found[name]) for name in NOISE],
        "F1 in C": [np.mean([f1(found[name], k) for k in range(4)]) for name in NOISE],
        **{
            f"F1 at {cm} cm": [f1(found[name], k) for name in NOISE]
            for k, cm in enumerate(TOLERANCES)
        },
    }
    yield "without noise, of 1 mm, 3 mm and 1 cm:"
    for what, values in curves.items():
        falls = "never rises" if sorted(values, reverse=True) == values else "RISES"
        yield f"  {what}: {', '.join(f'{value:.1f}' for value in values)}; {falls}"


def alike_line(steps: Sequence[tuple[CarriedStep, CarriedStep]]) -> str:
    """How many steps end alike in two engines."""
    same = sum(one.end == other.end for one, other in steps)
    neither = sum((one.end == "stands") == (other.end == "stands") for one, other in steps)
    shares = [100 * count / len(steps) for count in (same, neither)]
    return f"{shares[0]:.2f} % of steps end alike, {shares[1]:.2f} % stand in both or in neither"


def agreement(
    plans: Sequence[Plan], processes: int, is_list: bool
) -> list[tuple[CarriedStep, CarriedStep]]:
    """Print how far two engines agree, and the plans in which they do not; how each step ends."""
    engines = installed_engines()[:2]
    if len(engines) < 2:
        raise SystemExit(f"two engines must be installed, here is {engines[0]}")
    begun = time.perf_counter()
    with ProcessPoolExecutor(processes) as pool:
        found = list(pool.map(ends_by_engine, plans, chunksize=4))
    pairs = [list(zip(*ends[:2], strict=True)) for ends in found]
    steps = [pair for plan in pairs for pair in plan]
    print(f"{len(plans):,} plans, {len(steps):,} steps in {time.perf_counter() - begun:.0f} s")
    print(f"  {' and '.join(engines)}: {alike_line(steps)}")
    for engine, ends in zip(engines, zip(*steps, strict=True), strict=True):
        print(
            f"  stand in {engine}: {100 * sum(s.end == 'stands' for s in ends) / len(ends):.2f} %"
        )
    for (task, _, seed, _), plan in zip(plans, pairs, strict=True):
        apart = [n for n, (one, other) in enumerate(plan) if one.end != other.end]
        if apart and is_list:
            first = [f"{s.end} ({s.moved_cm:.2f} cm, {s.turned_deg:.1f}°)" for s in plan[apart[0]]]
            told = f"step {apart[0] + 1} of {len(plan)}: {' and '.join(first)}"
            more = f"; {len(apart) - 1} more steps of it differ" if len(apart) > 1 else ""
            print(f"    {task.scene.id}, order {seed + 1}, {told}{more}")
    return steps


def main() -> None:
    """Print a block of lines for each data set or baseline."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--oracle", action="store_true")
    parser.add_argument("--engines", action="store_true")
    parser.add_argument("--data", default="phyblock-400")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--orders", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--baselines", default=",".join(NOISE))
    parser.add_argument("--rotation", default="candidate", choices=ROTATIONS)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.orders)
    sets = [read_data_set(name) for name in options.data.split(",")]
    if options.oracle:
        for one in sets:
            oracle_table(one.name, one.tasks[:: options.every], seeds, options.processes)
        return
    tasks = [task for one in sets for task in one.tasks[:: options.every]]
    found: dict[str, list[Verdict]] = {}
    steps: list[tuple[CarriedStep, CarriedStep]] = []
    for name in options.baselines.split(","):
        plans = [(task, name, seed, options.rotation) for task in tasks for seed in seeds]
        print(f"{name}, {options.rotation}: ", end="", flush=True)
        if options.engines:
            steps += agreement(plans, options.processes, options.list)
            continue
        begun = time.perf_counter()
        with ProcessPoolExecutor(options.processes) as pool:
            found[name] = list(pool.map(judged, plans, chunksize=4))
        print("".join(row(found[name], time.perf_counter() - begun)))
        for one in found[name]:
            if options.list and name == "oracle" and one.faults:
                print(f"    {one.scene}: {one.faults}")
    for line in noise_lines(found):
        print(line)
    if steps:
        print(f"all {len(steps):,} steps: {alike_line(steps)}")


if __name__ == "__main__":
    main()
