"""Time and memory of a run of very many samples: going on with it, its tables, its report.

    python benchmarks/perf/soak.py [--samples 100000] [--keep FOLDER] [--no-report]

A run is made of recorded replies for the bundled scenes: the real command asks for them once, and
its records are repeated under so many seeds that there are `--samples`. Then each in a process of
its own: the floor, which reads the same lines as JSON and does nothing with them; resuming, which
opens the run, reads its records and finds nothing left to ask; `phyblock report --print`; and
`phyblock report`, `figures`, `site` and `bundle`. Prints wall and CPU seconds, their ratio to the
floor's wall seconds, and the peak of resident memory.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

import yaml
from measure import Cost, run_measured

from phyblock.config.models import load_models
from phyblock.config.suite import load_suite
from phyblock.data.scenes import read_builtin
from phyblock.files import bundled
from phyblock.run.plan import make_plan

PHYBLOCK = (sys.executable, "-m", "phyblock")
FLOOR = "import json, sys\nfor line in open(sys.argv[1], 'rb'):\n    json.loads(line)\n"
RESUME = """
import asyncio, sys
from pathlib import Path
from phyblock.config.models import load_models
from phyblock.config.suite import load_suite
from phyblock.files import bundled
from phyblock.run.plan import make_plan
from phyblock.run.runner import Session

folder = Path(sys.argv[1])
suite = load_suite(folder / "soak.yaml", (), data_dir=bundled("benchmarks", "data"))
plan = make_plan(suite, load_models(folder / "models.yaml"))

async def resume():
    return await Session(plan, folder / "run", lambda event: None, use_cache=False).run()

result = asyncio.run(resume())
assert not result.left, result
"""
_REMARK = "The goal stands on a wide base, so what carries the rest comes first. "


def make_run(folder: Path, samples: int) -> Path:
    """A finished run of `samples` samples at least."""
    tasks = read_builtin(bundled("benchmarks", "data") / "phyblock-400").tasks
    replies = folder / "replies"
    replies.mkdir(parents=True)
    for number, task in enumerate(tasks):
        steps = [1 + (number + step) % len(task.candidates) for step in range(len(task.scene))]
        text = "\n".join(f"Step{n}: Move block with index {i}" for n, i in enumerate(steps, 1))
        (replies / f"{task.key}.json").write_text(json.dumps({"text": 5 * _REMARK + text}))
    (folder / "models.yaml").write_text(yaml.safe_dump({"recorded-model": {"replay": "replies"}}))
    seeds = list(range(-(-samples // len(tasks))))
    write_suite(folder / "once.yaml", seeds[:1])
    write_suite(folder / "soak.yaml", seeds)
    command = ("run", str(folder / "once.yaml"), "--out", str(folder / "once"), "--no-report")
    models = ("--models-file", str(folder / "models.yaml"))
    run_measured((*PHYBLOCK, *command, *models), os.environ)
    return repeat(folder, seeds)


def write_suite(path: Path, seeds: list[int]) -> None:
    """A suite of the recorded model."""
    path.write_text(yaml.safe_dump({"name": "soak", "models": ["recorded-model"], "seeds": seeds}))


def repeat(folder: Path, seeds: list[int]) -> Path:
    """The run of the suite with all seeds, out of the records of the first."""
    suite = load_suite(folder / "soak.yaml", data_dir=bundled("benchmarks", "data"))
    manifest = make_plan(suite, load_models(folder / "models.yaml")).manifest
    run = folder / "run"
    run.mkdir()
    (run / "run.yaml").write_text(yaml.safe_dump(manifest.fields(), sort_keys=False))
    lines = (folder / "once" / "records.jsonl").read_text(encoding="utf-8").splitlines()
    records = [json.loads(line) for line in lines]
    with (run / "records.jsonl").open("w", encoding="utf-8") as file:
        for seed in seeds:
            for record in records:
                sample = record["sample"].removesuffix("s0") + f"s{seed}"
                again = {**record, "sample": sample, "seed": seed, "run": manifest.run}
                file.write(json.dumps(again, ensure_ascii=False, separators=(",", ":")) + "\n")
    return run


def show(name: str, cost: Cost, floor: Cost) -> None:
    """A line of the result."""
    ratio = f"{cost.wall_s / floor.wall_s:.1f} x"
    figures = f"{cost.wall_s:8.1f} s {ratio:>8} {cost.cpu_s:8.1f} s CPU {cost.peak_mb:6.0f} MB"
    print(f"{name:<26}{figures}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--keep", type=Path, help="make the run here and leave it, or take it")
    parser.add_argument("--no-report", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch) / "soak"
        run = folder / "run" if folder.exists() else make_run(folder, given.samples)
        records = run / "records.jsonl"
        with records.open("rb") as lines:
            count = sum(1 for _ in lines)
        print(f"{count:,} records, {records.stat().st_size / 1e6:.0f} MB")
        floor = run_measured((sys.executable, "-c", FLOOR, str(records)), os.environ)
        show("the lines as JSON", floor, floor)
        resume = (sys.executable, "-c", RESUME, str(folder))
        show("resuming", run_measured(resume, os.environ), floor)
        commands = [("report", str(run), "--print")]
        if not given.no_report:
            site = ("site", str(run), "--out", str(folder / "site"))
            bundle = ("bundle", str(run), "--out", str(folder / "bundle.zip"))
            commands += [("report", str(run)), ("figures", str(run)), site, bundle]
        for words in commands:
            named = "report --print" if "--print" in words else words[0]
            show(f"phyblock {named}", run_measured((*PHYBLOCK, *words), os.environ), floor)


if __name__ == "__main__":
    main()
