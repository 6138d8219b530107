"""Models files: each bad one is told in words at its place; secrets, addresses, groups."""

import contextlib
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.config import models as config
from phyblock.config.models import host_of, is_address, load_models
from phyblock.errors import SpecError
from phyblock.models.client import server_address
from phyblock.registry import baseline_names
from tests.config.tables import told
from tests.fuzz.strategies import MODELS_FILES


def load(folder, text):
    path = folder / "m.yaml"
    path.write_text(text, encoding="utf-8")
    return load_models(path)


def test_one_line_is_enough_and_a_mapping_says_more(tmp_path):
    text = """
gpt-4o: openai/gpt-4o-2024-08-06
on: a/b
1e-3: a/b
old: {replay: replies/old, published: GPT-4o}
m:
  id: hosted_vllm/Qwen/Qwen2.5-VL-7B-Instruct
  api_base: [http://h:1/v1, http://h:2/v1]
"""
    models = load(tmp_path, text)
    assert list(models) == ["gpt-4o", "on", "1e-3", "old", "m"]
    assert models["gpt-4o"] == config.ModelConfig(name="gpt-4o", id="openai/gpt-4o-2024-08-06")
    assert models["old"].replay == str(tmp_path / "replies" / "old")
    assert models["m"].addresses == ("http://h:1/v1", "http://h:2/v1")
    assert load(tmp_path, "# none yet\n") == {}
    for name in ("openai/task-abc-def", "azure/risk-big", "a/disk-12345678"):  # are no keys
        assert load(tmp_path, f"m: {name}\n")["m"].id == name


def test_a_parameter_left_out_is_the_suites_and_null_is_not_sent(tmp_path):
    defaults = config.SamplingSpec(temperature=0.5, top_p=0.9, max_tokens=100).model_dump()
    models = load(tmp_path, "a: {id: x/y, temperature: null, max_tokens: 7}\nb: x/y\n")
    assert models["a"].with_defaults(defaults).params == {"top_p": 0.9, "max_tokens": 7}
    assert models["b"].with_defaults(defaults).params == defaults


OPTIONS = st.fixed_dictionaries(
    {"id": st.just("openai/m")},
    optional={
        "temperature": st.none() | st.floats(0, 2),
        "max_tokens": st.none() | st.integers(1, 10**6),
        "api_base": st.just("http://h") | st.just(["http://h", "http://i"]),
        "seed": st.sampled_from(["auto", "always", "never"]),
        "price": st.just({"input": 1.0, "output": 2.0}),
        "extra_body": st.dictionaries(st.sampled_from("abc"), st.booleans() | st.none()),
        "published": st.sampled_from(["GPT-4o", "é"]),
    },
)


@given(options=st.dictionaries(st.from_regex(r"m[a-z0-9.-]{0,8}", fullmatch=True), OPTIONS))
def test_a_dumped_file_loads_equal(tmp_path_factory, options):
    folder = tmp_path_factory.getbasetemp()
    models = load(folder, json.dumps(options))
    dump = {"mode": "json", "exclude_unset": True, "by_alias": True}
    dumped = {name: model.model_dump(**dump) for name, model in models.items()}
    assert load(folder, json.dumps(dumped)) == models


@settings(max_examples=40)
@given(data=MODELS_FILES)
def test_any_models_file_is_read_or_refused(data, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "law-models.yaml"
    path.write_bytes(data)
    with contextlib.suppress(SpecError):
        for model in load_models(path).values():
            assert json.dumps(model.identity(), allow_nan=False)


def test_names_and_groups_stand_for_models_in_the_order_of_the_file(tmp_path):
    grouped = "b: {id: x/b, groups: [big, all]}\na: {id: x/a, groups: [all]}\nc: x/c\n"
    known, resolve = load(tmp_path, grouped), config.resolve_models
    found = resolve(["oracle", "group:all", "a", "c", "group:big"], known, str)
    assert list(found) == ["oracle", "b", "a", "c"]
    assert (found["a"], found["oracle"].kind, found["oracle"].id) == (known["a"], "baseline", "")
    assert list(resolve(baseline_names(), {}, str)) == list(baseline_names())
    with pytest.raises(SpecError) as caught:
        resolve(["group:al", "c", "orcale", "human:x"], known, str)
    assert [(p.where, p.message, p.hint) for p in caught.value.problems] == [
        ("0", "is not a group of the models file", "did you mean group:all?"),
        ("2", "is neither in the models file nor a built-in baseline", "did you mean oracle?"),
        ("3", "is a person, who answers in `phyblock play`", "list them: phyblock models"),
    ]


SECRETS = [
    *("sk-proj-Abcdefghijkl1234567890", "sk-ant-api03-Abcdefghijkl1234567890"),
    *("AIzaSyAbcdefghijklmnopqrstuvwxyz0123456", "gsk_Abcdefghijklmnopqrstuvwx"),
    *("hf_Abcdefghijklmnopqrstuvwx", "xai-Abcdefghijklmnopqrstuvwx", "AKIAABCDEFGHIJKLMNOP"),
    "Bearer abcdefgh12345678",
]
PLACES = [
    "m: {id: a/b, api_key: SECRET}\n",
    "m: {id: a/b, api_key_env: SECRET}\n",
    "m: {id: a/b, extra_body: {x: [SECRET]}}\n",
    "m: {id: a/b, api_base: 'http://h/v1?k=SECRET'}\n",
    "m: a/SECRET\n",
    "m: {id: a/b, note: SECRET}\n",
]


@pytest.mark.parametrize("secret", SECRETS)
@pytest.mark.parametrize("place", PLACES)
def test_a_key_in_the_file_is_refused_and_not_repeated(tmp_path, place, secret):
    says = told(tmp_path, "models", place.replace("SECRET", secret))
    assert "looks like a key" in says
    assert "api_key_env" in says
    assert secret[8:] not in says


SECRET = "hunter2-5ecret"
GOOD = [
    *("http://localhost:8000/v1", "https://api.openai.com/v1", "HTTP://10.0.0.1"),
    *("http://[::1]:8000/v1", "http://[fe80::1%25eth0]/v1", "https://b\u00fccher.example/v1"),
    *("https://api.cloudflare.com/client/v4/accounts/1/ai/run/@cf/meta", "http://my_server/v1"),
]
SECRETIVE = [
    *(f"http://me:{SECRET}@host/v1", f"http://{SECRET}@host/v1", f"me:{SECRET}@host/v1"),
    *(f"https://host/v1?api_key={SECRET}", f"https://host/v1#{SECRET}"),
    *(f"https://host/v1;x?{SECRET}", f"http://me:{SECRET}/x@host/v1"),
    *(f"http://host\\@{SECRET}", f"http://[::1/v1?k={SECRET}"),
]
MALFORMED = [
    *("", "localhost:8000", "ftp://host/v1", "http://", "http:///v1", "http://[::1/v1"),
    *("http://::1/v1", "http://[1.2.3.4]/v1", "http://host:port/v1", "http://host:99999/v1"),
    *("http://host:0/v1", "http://a..b/v1", f"http://{'a' * 64}.example/v1", "http://ho st/v1"),
    *("http://host/v1\n", "http://host/\x00", "http://host/\ud800", f"http://host/{'a' * 2_000}"),
]


@pytest.mark.parametrize("url", [*SECRETIVE, *MALFORMED])
def test_what_is_none_is_refused_without_being_shown(url, monkeypatch, tmp_path):
    assert all(map(is_address, GOOD))
    assert not is_address(url)
    if url and "\x00" not in url and "\ud800" not in url:
        says = told(tmp_path, "models", f"m: {{id: openai/m, api_base: {json.dumps(url)}}}\n")
        assert "m.api_base" in says
        assert SECRET not in says
        monkeypatch.setenv("HOSTED_VLLM_API_BASE", url)
        with pytest.raises(SpecError, match="variable HOSTED_VLLM_API_BASE") as refused:
            server_address("hosted_vllm/m")
        assert SECRET not in str(refused.value)


@given(st.text(min_size=1), st.text(), st.sampled_from(["http", "https"]))
def test_no_user_gets_through(user, rest, scheme):
    url = f"{scheme}://{user.translate({ord(c): 'x' for c in '/?#'})}@host/{rest}"
    assert not is_address(url)


@given(st.text())
def test_any_text_is_an_address_or_refused(url):
    assert not is_address(url) or url.lower().startswith(("http://", "https://"))
    assert "/" not in host_of(url)


def test_a_host_is_shown_without_what_stands_around_it():
    assert host_of(f"https://me:{SECRET}@host:8443/v1?key={SECRET}#x") == "host:8443"
    assert host_of("http://[::1]:80/v1") == "[::1]:80"
    assert host_of("http://[::1/v1") == host_of("/v1") == "an unreadable address"
