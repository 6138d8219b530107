"""Local servers as processes of their own, and questions without pictures for a model of ours."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from phyblock.models import Message, Model, Reply, Request

__all__ = ["ask_all", "served"]

ROOT = Path(__file__).parents[2]


def served(stack: ExitStack, module: str, *options: str) -> str:
    """The address of a new server of `tests.servers`, which ends with the stack."""
    server = subprocess.Popen(
        [sys.executable, "-m", f"tests.servers.{module}", *options],
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
