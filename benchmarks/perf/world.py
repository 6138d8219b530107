"""The block world's speed: scenes generated, verified, audited and rendered a second; memory.

    python benchmarks/perf/world.py [--count 40] [--jobs 1 2] [--memory 1000]

First the rate of each kind of work with each number of processes, over the same scenes. Then what
one scene costs in CPU time in this process, at 4, 12 and 22 blocks. Last the resident memory of
all processes together while --memory scenes are generated (0: not measured; a thousand take about
four minutes). A scene is verified by all checks of `phyblock scenes verify`, and audited as any
foreign scene is. A rendered scene is a composite of 512 pixel pictures, none on disk before.
"""

from __future__ import annotations

import argparse
import functools
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import psutil

from phyblock.data import read_builtin
from phyblock.domain import Scene
from phyblock.making.checks import audit_scene, verify_scene
from phyblock.making.scenes.candidates import make_candidates
from phyblock.making.scenes.designs import beside
from phyblock.making.scenes.production import Order, produce, shares
from phyblock.making.scenes.sketch import make_scene
from phyblock.making.workers import Workers, open_workers
from phyblock.resources import bundled
from phyblock.sim.pictures import PictureStyle, candidates_png, composite_png, goal_png

SIZES = (4, 12, 22)
STYLE = PictureStyle()
APART_UNITS = 2.0
MEMORY_AFTER = (50, 100, 250, 500)


def verify(scene: Scene) -> int:
    return sum(map(len, verify_scene((scene, make_candidates(scene))).values()))


def audit(scene: Scene) -> int:
    return len(audit_scene(scene, make_candidates(scene)).findings)


def render(scene: Scene) -> int:
    grid = candidates_png(make_candidates(scene), STYLE)
    return len(composite_png(goal_png(scene, STYLE), grid))


def generate(workers: Workers, count: int, seed: int) -> list[Scene]:
    return list(produce(Order(seed, "kit", shares(count)), workers))


def run_all(workers: Workers, work: Callable[[Scene], Any], scenes: Iterable[Scene]) -> None:
    for _ in workers.map(work, scenes):
        pass


@functools.cache
def of_size(blocks: int) -> Scene:
    """A sound structure of that many blocks: the first of two scenes that stand side by side."""
    tasks = read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks
    large = [task.scene.blocks for task in tasks if task.scene.level == 4]
    taken = [replace(block, depend=(), layer=1) for block in beside(large[:2], APART_UNITS)]
    level = 2 if blocks < 6 else 3 if blocks < 13 else 4
    return make_scene(f"size-{blocks}", (level,), taken[:blocks])


def timed(work: Callable[[], Any], clock: Callable[[], float]) -> tuple[Any, float]:
    start = clock()
    answer = work()
    return answer, clock() - start


def show_rates(count: int, jobs: Sequence[int]) -> None:
    print(
        f"{'scenes a second':<24}{'generated':>12}{'verified':>12}{'audited':>12}{'rendered':>12}"
    )
    for number in jobs:
        with open_workers(number) as workers:
            # The processes start with their first work, which is not timed.
            run_all(workers, render, [of_size(4)] * number)
            make = functools.partial(generate, workers, count, 1)
            scenes, taken_s = timed(make, time.perf_counter)
            rates = [len(scenes) / taken_s]
            for work in (verify, audit, render):
                go = functools.partial(run_all, workers, work, scenes)
                rates.append(len(scenes) / timed(go, time.perf_counter)[1])
        name = f"{number} process{'es' if number > 1 else ''}"
        print(f"{name:<24}" + "".join(f"{rate:>12.2f}" for rate in rates), flush=True)


def show_costs() -> None:
    names = ("verify", "audit", "goal", "candidates")
    print(f"\n{'CPU seconds a scene':<24}" + "".join(f"{name:>12}" for name in names))
    for blocks in SIZES:
        scene = of_size(blocks)
        candidates = make_candidates(scene)
        # A view of its own: a process keeps the thumbnails that it has drawn.
        style = replace(STYLE, azimuth_deg=STYLE.azimuth_deg + blocks / 100)
        jobs = (
            functools.partial(verify, scene),
            functools.partial(audit, scene),
            functools.partial(goal_png, scene, style),
            functools.partial(candidates_png, candidates, style),
        )
        costs = [timed(job, time.process_time)[1] for job in jobs]
        print(f"{f'{len(scene)} blocks':<24}" + "".join(f"{cost:>12.2f}" for cost in costs))


def show_memory(count: int, jobs: int) -> None:
    print(f"\nMB resident, all of {jobs} processes, after n scenes")
    with open_workers(jobs) as workers:
        order = Order(2, "kit", shares(count))
        for number, _ in enumerate(produce(order, workers), 1):
            if number in MEMORY_AFTER or number == count:
                here = psutil.Process()
                tree = [here, *here.children(recursive=True)]
                megabytes = sum(process.memory_info().rss for process in tree) / 1e6
                print(f"{number:>6}{megabytes:>18.0f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--memory", type=int, default=1000, metavar="SCENES")
    options = parser.parse_args()
    show_rates(options.count, options.jobs)
    show_costs()
    if options.memory:
        show_memory(options.memory, max(options.jobs))


if __name__ == "__main__":
    main()
