"""The package as a whole: its public names, and what it does not import."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import phyblock.models
from tests.servers.chassis import Running
from tests.servers.gemini_generate import GeminiGenerate

ROOT = Path(__file__).parents[2]

CACHED = """
import asyncio, sys
from pathlib import Path
from phyblock.config.models import ModelConfig
from phyblock.models import Gate, Reply, ReplyCache
from phyblock.models import build_model, reply_key
from tests.models.factory import make_request
config = ModelConfig(name="m", id="anthropic/claude")
with ReplyCache(Path(sys.argv[1])) as cache:
    cache.put(reply_key(config, make_request()), config.id, Reply(text="kept"))
async def main():
    with ReplyCache(Path(sys.argv[1])) as cache:
        model = build_model(config, cache=cache, overall=Gate(1))
        assert (await model.ask(make_request())).text == "kept"
        await model.aclose()
asyncio.run(main())
"""
IMPORTED = "\nprint([name for name in ('litellm', 'aiohttp', 'httpx') if name in sys.modules])"

SENDING = """
import asyncio, os, sys
from phyblock.config.models import ModelConfig
from phyblock.models import Gate, RetryPolicy, build_model
from tests.models.factory import make_request
os.chdir(sys.argv[1])
model = build_model(
    ModelConfig(name="m", id="gemini/gemini-2.5-flash", api_base=sys.argv[2]),
    cache=None, overall=Gate(1), policy=RetryPolicy(attempts=1, retry_for_s=0.0),
)
async def main():
    try:
        print((await model.ask(make_request())).usage.prompt_tokens)
    except Exception as error:
        print(error)
    await model.aclose()
asyncio.run(main())
print(os.environ.get("FROM_DOTENV"))
"""


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    # In its mode "DEV", litellm would read keys from any .env file above.
    environment = {"PYTHONPATH": str(ROOT), "PATH": "", "LITELLM_MODE": "DEV"}
    return subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=ROOT, env=environment
    )


def test_every_public_name_is_there() -> None:
    for name in phyblock.models.__all__:
        assert hasattr(phyblock.models, name)
    assert sorted(phyblock.models.__all__) == phyblock.models.__all__


@pytest.mark.parametrize("code", ["import sys, phyblock.models", CACHED])
def test_no_client_is_imported_before_a_call_is_sent(tmp_path: Path, code: str) -> None:
    assert python(code + IMPORTED, str(tmp_path / "c.sqlite")).stdout == "[]\n"


def test_litellm_reads_no_key_file_says_nothing_and_sends_through_our_client(
    tmp_path: Path,
) -> None:
    (tmp_path / ".env").write_text("FROM_DOTENV=1\nGEMINI_API_KEY=sk-from-a-file-12345\n")
    with Running(GeminiGenerate()) as running:
        done = python(SENDING, str(tmp_path), running.url)
    # Not one of the clients that litellm made when it was imported has sent it, past ours.
    assert done.stdout == "1000\nNone\n"
    assert done.stderr == ""
    assert [seen.key for seen in running.server.seen] == ["no-key"]
