"""Throughput of one model over several servers of one request at a time each, beside one alone.

    python benchmarks/perf/replicas.py [--servers 4] [--calls 400] [--latency 0.2]

Each server is a process of its own, which answers one request after the other, each after the given
latency, in the OpenAI chat protocol. Timed is what a model of ours takes to have all answers, from
the first call on; starting and tables are left out, as they are the same for any number of servers.
"""

from __future__ import annotations

import argparse
import asyncio
from contextlib import ExitStack

from local_servers import ask_all, served

from phyblock.models import Gate, ModelConfig, build_model

WAITING = 4
"""Requests under way for each server: one that is answered, and others that wait there."""


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
        server = ("--latency", str(options.latency), "--one-at-a-time")
        addresses = [served(stack, "openai_chat", *server) for _ in range(options.servers)]
        counts = [1, options.servers]
        rates = []
        for count in counts:
            calls = options.calls * count // options.servers
            rates.append(calls / seconds_at(addresses[:count], calls))
            print(f"{count:>3} servers: {calls:>5} calls, {rates[-1]:7.2f} a second", flush=True)
    print(f"{options.servers} servers give {rates[1] / rates[0]:.2f} x what one gives")


if __name__ == "__main__":
    main()
