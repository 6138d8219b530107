"""No key and no picture reaches disk or terminal, whatever the server says."""

from __future__ import annotations

import base64

import pytest

from tests.servers.chassis import Faults, Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

KEYS = {
    "HOSTED_VLLM_API_KEY": "hv-5ecret-0123456789abcdef",
    "OPENAI_API_KEY": "sk-proj-5ecret0123456789abcdefghij",
    "ANTHROPIC_API_KEY": "sk-ant-5ecret0123456789abcdefghij",
    "GEMINI_API_KEY": "AIza5ecret0123456789abcdefghij",
    "MY_SERVER_KEY": 'a "plain" w\\ord/with 5ecret in it & <more>',
    "MY_SHORT_KEY": "5ecret!",
}
PNG_HEAD = base64.b64encode(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")[:20]


class Parrot(OpenAIChat):
    """Says the key in whatever it says."""

    def reply(self, seen: Seen, ending: str) -> dict[str, object]:
        body = super().reply(seen, ending)
        body["model"] = f"a model for {seen.key}"
        for choice in body["choices"]:
            choice["message"]["content"] += f"\nYour key is {seen.key}."
            choice["message"]["reasoning_content"] = f"The key is {seen.key}."
        return body

    def error(self, status: int, ending: str, message: str) -> dict[str, object]:
        return super().error(status, ending, f"{message} {self.seen[-1].key}")


def everything(workspace: Workspace) -> dict[str, bytes]:
    """All bytes below the workspace but the pictures."""
    files = (path for path in workspace.root.rglob("*") if path.is_file())
    return {str(path): path.read_bytes() for path in files if path.suffix != ".png"}


@pytest.mark.parametrize("transport", ["direct", pytest.param("litellm", marks=pytest.mark.slow)])
def test_keys_and_pictures_stay_off_the_disk(workspace: Workspace, transport: str) -> None:
    others = tuple((f"echo-key-{kind}", 0.04) for kind in ("in-reply", "json", "cut", "page"))
    faults = Faults(0.1, 0.1, malformed=0.1, retry_after="0", others=others)
    kinds = {"talks": faults, "locked": Faults(mode="echo-key"), "refuses": Faults(mode="400")}
    servers = {name: Parrot(each) for name, each in kinds.items()}
    with (
        Running(servers["talks"]) as talks,
        Running(servers["locked"]) as locked,
        Running(servers["refuses"]) as refuses,
    ):
        urls = {"talks": talks.url, "locked": locked.url, "refuses": refuses.url}
        common = {"transport": transport}
        entries = {
            name: {"id": f"hosted_vllm/{name}", "api_base": f"{url}/v1", **common}
            for name, url in urls.items()
        }
        # Other limits, so that none is answered from another's cached replies and its key unused.
        own_key = {"named": "MY_SERVER_KEY", "short": "MY_SHORT_KEY"}
        for max_tokens, (name, key) in enumerate(own_key.items(), start=1000):
            keyed = {"api_key_env": key, "max_tokens": max_tokens}
            entries[name] = {**entries["talks"], **keyed}
        entries["openai"] = {**entries["talks"], "id": "openai/some-model"}
        workspace.write_yaml("models.yaml", entries)
        # What fails for good is recorded with what the server said, and waits grow no longer.
        limits = {"max_attempts": 3, "retry_for_s": 0}
        workspace.write_suite(models=list(entries), seeds=[0, 1], limits=limits)
        told = [
            workspace.run("--yes", env=KEYS, fresh=True),
            workspace.run("--dry-run", env=KEYS),
        ]
        told.append(workspace.phyblock("models", env=KEYS))
        told += [workspace.phyblock("models", "check", n, env=KEYS) for n in ("talks", "locked")]
    used = {seen.key for server in servers.values() for seen in server.seen}
    names = ("HOSTED_VLLM_API_KEY", "MY_SERVER_KEY", "MY_SHORT_KEY", "OPENAI_API_KEY")
    assert used == {KEYS[name] for name in names}
    assert {r["outcome"] for r in workspace.records()} >= {"ok", "api_error"}

    found = everything(workspace)
    assert any(name.endswith("replies.sqlite") for name in found)
    found |= {f"output {i}": (done.out + done.err).encode() for i, done in enumerate(told)}
    for name, content in found.items():
        assert b"5ecret" not in content, name
        assert PNG_HEAD not in content, name
        assert b"IHDR" not in content, name
