"""Throughput of one model over several servers of one request at a time each, beside one alone.

    python benchmarks/perf/replicas.py [--servers 4] [--calls 400] [--latency 0.2]

Each server is a process of its own, which answers one request after the other, each after the given
latency, in the OpenAI chat protocol. Timed is what a model of ours takes to have all answers, from
the first call on; starting and tables are left out, as they are the same for any number of servers.
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
WAITING = 4
"""Requests under way for each server: one that is answered, and others that wait there."""


def served(stack: ExitStack, latency_s: float) -> str:
    """The address of a new server."""
    arguments = ["--latency", str(latency_s), "--one-at-a-time"]
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.servers.openai_chat", *arguments],
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


def seconds_at(addresses: list[str], calls: int) -> float:
    """What all calls take at these servers."""
    width = WAITING * len(addresses)
    config = ModelConfig(
        "bench", "litellm", "hosted_vllm/bench", api_bases=tuple(addresses), max_concurrency=width
    )
    return asyncio.run(ask_all(build_model(config, cache=None, overall=Gate(width)), calls))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--servers", type=int, default=4)
    parser.add_argument("--calls", type=int, default=400)
    parser.add_argument("--latency", type=float, default=0.2, metavar="SECONDS")
    options = parser.parse_args()
    with ExitStack() as stack:
        addresses = [served(stack, options.latency) for _ in range(options.servers)]
        counts = [1, options.servers]
        rates = []
        for count in counts:
            calls = options.calls * count // options.servers
            rates.append(calls / seconds_at(addresses[:count], calls))
            print(f"{count:>3} servers: {calls:>5} calls, {rates[-1]:7.2f} a second", flush=True)
    print(f"{options.servers} servers give {rates[1] / rates[0]:.2f} x what one gives")


if __name__ == "__main__":
    main()
