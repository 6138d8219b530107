"""Throughput with `max_concurrency: auto` beside that of the best fixed number.

    python benchmarks/perf/concurrency.py [--calls 400] [--bears 12] [--latency 0.1] [--cap 64]

Each server is a process of its own that answers so many requests at once in the given latency, and
of more gets slower, refuses some with 429, or leaves some without an answer for longer than the
time limit. Timed is what a model of ours takes to have all answers, from the first call on.
"""

from __future__ import annotations

import argparse
import asyncio
from contextlib import ExitStack

from local_servers import ask_all, served

from phyblock.models import Gate, ModelConfig, build_model

STRAINS = ("slows", "refuses", "hangs")
LATE = {"hangs": 10.0}
PATIENT = 100.0
"""The time limit of a request, in latencies; what takes longer is asked again."""


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
        server = ("--strain", strain, "--bears", str(bears), "--latency", str(options.latency))
        timeout_s = options.latency * LATE.get(strain, PATIENT)
        for number in numbers:
            with ExitStack() as stack:
                address = served(stack, "strained", *server)
                rates[number] = rate(address, options.calls, timeout_s, number, adapts=False)
        with ExitStack() as stack:
            address = served(stack, "strained", *server)
            found = rate(address, options.calls, timeout_s, options.cap, adapts=True)
        best = max(rates, key=lambda number: rates[number])
        told = ", ".join(f"{number}: {answers:.1f}" for number, answers in rates.items())
        print(f"{strain}: answers a second by fixed number  {told}")
        beside_best, beside_cap = found / rates[best], found / rates[options.cap]
        print(f"    auto {found:.1f}: {beside_best:.2f} x the best fixed number ({best}), "
              f"{beside_cap:.2f} x {options.cap}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
