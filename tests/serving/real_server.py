"""Real serving software with a tiny vision model of random weights, behind a proxy that counts."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import aiohttp
from aiohttp import web

__all__ = ["PICTURE_TOKENS", "CountingProxy", "missing_software", "serving"]

PICTURE_TOKENS = 64
"""What the tiny model makes of every picture."""

_PYTHON = os.environ.get("PHYBLOCK_SERVING_PYTHON", sys.executable)
_MAKER = Path(__file__).with_name("tiny_vision_model.py")
_PROMPTS = sorted((Path(__file__).parents[2] / "prompts").glob("*.j2"))
_PACKAGES = "torch, transformers, fastapi, uvicorn, openai, PIL"
_STARTS_WITHIN_S = 300.0


def missing_software() -> str:
    """Why nothing can be served; "" where it can."""
    try:
        found = subprocess.run(
            [_PYTHON, "-c", f"import {_PACKAGES}"], capture_output=True, text=True, timeout=300
        )
    except OSError as error:
        return f"PHYBLOCK_SERVING_PYTHON: {error}"
    if found.returncode == 0:
        return ""
    why = (found.stderr.strip().splitlines() or ["it ends without a word"])[-1]
    return f"{_PYTHON} has no serving software ({why}): see CONTRIBUTING.md"


@contextmanager
def serving(folder: Path) -> Iterator[tuple[str, str]]:
    """`transformers serve` with a model that is made in the folder: its address and model id."""
    model = folder / "tiny-vision"
    env = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_HOME": str(folder), "CUDA_VISIBLE_DEVICES": ""}
    # Not phyblock's own packages, where the interpreter is another.
    env.pop("PYTHONPATH", None)
    make = [_PYTHON, str(_MAKER), str(model), *map(str, _PROMPTS)]
    subprocess.run(make, env=env, check=True, capture_output=True, timeout=_STARTS_WITHIN_S)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    entry = "from transformers.cli.transformers import main; main()"
    words = ["serve", str(model), "--host", "127.0.0.1", "--port", str(port), "--device", "cpu"]
    log = folder / "serve.log"
    with log.open("wb") as out:
        server = subprocess.Popen([_PYTHON, "-c", entry, *words], env=env, stdout=out, stderr=out)
        try:
            _wait_until_healthy(f"http://127.0.0.1:{port}/health", server, log)
            yield f"http://127.0.0.1:{port}", str(model)
        finally:
            server.terminate()
            try:
                server.wait(30)
            except subprocess.TimeoutExpired:
                server.kill()
                server.wait()


def _wait_until_healthy(url: str, server: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + _STARTS_WITHIN_S
    while time.monotonic() < deadline:
        assert server.poll() is None, log.read_text(encoding="utf-8", errors="replace")[-3000:]
        try:
            with urllib.request.urlopen(url, timeout=5):
                return
        except OSError:
            time.sleep(0.5)
    raise AssertionError(log.read_text(encoding="utf-8", errors="replace")[-3000:])


@dataclass
class Exchange:
    """A request as the server got it, and what it answered."""

    body: dict[str, Any]
    status: int = 0
    answer: dict[str, Any] = field(default_factory=dict)

    @property
    def pictures(self) -> int:
        """How many pictures were sent."""
        contents = [message["content"] for message in self.body["messages"]]
        parts = [part for content in contents if isinstance(content, list) for part in content]
        return sum(part["type"] == "image_url" for part in parts)

    def without_pictures(self) -> dict[str, Any]:
        """The body of the request with its texts alone."""
        body: dict[str, Any] = json.loads(json.dumps(self.body))
        for message in body["messages"]:
            if isinstance(message["content"], list):
                message["content"] = [p for p in message["content"] if p["type"] == "text"]
        return body


class CountingProxy:
    """Passes requests on to a server, and keeps what it saw."""

    def __init__(self, to: str) -> None:
        self._to = to
        self.seen: list[Exchange] = []
        self.at_once = 0
        self.most_at_once = 0

    def app(self) -> web.Application:
        app = web.Application(client_max_size=64 * 2**20)
        app.router.add_post("/v1/chat/completions", self._pass_on)
        return app

    async def _pass_on(self, request: web.Request) -> web.Response:
        body = await request.read()
        exchange = Exchange(json.loads(body))
        self.seen.append(exchange)
        self.at_once += 1
        self.most_at_once = max(self.most_at_once, self.at_once)
        headers = {"Content-Type": "application/json"}
        try:
            async with (
                aiohttp.ClientSession() as session,
                session.post(self._to + request.path, data=body, headers=headers) as answer,
            ):
                said = await answer.read()
                exchange.status = answer.status
                exchange.answer = json.loads(said) if answer.status == 200 else {}
                return web.Response(body=said, status=answer.status, headers=headers)
        finally:
            self.at_once -= 1
