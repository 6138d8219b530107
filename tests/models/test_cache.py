"""Replies that nobody is asked for: the cache, recordings and baselines."""

import asyncio
import contextlib
import json
import re
import sqlite3
import subprocess
import sys
from codecs import BOM_UTF8
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.domain.scene import Candidate, CandidateSet
from phyblock.errors import DataError, RefusedError, SampleError
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import read_raw_reply
from phyblock.models.model import build_model
from phyblock.models.request import Image, Message, Request
from phyblock.records.record import Reply, Usage
from phyblock.tracks.full_planning import FullPlanning, PlanSubject
from tests.data.broken import plan_record
from tests.fuzz.strategies import documents
from tests.models import factory
from tests.models.factory import ROUTES, ask, make_model, make_request, with_fields
from tests.servers.chassis import Faults, Running
from tests.workspace import problem_of

CONFIG = ModelConfig(name="m", id="openai/m", api_base="http://localhost:1/v1")
USAGE = Usage(prompt_tokens=10, completion_tokens=5, reasoning_tokens=2)
REPLY = Reply(text="Step1: ...", reasoning="red", usage=USAGE, latency_s=1.5)
STEPS = "Step1: Move block with index 3"
OURS = Reply(text=STEPS, reasoning="red", usage=USAGE, cost_usd=0.5, seed_sent=False)
keys = st.text(min_size=1, max_size=5)
seeds = st.integers(0, 10**6)

values = st.none() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
params = st.dictionaries(st.text(min_size=1), values, max_size=4)
texts = st.text(max_size=20)
images = st.binary(max_size=20).map(lambda data: Image(data, "goal", 8, 8))
parts = st.lists(texts | images, max_size=4).map(tuple)
messages = st.builds(Message, st.sampled_from(["system", "user", "assistant"]), parts)
requests = st.builds(
    lambda *asked: Request("000", *asked, make_request().subject),
    st.integers(),
    st.lists(messages, max_size=3).map(tuple),
    params,
    texts,
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
    messages = Message("system", ("You build.",)), Message("user", ("Goal:", goal, "Which blocks?"))
    params = {"temperature": 0.0, "max_tokens": 4096, "top_p": None}
    form = {"type": "json_schema", "json_schema": {"name": "plan"}}
    request = Request("l2-001", 3, messages, params, "v1", None, response_format=form)
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
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        # As a text, whatever bytes it is made of.
        db.execute("UPDATE replies SET reply = CAST(? AS TEXT) WHERE key = 'k'", (content,))
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
    assert sorted(answer.cached for answer in answers) == [False] + [True] * 4


def test_what_processes_kept_at_once_in_one_file_survives_their_kill(tmp_path):
    path, writers = tmp_path / "c.sqlite", {}
    options = {"stdout": subprocess.PIPE, "text": True, "cwd": Path(__file__).parents[2]}
    with contextlib.ExitStack() as stack:
        for name in "ab":
            command = [sys.executable, "-c", WRITER, str(path), name]
            writers[name] = stack.enter_context(subprocess.Popen(command, **options))
        for _ in range(50):
            numbers = {name: int(process.stdout.readline()) for name, process in writers.items()}
        for process in writers.values():
            process.kill()
    with ReplyCache(path) as cache:
        assert all(cache.get(f"{name}-{n}") for name in "ab" for n in range(numbers[name] + 1))
        cache.put("after", "openai/m", REPLY)
        assert cache.get("after")


# Recorded replies in the place of a model, and baselines.


def asked(request, **fields):
    model = build_model(ModelConfig(**{"name": "m"} | fields), cache=None)
    assert not model.needs_messages
    return asyncio.run(model.ask(request))


def answer(folder, key, seed=0):
    return asked(make_request(key, seed), replay=str(folder))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b'{"predict": "a"', r"007\.json:\d+: is not JSON"),
        (b"\xff\xfe\x00", r"007\.json: is not UTF-8"),
        (b"[" * 100_000, r"007\.json: is nested more than 64 levels"),
        (b'{"text": ' + b"9" * 100_000 + b"}", "holds a number of 100,000 digits"),
        (b'{"error": "overloaded"}', "not a recorded reply of a known shape"),
    ],
)
def test_a_broken_recording_is_an_error_at_its_place(tmp_path, content, said):
    (tmp_path / "007.json").write_bytes(content)
    with pytest.raises(DataError, match=said):
        answer(tmp_path, "007")
    (tmp_path / "008.json").write_bytes(BOM_UTF8 + b'{"text": "whole"}')
    assert answer(tmp_path, "008").text == "whole"


def record(model, scene, seed, **fields):
    named = {"sample": f"full_planning/{model}/{scene}/s{seed}", "scene": scene}
    whole = {
        "model": model,
        "key": scene,
        "seed": seed,
        "reply": OURS.model_dump(),
        "error": None,
    }
    return json.dumps({**plan_record(), **named, **whole, **fields}) + "\n"


def test_a_run_of_our_own_is_matched_by_model_key_and_seed(tmp_path):
    (tmp_path / "records.jsonl").write_text(
        record("m", "007", 1)
        + record("n", "007", 1, reply=Reply(text="other").model_dump())
        + record("m", "007", 2, reply=Reply(text="first").model_dump())
        + record("m", "007", 2, reply=Reply(text="last").model_dump())
        + record("m", "008", 1, reply=None)
        + '{"model": "m", "key": "009"'
    )
    kept = OURS.model_copy(update={"cost_usd": 0.0, "attempts": 0})
    found = [answer(tmp_path, *asked) for asked in (("007", 1), ("007", 2), ("007", 3))]
    assert (found[0], found[1].text, found[2]) == (kept, "last", None)
    assert [answer(tmp_path, key, 1) for key in ("008", "009")] == [None, None]


@pytest.mark.parametrize(("kind", "error"), [("sample", SampleError), ("refused", RefusedError)])
def test_a_recorded_error_is_raised_again(tmp_path, kind, error):
    failed = {"kind": kind, "status": 400, "message": "no"}
    (tmp_path / "records.jsonl").write_text(record("m", "007", 1, reply=None, error=failed))
    with pytest.raises(error, match="no") as caught:
        answer(tmp_path, "007", 1)
    assert caught.value.status == 400


def choice(message, finish="stop"):
    return {"choices": [{"index": 0, "finish_reason": finish, "message": message}]}


def reply(text, finish="unknown", reasoning="", **counts):
    return Reply(text=text, finish=finish, reasoning=reasoning, usage=Usage(**counts))


def named(model, one):
    return one.model_copy(update={"provider_model": model})


PART = {"type": "text", "text": "a"}
DETAILS = {"prompt_tokens_details": {"cached_tokens": 3, "cache_write_tokens": 1},
           "completion_tokens_details": {"reasoning_tokens": 2}}  # fmt: skip


def candidate(*parts, **fields):
    return {"candidates": [{"content": {"parts": list(parts)}, **fields}]}


SHAPES = {
    "openai": (
        {**choice({"role": "assistant", "content": STEPS, "refusal": None}), "model": "gpt",
         "usage": {"prompt_tokens": 7, "completion_tokens": 5, **DETAILS}},
        named("gpt", reply(STEPS, "stop", prompt_tokens=7, completion_tokens=5, reasoning_tokens=2,
                           cached_tokens=3, cache_write_tokens=1))),
    "openai refusal": (
        choice({"content": None, "refusal": "I will not"}), reply("I will not", "refusal")),
    "openai cut": (choice({"content": ""}, "length"), reply("", "length")),
    "reasoning beside": (
        choice({"content": STEPS, "reasoning_content": "red"}), reply(STEPS, "stop", "red")),
    "parts": (choice({"content": [PART, {**PART, "text": "b"}]}), reply("ab", "stop")),
    "completion with text": (
        {"choices": [{"text": STEPS, "finish_reason": "length"}]}, reply(STEPS, "length")),
    "anthropic": (
        {"model": "claude", "content": [{"type": "text", "text": STEPS, "citations": None}],
         "usage": {"input_tokens": 7, "output_tokens": 5, "cache_read_input_tokens": 2},
         "stop_reason": "end_turn"},
        named("claude", reply(STEPS, "stop", prompt_tokens=9, completion_tokens=5,
                              cached_tokens=2))),
    "anthropic thinking": (
        {"content": [{"type": "thinking", "thinking": "red"}, {"type": "text", "text": STEPS}],
         "stop_reason": "max_tokens"},
        reply(STEPS, "length", "red")),
    "gemini of the client": (
        {**candidate({"text": STEPS, "thought": None}, finish_reason="STOP"),
         "model_version": "gemini",
         "usage_metadata": {"prompt_token_count": 7, "candidates_token_count": 5}},
        named("gemini", reply(STEPS, "stop", prompt_tokens=7, completion_tokens=5))),
    "gemini of the wire": (
        {**candidate({"text": "red", "thought": True}, {"text": STEPS}, finishReason="MAX_TOKENS"),
         "usageMetadata": {"promptTokenCount": 7, "thoughtsTokenCount": 3}},
        reply(STEPS, "length", "red", prompt_tokens=7, reasoning_tokens=3)),
    "gemini with an enum's name": (
        candidate(finish_reason="FinishReason.SAFETY"), reply("", "refusal")),
    "gemini blocked": (
        {"candidates": [], "promptFeedback": {"blockReason": "SAFETY"}}, reply("", "refusal")),
    "gemini without content": (
        {"candidates": [{"content": None, "finish_reason": "MAX_TOKENS"}]}, reply("", "length")),
    "gemini without candidates": (
        {"candidates": None, "usage_metadata": {"prompt_token_count": 7}},
        reply("", prompt_tokens=7)),
    "internvl": ({"input": "", "output": "gold", "image": ["a"], "predict": STEPS}, reply(STEPS)),
    "text": ({"text": STEPS, "model_id": "llava"}, reply(STEPS)),
    "response": ({"response": STEPS}, reply(STEPS)),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_read(name):
    raw, expected = SHAPES[name]
    assert read_raw_reply(raw, "000.json") == expected


OTHERS = (
    {}, {"error": {"message": "overloaded"}}, {"choices": []}, [], "a text", None, 17,
    {"candidates": []}, {"content": "not a list"},
)  # fmt: skip


@pytest.mark.parametrize("raw", OTHERS, ids=repr)
def test_another_shape_is_an_error_that_names_the_file_and_its_keys(raw):
    problem = problem_of(DataError, read_raw_reply, raw, "outputs/x/007.json")
    found = f"keys {', '.join(raw)}" if isinstance(raw, dict) else type(raw).__name__
    assert ("outputs/x/007.json" in problem.where, problem.found) == (True, found)


DOCUMENTS = documents(
    *("choices", "message", "content", "text", "output", "usage", "candidates", "parts", "value"),
    *("finish_reason", "thinking", "response", "body", "predict", "promptFeedback", "refusal"),
    *("model", "modelVersion", "prompt_tokens", "input_tokens", "promptTokenCount"),
)


@given(DOCUMENTS)
def test_any_document_is_read_or_refused_with_a_data_error(raw):
    """Values that are read can be written: texts as UTF-8, counts as numbers."""
    try:
        read = read_raw_reply(raw, "x.json")
    except DataError:
        return
    assert read.storable() == read
    for text in (read.text, read.reasoning, read.provider_model):
        text.encode()


def steps(name, request):
    """The steps of a reply whose every line has the benchmark's form."""
    lines = asked(request, name=name).text.splitlines()
    read = [re.fullmatch(r"Step(\d+): Move block with index (\d+)", line) for line in lines]
    assert [int(match[1]) for match in read if match] == list(range(1, len(lines) + 1))
    return [int(match[2]) for match in read if match]


@pytest.mark.parametrize(("name", "looks"), [("oracle", "look"), ("oracle-no-orientation", "kind")])
@given(keys, seeds)
def test_the_oracle_gives_a_valid_order_of_what_it_looks_at(name, looks, key, seed):
    """Without orientation, only the orientation is wrong."""
    named = [factory.CANDIDATES[index] for index in steps(name, make_request(key, seed))]
    blocks = [getattr(block, looks) for block in factory.SCENE.blocks]
    order = [blocks.index(getattr(candidate, looks)) for candidate in named]
    assert factory.SCENE.graph.is_valid(order)
    for candidate, place in zip(named, order, strict=True):
        block = factory.SCENE.blocks[place]
        assert (candidate.look == block.look) == (looks == "look" or block.type != "arch")


@pytest.mark.parametrize("name", FullPlanning.baselines)
def test_what_is_drawn_depends_on_seed_and_key_alone(name):
    many = [make_request(f"{key:03}", seed) for key in range(10) for seed in range(5)]
    forwards = {(r.key, r.seed): asked(r, name=name) for r in many}
    backwards = {(r.key, r.seed): asked(r, name=name) for r in reversed(many)}
    assert forwards == backwards
    if name not in ("all-candidates", "goal-blind", "color-areas"):
        assert len({answer.text for answer in forwards.values()}) > 1


def test_an_oracle_without_its_candidate_is_an_error():
    poor = CandidateSet((Candidate("triangle", "orange", (0.0, 0.0, 0.0)),))
    with pytest.raises(DataError, match="no candidate looks like this block"):
        asked(replace(make_request(), subject=PlanSubject(factory.SCENE, poor)), name="oracle")
