"""Throughput with `max_concurrency: auto` beside that of the best fixed number.

    python benchmarks/perf/concurrency.py [--calls 400] [--bears 12] [--latency 0.1] [--cap 64]

Each server is a process of its own that answers so many requests at once in the given latency, and
of more gets slower, refuses some with 429, or leaves some without an answer for longer than the
time limit. Timed is what a model of ours takes to have all answers, from the first call on.
"""

from __future__ import annotations

import argparse
import asyncio
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from phyblock.models import Gate, Message, Model, ModelConfig, Reply, Request, build_model

ROOT = Path(__file__).parents[2]
STRAINS = ("slows", "refuses", "hangs")
LATE = {"hangs": 10.0}
PATIENT = 100.0
"""The time limit of a request, in latencies; what takes longer is asked again."""


def served(stack: ExitStack, strain: str, bears: int, latency_s: float) -> str:
    """The address of a new server."""
    words = ["--strain", strain, "--bears", str(bears), "--latency", str(latency_s)]
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.servers.strained", *words],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    stack.callback(server.wait)
    stack.callback(server.terminate)
    assert server.stdout is not None
    return f"http://127.0.0.1:{int(server.stdout.readline())}/v1"


async def ask_all(model: Model, calls: int) -> float:
    """Ask so many questions; seconds until the last answer."""
    requests = [
        Request(str(n), 0, (Message("user", (f"Sample {n}",)),), {}, "", None) for n in range(calls)
    ]
    start = time.perf_counter()
    replies = await asyncio.gather(*map(model.ask, requests))
    seconds = time.perf_counter() - start
    await model.aclose()
    assert all(isinstance(reply, Reply) for reply in replies)
    return seconds


def rate(address: str, calls: int, timeout_s: float, most: int, *, adapts: bool) -> float:
    """Answers a second."""
    config = ModelConfig(
        "bench",
        "litellm",
        "hosted_vllm/bench",
        api_base=address,
        max_concurrency=most,
        adapts=adapts,
        timeout_s=timeout_s,
    )
    model = build_model(config, cache=None, overall=Gate(most))
    return calls / asyncio.run(ask_all(model, calls))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--calls", type=int, default=400)
    parser.add_argument(
        "--bears", type=int, default=12, help="requests that a server bears at once"
    )
    parser.add_argument("--latency", type=float, default=0.1, metavar="SECONDS")
    parser.add_argument("--cap", type=int, default=64, help="most that may be tried")
    options = parser.parse_args()
    bears = options.bears
    numbers = sorted({bears // 3, bears // 2, bears, 3 * bears // 2, 2 * bears, options.cap})
    for strain in STRAINS:
        rates = {}
        timeout_s = options.latency * LATE.get(strain, PATIENT)
        for number in numbers:
            with ExitStack() as stack:
                address = served(stack, strain, bears, options.latency)
                rates[number] = rate(address, options.calls, timeout_s, number, adapts=False)
        with ExitStack() as stack:
            address = served(stack, strain, bears, options.latency)
            found = rate(address, options.calls, timeout_s, options.cap, adapts=True)
        best = max(rates, key=lambda number: rates[number])
        told = ", ".join(f"{number}: {answers:.1f}" for number, answers in rates.items())
        print(f"{strain}: answers a second by fixed number  {told}")
        beside_best, beside_cap = found / rates[best], found / rates[options.cap]
        print(f"    auto {found:.1f}: {beside_best:.2f} x the best fixed number ({best}), "
              f"{beside_cap:.2f} x {options.cap}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
