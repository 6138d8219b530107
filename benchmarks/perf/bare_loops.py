"""The floors: the same calls by a bare aiohttp loop, or a bare litellm.acompletion loop.

python benchmarks/perf/bare_loops.py aiohttp|litellm API_BASE PICTURE CALLS CONCURRENCY
"""

from __future__ import annotations

import asyncio
import base64
import os
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

Ask = Callable[[list[dict[str, Any]]], Awaitable[str]]


def messages(picture: str, number: int) -> list[dict[str, Any]]:
    image = {"type": "image_url", "image_url": {"url": picture}}
    return [{"role": "user", "content": [image, {"type": "text", "text": f"Sample {number}"}]}]


async def with_aiohttp(api_base: str, run: Callable[[Ask], Awaitable[None]]) -> None:
    import aiohttp

    async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as session:

        async def ask(content: list[dict[str, Any]]) -> str:
            body = {"model": "bench", "messages": content, "max_tokens": 4096}
            async with session.post(f"{api_base}/chat/completions", json=body) as response:
                reply = await response.json()
                return str(reply["choices"][0]["message"]["content"])

        await run(ask)


async def with_litellm(api_base: str, run: Callable[[Ask], Awaitable[None]]) -> None:
    os.environ["LITELLM_LOCAL_MODEL_COST_MAP"] = "True"
    import litellm

    litellm.suppress_debug_info = True

    async def ask(content: list[dict[str, Any]]) -> str:
        reply = await litellm.acompletion(
            model="openai/bench",
            messages=content,
            api_base=api_base,
            api_key="none",
            max_tokens=4096,
            num_retries=0,
            max_retries=0,
        )
        return str(reply.choices[0].message.content)

    await run(ask)


async def main() -> None:
    how, api_base, picture_path, calls, concurrency = sys.argv[1:]
    data = base64.b64encode(Path(picture_path).read_bytes()).decode()
    picture = f"data:image/png;base64,{data}"
    numbers = iter(range(int(calls)))

    async def run(ask: Ask) -> None:
        async def worker() -> None:
            for number in numbers:
                assert await ask(messages(picture, number))

        await asyncio.gather(*(worker() for _ in range(int(concurrency))))

    await (with_aiohttp if how == "aiohttp" else with_litellm)(api_base, run)


if __name__ == "__main__":
    asyncio.run(main())
