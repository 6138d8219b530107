"""A command that lists servers: bounded in time and size, run without a shell, run again."""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

import pytest

from phyblock.errors import SpecError
from phyblock.models import Breakers, ModelConfig, Reply, RetryPolicy
from phyblock.models import address_command as seam
from phyblock.models.address_command import AddressCommand, addresses_by
from phyblock.models.limits import Clock
from tests.models.factory import make_model, make_request, run
from tests.servers.chassis import start
from tests.servers.openai_chat import OpenAIChat

BAD = [
    (["no-such-program-here"], "cannot be run: No such file"),
    (["sh", "-c", "echo gone >&2; exit 3"], "ends with code 3: gone"),
    (["true"], "lists no address"),
    (["echo", "localhost"], "is not the address of a server"),
    (["echo", "http://a:1/v1?key=secret"], "holds a query"),
    (["printf", "http://a:1\\nhttp://a:1"], "stands twice"),
    (["printf", "\\377"], "prints what is no UTF-8"),
    (["yes", "http://a:1/v1"], "prints more than 1,048,576 bytes"),
    (["echo", "bad\0word"], "cannot be run: embedded null byte"),
]


@pytest.mark.parametrize("script", ['echo "Bearer $MY_KEY" >&2; exit 2', 'echo "$MY_KEY"'])
def test_what_it_prints_of_keys_stands_in_no_message(
    script: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MY_KEY", "a-long-word-of-mine")
    with pytest.raises(SpecError) as caught:
        addresses_by(["sh", "-c", script])
    assert "a-long-word-of-mine" not in str(caught.value)
    assert "[key]" in str(caught.value)


@pytest.mark.parametrize(("words", "message"), BAD, ids=[words[0] for words, _ in BAD])
def test_what_cannot_be_used_is_said_in_words(words: list[str], message: str) -> None:
    with pytest.raises(SpecError) as caught:
        addresses_by(words)
    (problem,) = caught.value.problems
    assert message in str(problem)
    assert problem.field == "api_base_command"
    assert "secret" not in str(problem)


def test_words_are_no_shells(tmp_path: Path) -> None:
    marker = tmp_path / "marker"
    with pytest.raises(SpecError):
        addresses_by(["echo", f"http://a:1/v1; touch {marker} $(touch {marker})"])
    assert not marker.exists()
    assert addresses_by(["printf", "# two\\nhttp://a:1/v1\\n\\n http://b:2/v1"]) == (
        "http://a:1/v1",
        "http://b:2/v1",
    )


def test_one_that_does_not_end_is_ended_with_all_that_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(seam, "LONGEST_S", 0.3)
    late = tmp_path / "late"
    with pytest.raises(SpecError, match=r"does not end within 0\.3 s"):
        addresses_by(["sh", "-c", f"(sleep 1; touch {late}) & echo http://a:1/v1; sleep 60"])
    time.sleep(1.0)
    assert not late.exists()


def test_one_that_closes_what_it_prints_to_may_go_on_for_a_while() -> None:
    words = ["sh", "-c", "echo http://a:1/v1; exec >&- 2>&-; sleep 1.2"]
    assert addresses_by(words) == ("http://a:1/v1",)


@pytest.mark.parametrize(
    ("place", "error"),
    [
        ("selectors.DefaultSelector", OSError(24, "Too many open files")),
        ("asyncio.to_thread", RuntimeError("can't start new thread")),
    ],
)
def test_the_list_that_is_known_holds_when_nothing_more_can_be_started(
    monkeypatch: pytest.MonkeyPatch, place: str, error: Exception
) -> None:
    """It is not run when it is taken up, but as soon as it is looked at."""
    told: list[str] = []

    def fail(*_: object) -> object:
        raise error

    async def main() -> tuple[str, ...]:
        command = AddressCommand(["cat"], Clock(), told.append, ("http://a:1/v1",))
        # A loop needs a selector of its own to begin.
        monkeypatch.setattr(place, fail)
        while not told:
            assert not command.has_changed()
            await asyncio.sleep(0.01)
        await command.aclose()
        return command.addresses

    assert run(main) == ("http://a:1/v1",)
    (text,) = told
    assert text.startswith("the servers stay the same: the command cat: ")
    assert "cannot be run: " in text


def test_its_list_is_taken_up_while_a_run_goes_on(tmp_path: Path) -> None:
    """As `squeue` would say it; a hundred times as often."""
    listed, said = tmp_path / "listed", list[str]()
    clock = Clock(lambda: 100 * time.monotonic(), lambda wait_s: asyncio.sleep(wait_s / 100))
    policy = RetryPolicy(base_s=1.0, max_wait_s=5.0, clock=clock)
    servers = [OpenAIChat() for _ in range(2)]

    async def until_told(count: int, model: object) -> list[object]:
        """Ask one after the other until so much was said."""
        replies: list[object] = []
        while len(said) < count:
            key = f"{count}-{len(replies):04}"
            replies.append(await model.ask(make_request(key)))  # type: ignore[attr-defined]
            await asyncio.sleep(0.01)
        return replies

    async def main() -> list[object]:
        started = [await start(server, 0) for server in servers]
        first, second = (f"http://127.0.0.1:{port}/v1" for _, port in started)
        listed.write_text(first, encoding="utf-8")
        config = ModelConfig("m", "litellm", "hosted_vllm/m", api_base_command=("cat", str(listed)))
        model = make_model(config, policy=policy, breakers=Breakers(policy, said.append))
        replies: list[object] = [await model.ask(make_request("000"))]
        assert (servers[0].requests, servers[1].requests) == (1, 0)
        listed.unlink()
        replies += await until_told(1, model)
        asked = servers[0].requests
        assert asked == len(replies)
        listed.write_text(second, encoding="utf-8")
        replies += await until_told(2, model)
        replies.append(await model.ask(make_request("999")))
        assert servers[1].requests >= 1
        await model.aclose()
        for runner, _ in started:
            await runner.cleanup()
        return replies

    assert {type(reply) for reply in run(main)} == {Reply}
    assert said[0].startswith("the servers stay the same: the command cat: ")
    assert "ends with code 1" in said[0]
    assert said[1:] == ["m now has 1 server"]


def test_a_run_that_ends_does_not_wait_for_it(tmp_path: Path) -> None:
    slow = (
        "import sys, time, os; os.path.exists(sys.argv[1]) and time.sleep(60); print('http://a:1')"
    )
    marker = tmp_path / "marker"
    now_s = 0.0

    async def main() -> float:
        nonlocal now_s
        command = AddressCommand(
            [sys.executable, "-c", slow, str(marker)], Clock(lambda: now_s), lambda _: None
        )
        marker.touch()
        now_s = 100.0
        assert not command.has_changed()
        await asyncio.sleep(0.2)
        began_s = time.monotonic()
        await command.aclose()
        return time.monotonic() - began_s

    assert run(main) < 30
