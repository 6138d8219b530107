"""Addresses of servers: nothing secret is accepted, and nothing that was refused is shown."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from phyblock.config.models import ModelConfig, address_fault, host_of, load_models
from phyblock.errors import SpecError
from phyblock.models import server_address
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

SECRET = "hunter2-5ecret"
GOOD = [
    "http://localhost:8000/v1",
    "https://api.openai.com/v1",
    "HTTP://10.0.0.1",
    "http://[::1]:8000/v1",
    "http://[fe80::1%25eth0]/v1",
    "https://b\u00fccher.example/v1",
    "https://api.cloudflare.com/client/v4/accounts/1/ai/run/@cf/meta",
    "http://my_server/v1",
]
SECRETIVE = [
    f"http://me:{SECRET}@host/v1",
    f"http://{SECRET}@host/v1",
    f"https://host/v1?api_key={SECRET}",
    f"https://host/v1#{SECRET}",
    f"https://host/v1;x?{SECRET}",
    f"me:{SECRET}@host/v1",
    f"http://me:{SECRET}/x@host/v1",
    f"http://host\\@{SECRET}",
    f"http://[::1/v1?k={SECRET}",
]
MALFORMED = [
    "",
    "localhost:8000",
    "ftp://host/v1",
    "http://",
    "http:///v1",
    "http://[::1/v1",
    "http://::1/v1",
    "http://[1.2.3.4]/v1",
    "http://host:port/v1",
    "http://host:99999/v1",
    "http://host:0/v1",
    "http://a..b/v1",
    f"http://{'a' * 64}.example/v1",
    "http://ho st/v1",
    "http://host/v1\n",
    "http://host/\x00",
    "http://host/\ud800",
    f"http://host/{'a' * 2_000}",
]


@pytest.mark.parametrize("url", GOOD)
def test_an_address_is_one(url: str) -> None:
    assert address_fault(url) is None


@pytest.mark.parametrize("url", [*SECRETIVE, *MALFORMED])
def test_what_is_none_is_refused_without_being_shown(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = address_fault(url)
    assert fault is not None
    assert SECRET not in fault.message + fault.hint
    assert fault.may_hold_secret or SECRET not in url
    with pytest.raises(ValidationError, match="api_base"):
        ModelConfig(name="m", id="openai/m", api_base=url)
    if url and "\x00" not in url and "\ud800" not in url:
        monkeypatch.setenv("HOSTED_VLLM_API_BASE", url)
        with pytest.raises(SpecError, match="variable HOSTED_VLLM_API_BASE") as refused:
            server_address("hosted_vllm/m")
        assert SECRET not in str(refused.value)


@pytest.mark.parametrize("url", SECRETIVE)
def test_a_models_file_with_a_secret_in_an_address_is_refused(url: str, tmp_path: Path) -> None:
    path = tmp_path / "models.yaml"
    path.write_text(f"m: {{id: openai/m, api_base: '{url}'}}\n")
    with pytest.raises(SpecError, match=r"m\.api_base") as refused:
        load_models(path)
    assert SECRET not in str(refused.value)
    assert "api_key_env" in str(refused.value) or "localhost:8000" in str(refused.value)


@given(st.text(min_size=1), st.text(), st.sampled_from(["http", "https"]))
def test_no_user_gets_through(user: str, rest: str, scheme: str) -> None:
    url = f"{scheme}://{user.translate({ord(c): 'x' for c in '/?#'})}@host/{rest}"
    assert address_fault(url) is not None


@given(st.text())
def test_any_text_is_an_address_or_refused(url: str) -> None:
    fault = address_fault(url)
    assert (fault is None) == (fault is None and url.lower().startswith(("http://", "https://")))
    assert "/" not in host_of(url)


def test_a_host_is_shown_without_what_stands_around_it() -> None:
    assert host_of(f"https://me:{SECRET}@host:8443/v1?key={SECRET}#x") == "host:8443"
    assert host_of("http://[::1]:80/v1") == "[::1]:80"
    assert host_of("http://[::1/v1") == host_of("/v1") == "an unreadable address"


@pytest.mark.parametrize("url", [SECRETIVE[0], "http://[::1/v1"])
def test_a_bad_address_in_the_environment_ends_before_anything_is_written(
    workspace: Workspace, url: str
) -> None:
    workspace.write_yaml("models.yaml", {"m": "hosted_vllm/m"})
    workspace.write_suite(models=["m"])
    before = workspace.files()
    variable = {"HOSTED_VLLM_API_BASE": url}
    for done in (
        workspace.run(env=variable),
        workspace.run("--dry-run", env=variable),
        workspace.phyblock("validate", "suite.yaml", env=variable),
    ):
        assert done.code == 2
        assert "variable HOSTED_VLLM_API_BASE" in done.err
        assert SECRET not in done.out + done.err
        assert "Traceback" not in done.err
    assert workspace.files() == before


def test_a_key_that_no_header_can_carry_is_named_before_anything_is_sent(
    workspace: Workspace,
) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "m", api_key_env="MY_KEY")
        workspace.write_suite(models=["m"], seeds=[0])
        done = workspace.run(env={"MY_KEY": f"{SECRET}\nand-more"})
        assert done.code == 2
        assert "MY_KEY holds a line break" in done.err
        assert SECRET not in done.err
        assert running.server.requests == 0
        done = workspace.run("--yes", env={"MY_KEY": f" {SECRET}\r\n"})
    assert (done.code, done.err) == (0, "")
    assert {seen.key for seen in running.server.seen} == {SECRET}
