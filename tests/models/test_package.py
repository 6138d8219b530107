"""The package as a whole: its public names, and what it does not import."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

CACHED = """
import asyncio, sys
from pathlib import Path
from phyblock.config.models import ModelConfig
from phyblock.models import Reply, ReplyCache
from phyblock.models import build_model, reply_key
from tests.models.factory import make_request
config = ModelConfig(name="m", id="anthropic/claude")
with ReplyCache(Path(sys.argv[1])) as cache:
    cache.put(reply_key(config, make_request()), config.id, Reply(text="kept"))
async def main():
    with ReplyCache(Path(sys.argv[1])) as cache:
        model = build_model(config, cache=cache)
        assert (await model.ask(make_request())).text == "kept"
        await model.aclose()
asyncio.run(main())
"""
IMPORTED = "\nprint([name for name in ('litellm', 'aiohttp', 'httpx') if name in sys.modules])"


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    environment = {"PYTHONPATH": str(ROOT), "PATH": ""}
    return subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=ROOT, env=environment
    )


@pytest.mark.parametrize("code", ["import sys, phyblock.models", CACHED])
def test_no_client_is_imported_before_a_call_is_sent(tmp_path: Path, code: str) -> None:
    assert python(code + IMPORTED, str(tmp_path / "c.sqlite")).stdout == "[]\n"
