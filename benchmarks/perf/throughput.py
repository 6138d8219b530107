"""1,000 picture samples against a local server: phyblock beside the ideal and two bare loops.

    python benchmarks/perf/throughput.py [--calls 1000] [--latency 0.2] [--concurrency 64]

The server speaks the OpenAI chat protocol, answers after the given latency, and runs as a process
of its own; every call carries a picture of about 150 KB. All figures come from one run of this
script: wall time, CPU time and peak memory of the whole process tree, pictures rendered and modules
compiled before, as an installation compiles them. The bare loops only call; a run also judges,
records, and writes tables and the report. The two baselines that runs have by default add two
samples per call; they have lines of their own.
"""

from __future__ import annotations

import argparse
import compileall
import importlib.util
import os
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

import yaml
from measure import Cost, run_measured, served

SIZE_PX = 1100
"""Edge at which the rendered composites weigh about 150 KB."""


def write_suite(folder: Path, transport: str, api_base: str, calls: int, concurrency: int) -> Path:
    """A suite of `calls` samples and its models file; returns the suite's path."""
    scenes = 20
    suite = {
        "name": f"perf-{transport}",
        "models": ["bench"],
        "levels": [1, 2, 3, 4],
        "seeds": list(range(calls // scenes)),
        "images": {"size_px": SIZE_PX},
        "limits": {"max_concurrency": concurrency},
        "baselines": [],
    }
    model = {"id": "openai/bench", "api_base": api_base, "transport": transport}
    target = folder / transport
    target.mkdir(exist_ok=True)
    (target / "models.yaml").write_text(yaml.safe_dump({"bench": model}))
    (target / "suite.yaml").write_text(yaml.safe_dump(suite))
    return target / "suite.yaml"


def phyblock(suite: Path, out: Path, env: dict[str, str], *extra: str) -> Cost:
    """`phyblock run` of the suite into a folder of its own."""
    command = [sys.executable, "-m", "phyblock", "run", str(suite), "--out", str(out)]
    models = ["--models-file", str(suite.with_name("models.yaml"))]
    return run_measured([*command, *models, "--limit", "20", "--yes", *extra], env)


def show(name: str, cost: Cost, ideal_s: float, loops: dict[str, Cost]) -> None:
    """One line: the figures, and ratios to the ideal and the bare loops."""
    ratios = "".join(f"{cost.wall_s / loop.wall_s:>10.2f}" for loop in loops.values())
    figures = f"{cost.wall_s:>8.2f}{cost.cpu_s:>8.2f}{cost.peak_mb:>9.0f}"
    print(f"{name:<34}{figures}{cost.wall_s / ideal_s:>9.2f}{ratios}", flush=True)


def compile_modules() -> None:
    """Write the bytecode of phyblock, also where Python is told to write none."""
    spec = importlib.util.find_spec("phyblock")
    assert spec is not None
    assert spec.origin is not None
    compileall.compile_dir(Path(spec.origin).parent, quiet=2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--calls", type=int, default=1000)
    parser.add_argument("--latency", type=float, default=0.2)
    parser.add_argument("--concurrency", type=int, default=64)
    options = parser.parse_args()
    compile_modules()
    with ExitStack() as stack:
        api_base = served(stack, "openai_chat", "--latency", str(options.latency))
        name = stack.enter_context(tempfile.TemporaryDirectory())
        compare(Path(name), api_base, options)


def compare(folder: Path, api_base: str, options: argparse.Namespace) -> None:
    env = {**os.environ, "PHYBLOCK_CACHE": str(folder / "cache"), "OPENAI_API_KEY": "none"}
    calls, concurrency = options.calls, options.concurrency
    suites = {
        transport: write_suite(folder, transport, api_base, calls, concurrency)
        for transport in ("direct", "litellm")
    }
    # One sample a scene renders all pictures; its replies are not kept for the timed runs.
    phyblock(suites["direct"], folder / "warm-up", env, "--set", "seeds=[100000]", "--no-cache")
    pictures = sorted((folder / "cache" / "pictures").rglob("*.png"))
    picture = sorted(pictures, key=lambda path: path.stat().st_size)[len(pictures) // 2]
    ideal_s = calls / concurrency * options.latency
    print(f"{calls:,} calls, {concurrency} at once, {options.latency} s a reply, ", end="")
    print(f"picture {picture.stat().st_size / 1000:.0f} KB; ideal {ideal_s:.2f} s\n")
    heads = f"{'wall s':>8}{'CPU s':>8}{'peak MB':>9}{'/ideal':>9}{'/aiohttp':>10}{'/litellm':>10}"
    print(f"{'':<34}{heads}")
    loop = [sys.executable, str(Path(__file__).with_name("bare_loops.py"))]
    tail = [api_base, str(picture), str(calls), str(concurrency)]
    loops = {how: run_measured([*loop, how, *tail], env) for how in ("aiohttp", "litellm")}
    show("bare aiohttp loop", loops["aiohttp"], ideal_s, loops)
    show("bare litellm.acompletion loop", loops["litellm"], ideal_s, loops)
    for transport, suite in suites.items():
        # Both transports share the key of a reply: each starts with no replies kept.
        (folder / "cache" / "replies.sqlite").unlink(missing_ok=True)
        cold = phyblock(suite, folder / f"cold-{transport}", env)
        show(f"phyblock run, {transport}", cold, ideal_s, loops)
    warm = phyblock(suites["litellm"], folder / "warm", env)
    show("phyblock run again, from the cache", warm, ideal_s, loops)
    done = phyblock(suites["litellm"], folder / "warm", env)
    show("phyblock run again, all done", done, ideal_s, loops)
    more = ["--set", "baselines=[goal-blind, random]"]
    (folder / "cache" / "replies.sqlite").unlink()
    for name in ("direct", "from the cache"):
        beside = phyblock(suites["direct"], folder / f"baselines {name}", env, *more)
        show(f"{name}, and two baselines", beside, ideal_s, loops)
    helped = run_measured([sys.executable, "-m", "phyblock", "--help"], env)
    show("phyblock --help", helped, ideal_s, loops)


if __name__ == "__main__":
    main()
