"""The reply cache: what its key holds, what it keeps, and what may happen to its file."""

import contextlib
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.request import Image, Message, Request
from phyblock.records.record import Reply, Usage
from tests.models.factory import ROUTES, ask, make_model, make_request, with_fields
from tests.servers.chassis import Faults, Running

CONFIG = ModelConfig(name="m", id="openai/m", api_base="http://localhost:1/v1")
REPLY = Reply(
    text="Step1: Move block with index 3",
    reasoning="red",
    usage=Usage(prompt_tokens=10, completion_tokens=5, reasoning_tokens=2),
    latency_s=1.5,
)

values = st.none() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
params = st.dictionaries(st.text(min_size=1), values, max_size=4)
texts = st.text(max_size=20)
images = st.binary(max_size=20).map(lambda data: Image(data, "goal", 8, 8))
roles = st.sampled_from(["system", "user", "assistant"])
parts = st.lists(texts | images, max_size=4).map(tuple)
messages = st.lists(st.builds(Message, roles, parts), max_size=3).map(tuple)
requests = st.builds(
    Request, st.just("000"), st.integers(), messages, params, texts, st.just(make_request().subject)
)
configs = st.fixed_dictionaries(
    {
        "name": st.just("m"),
        "id": st.from_regex(r"[^ ]+", fullmatch=True).map("openai/{}".format),
        "api_base": st.sampled_from([None, "http://a/v1", "http://b/v1"]),
        "seed": st.sampled_from(["auto", "never"]),
        "revision": st.sampled_from([None, "step 2000"]),
        "image_detail": st.sampled_from([None, "low"]),
    }
).map(ModelConfig.model_validate)


def what_decides(config, request):
    """All that may change a reply, in a form that can be compared."""
    sent = {**request.params, **config.params}
    return (
        config.id,
        config.api_base is None,
        config.revision,
        config.seed,
        config.image_detail,
        sorted((k, type(v), v) for k, v in sent.items() if v is not None),
        [(m.role, [(type(p), getattr(p, "data", p)) for p in m.parts]) for m in request.messages],
        request.seed,
        request.prompt_version,
    )


@given(configs, requests, configs, requests)
def test_keys_are_equal_when_all_that_decides_is_equal(config, request, other_config, other):
    same = what_decides(config, request) == what_decides(other_config, other)
    assert (reply_key(config, request) == reply_key(other_config, other)) == same


@pytest.mark.parametrize(
    "fields",
    [
        {"name": "other"},
        {"transport": "litellm", "max_concurrency": 1, "rpm": 5, "tpm": 5},
        {"price": {"input": 1, "output": 2}, "timeout_s": 1.0, "api_key_env": "KEY"},
        {"api_base": "http://node17:2/v1"},
        {"temperature": 0.5},
    ],
)
def test_what_does_not_change_a_reply_does_not_change_the_key(fields):
    asked = replace(make_request(), key="another")
    assert reply_key(with_fields(CONFIG, **fields), asked) == reply_key(CONFIG, make_request())


ADDRESSES = ("http://h:1/v1", "http://h:2/v1")
KEPT = {
    "da26e80f60ba671d212c7498da47fbd0dbd71c1b46732c6d2c148c278a893d61":
        {"id": "openai/gpt-4o-2024-08-06"},
    "67e5b54ebfc56b69c085c8a2f534e8e41f06d4198f75d935380be11b5d94f33c":
        {"id": "hosted_vllm/m", "api_base": ADDRESSES[0]},
    "96c5a4f440a6e0000195db8b63f7ba8df6d180e545ac34fd9cedd774e66affad":
        {"id": "hosted_vllm/m", "api_base": ADDRESSES, "revision": "step 2000"},
    "37622ac0a811a5a9c762ad4abde879776ce5fb7f9fa0419725ae62918fd86304":
        {"id": "anthropic/claude-3-7-sonnet-20250219", "response_format": "always"},
    "a14f0001e429abe0ab22df5f60f26e7625f8c676caacaac73ead6ee7fab022fa":
        {"id": "gemini/gemini-2.5-flash", "image_detail": "high"},
    "858731d24454896fd8c6c23fc69ac216ffa891f422523cb42357a672a0c63f56":
        {"id": "xai/grok-4", "seed": "never"},
    "6cdce32307d28e532ff4d6270a52656f96ced41d5c7fcfb535532a19f9eb9dda":
        {"id": "openai/o4-mini", "reasoning_effort": "high", "extra_body": {"top_k": 1}},
}  # fmt: skip
"""Keys as the first caches have them, by the models that they are of."""


@pytest.mark.parametrize("key", KEPT)
def test_the_keys_of_kept_replies_stay(key):
    goal = Image(b"\x89PNG\r\n\x1a\ngoal", "goal", 8, 8)
    request = Request(
        "l2-001",
        3,
        (Message("system", ("You build.",)), Message("user", ("Goal:", goal, "Which blocks?"))),
        {"temperature": 0.0, "max_tokens": 4096, "top_p": None},
        "v1",
        None,
        response_format={"type": "json_schema", "json_schema": {"name": "plan"}},
    )
    assert reply_key(ModelConfig(name="m", **KEPT[key]), request) == key


def test_a_reply_comes_back_whole_and_marked(tmp_path):
    asked = REPLY.model_copy(update={"seed_sent": False, "text": "å\ud800 \x00"})
    with ReplyCache(tmp_path / "deep" / "replies.sqlite") as cache:
        assert cache.get("k") is None
        cache.put("k", "openai/m", asked)
        assert cache.get("k") == asked.model_copy(update={"cached": True, "attempts": 0})


NO_REPLIES = ("{}", '{"text": 1', '{"text": "a", "usage": {}, "finish": "perhaps"}', "[" * 10**5)


@pytest.mark.parametrize("content", [*NO_REPLIES, b"\xff\xfe\xfd", 7])
def test_a_row_that_is_no_reply_is_missing_and_is_overwritten(tmp_path, content):
    path = tmp_path / "c.sqlite"
    with ReplyCache(path) as cache:
        cache.put("k", "openai/m", REPLY)
        cache.put("whole", "openai/m", REPLY)
    db = sqlite3.connect(path)
    with db:
        # As a text, whatever bytes it is made of.
        sql = "UPDATE replies SET reply = CAST(? AS TEXT) WHERE key = 'k'"
        db.execute(sql, (content,))
    db.close()
    with ReplyCache(path, report=pytest.fail) as cache:
        assert cache.get("k") is None
        assert cache.get("whole") is not None
        cache.put("k", "openai/m", REPLY)
        assert cache.get("k") is not None


WRITER = """
import sys
from pathlib import Path
from phyblock.models.cache import ReplyCache
from phyblock.records.record import Reply
with ReplyCache(Path(sys.argv[1])) as cache:
    for number in range(10**6):
        cache.put(f"{sys.argv[2]}-{number}", "openai/m", Reply(text=f"reply {number}"))
        print(number, flush=True)
"""


def test_what_two_samples_ask_at_the_same_time_is_asked_once(tmp_path):
    server = ROUTES["direct"].server(Faults(latency_s=0.05))
    with Running(server) as running, ReplyCache(tmp_path / "c.sqlite") as cache:
        config = ROUTES["direct"].config(running.url)
        answers = ask(make_model(config, cache=cache), *[make_request()] * 5)
    assert server.requests == 1
    assert [answer.cached for answer in answers if isinstance(answer, Reply)].count(True) == 4


def test_what_processes_kept_at_once_in_one_file_survives_their_kill(tmp_path):
    path, writers = tmp_path / "c.sqlite", {}
    with contextlib.ExitStack() as stack:
        for name in "ab":
            command = [sys.executable, "-c", WRITER, str(path), name]
            options = {"stdout": subprocess.PIPE, "text": True, "cwd": Path(__file__).parents[2]}
            writers[name] = stack.enter_context(subprocess.Popen(command, **options))
        for _ in range(50):
            numbers = {name: int(process.stdout.readline()) for name, process in writers.items()}
        for process in writers.values():
            process.kill()
    with ReplyCache(path) as cache:
        assert all(cache.get(f"{name}-{n}") for name in "ab" for n in range(numbers[name] + 1))
        cache.put("after", "openai/m", REPLY)
        assert cache.get("after")
