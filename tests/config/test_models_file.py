"""models.yaml: what it may say, how its errors read, how suites find models in it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig, SamplingSpec, load_models
from phyblock.config.suite import Suite, load_suite, resolve_models
from phyblock.errors import Problem, SpecError
from phyblock.registry import baseline_names


def load(folder: Path, text: str) -> dict[str, ModelConfig]:
    path = folder / "m.yaml"
    path.write_text(text, encoding="utf-8")
    return load_models(path)


def problems_of(folder: Path, text: str) -> list[Problem]:
    with pytest.raises(SpecError) as caught:
        load(folder, text)
    return list(caught.value.problems)


def test_one_line_is_enough(tmp_path: Path) -> None:
    models = load(tmp_path, "gpt-4o: openai/gpt-4o-2024-08-06\n")
    assert models == {"gpt-4o": ModelConfig(name="gpt-4o", id="openai/gpt-4o-2024-08-06")}


def test_a_mapping_says_more(tmp_path: Path) -> None:
    text = """
my-server:
  id: hosted_vllm/Qwen/Qwen2.5-VL-7B-Instruct
  api_base: http://localhost:8000/v1
  api_key_env: MY_KEY
  transport: direct
  max_concurrency: 8
  rpm: 600
  tpm: 100000
  temperature: 1e-1
  top_p: 1
  max_tokens: 512
  reasoning_effort: low
  extra_body: {top_k: 1, chat_template_kwargs: {enable_thinking: false}}
  price: {input: 0, output: 1.5}
  seed: always
  timeout_s: 60
  published: Qwen2.5-VL-7B-Instruct
  size_b: 7
"""
    spec = load(tmp_path, text)["my-server"]
    assert spec.temperature == 0.1
    assert spec.price is not None
    assert (spec.price.input, spec.price.output) == (0.0, 1.5)
    assert spec.extra_body == {"top_k": 1, "chat_template_kwargs": {"enable_thinking": False}}
    assert spec.seed == "always"


def test_names_that_yaml_1_1_would_turn_into_something_else(tmp_path: Path) -> None:
    assert list(load(tmp_path, "on: a/b\n1: a/b\n1e-3: a/b\n")) == ["on", "1", "1e-3"]


def test_an_empty_file_holds_no_models(tmp_path: Path) -> None:
    assert load(tmp_path, "# none yet\n") == {}


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    spec = load(tmp_path, "old: {replay: replies/old, published: GPT-4o}\n")["old"]
    assert spec.replay == str(tmp_path / "replies" / "old")
    assert spec.kind == "replay"


def test_several_addresses_are_a_list(tmp_path: Path) -> None:
    spec = load(tmp_path, "m: {id: a/b, api_base: [http://h:1/v1, http://h:2/v1]}\n")["m"]
    assert spec.addresses == ("http://h:1/v1", "http://h:2/v1")


# text, line:col, field, part of the message, part of allowed, part of the hint
BAD = [
    ("m: gpt-4o\n", "1:4", "m.id", "not a litellm id", "provider/model", "openai/gpt-4o?"),
    ("m: claude-x\n", "1:4", "m.id", "not a litellm id", "", "anthropic/claude-x?"),
    ("m: {id: my-model}\n", "1:9", "m.id", "not a litellm id", "", "for example openai/"),
    ("m: openai/\n", "1:4", "m.id", "not a litellm id", "", ""),
    ("m: 5\n", "1:4", "m", "wrong type", "a litellm id", ""),
    ("m:\n", "1:3", "m", "wrong type", "mapping", ""),
    ("m: [a/b]\n", "1:4", "m", "wrong type", "mapping", ""),
    ("- a/b\n", "1:1", "", "wrong type", "name: provider/model", ""),
    ("m: {}\n", "1:4", "m", "needs an id", "", "openai/"),
    ("m:\n  modle: a/b\n  id: a/b\n", "2:3", "m.modle", "not a known key", "id, api_base", ""),
    ("m:\n  id: a/b\n  temprature: 0\n", "3:3", "m.temprature", "known key", "", "temperature?"),
    ("m: {id: a/b, rpm: 0}\n", "1:19", "m.rpm", "out of range", "at least 1", ""),
    ("m: {id: a/b, rpm: '5'}\n", "1:19", "m.rpm", "wrong type", "a whole number", "quotes off"),
    ("m: {id: a/b, seed: maybe}\n", "1:20", "m.seed", "choices", "auto, always, never", ""),
    ("m: {id: a/b, transport: drect}\n", "1:25", "m.transport", "choices", "", "mean direct?"),
    ("m: {id: a/b, reasoning_effort: hgh}\n", "1:32", "m.reasoning_effort", "", "low", "high?"),
    ("m: {id: a/b, api_base: localhost}\n", "1:24", "m.api_base", "address", "http://", "8000"),
    ("m: {id: a/b, api_base: []}\n", "1:24", "m.api_base", "is empty", "at least one", ""),
    ("m: {id: a/b, api_base: 5}\n", "1:24", "m.api_base", "wrong type", "text", ""),
    ("m: {id: a/b, api_base: [http://h, 5]}\n", "1:35", "m.api_base[1]", "wrong type", "text", ""),
    ("m: {id: a/b, api_base: [http://h, h]}\n", "1:35", "m.api_base[1]", "address", "http://", ""),
    ("m: {id: a/b, api_base: [http://h, http://h]}\n", "1:35", "m.api_base[1]", "twice", "", "one"),
    ("m: {id: a/b, max_concurrency: auto}\n", "1:31", "m.max_concurrency", "wrong type", "", ""),
    ("m: {id: a/b, max_concurrency: 0}\n", "1:31", "m.max_concurrency", "range", "at least 1", ""),
    ("m: {replay: $PHYBLOCK_NO/x}\n", "1:13", "m.replay", "not set", "", ""),
    ("m: {replay: x, api_base: [http://h]}\n", "1:16", "m.api_base", "no meaning", "", ""),
    ("m: {id: xai/g, transport: direct}\n", "1:27", "m.transport", "address", "api_base", "add"),
    ("m: {id: a/b, price: 5}\n", "1:21", "m.price", "wrong type", "a mapping", ""),
    ("m: {id: a/b, price: {input: 1}}\n", "1:14", "m.price.output", "is missing", "", "add"),
    ("m: {id: a/b, price: {input: 1, output: -1}}\n", "1:40", "m.price.output", "range", "0", ""),
    ("m: {id: a/b, input: 1}\n", "1:14", "m.input", "known key", "", "belongs at price.input"),
    ("m: {id: a/b, extra_body: {x: [1, .nan]}}\n", "1:34", "m.extra_body.x[1]", "JSON", "", ""),
    ("m: {id: a/b, extra_body: {x: 0x1ffffffffffffffff}}\n", "1:30", "m.extra_body.x", "", "", ""),
    ("m: {id: a/b, replay: x}\n", "1:5", "m.id", "no meaning for a replay", "published", "either"),
    ("m: {replay: x, rpm: 5}\n", "1:16", "m.rpm", "no meaning for a replay", "", ""),
    ("m: {replay: $PHYBLOCK_UNSET/x}\n", "1:13", "m.replay", "PHYBLOCK_UNSET is not set", "", ""),
    ("random: a/b\n", "1:1", "random", "phyblock's own", "not random", "another name"),
    ("recorded: a/b\n", "1:1", "recorded", "phyblock's own", "", ""),
    ("my model: a/b\n", "1:1", "my model", "usable name", "letters", ""),
    ("a/b: a/b\n", "1:1", "a/b", "usable name", "", ""),
    ("m: a/b\nm: a/c\n", "2:1", "m", "written twice", "", "m.yaml:1:1"),
    ("m: {id: a/b, api_key: abc}\n", "1:23", "m.api_key", "looks like a key", "", "api_key_env"),
    ("m: {id: a/b, api_key_env: my-key}\n", "1:27", "m.api_key_env", "characters", "variable", ""),
]  # fmt: skip


@pytest.mark.parametrize(("text", "place", "field", "message", "allowed", "hint"), BAD)
def test_a_bad_model_gives_one_error_at_its_place(
    tmp_path: Path, text: str, place: str, field: str, message: str, allowed: str, hint: str
) -> None:
    (problem, *more) = problems_of(tmp_path, text)
    assert more == []
    assert problem.where == f"{tmp_path / 'm.yaml'}:{place}"
    assert problem.field == field
    assert message in problem.message
    assert allowed in problem.allowed
    assert hint in problem.hint


def test_all_errors_come_at_once(tmp_path: Path) -> None:
    text = "a: gpt\nb: {id: x/y, rmp: 1, tpm: 0}\nrandom: x/y\nc: x/y\nc: x/z\n"
    places = [p.where.rpartition("m.yaml:")[2] for p in problems_of(tmp_path, text)]
    assert places == ["1:4", "2:14", "2:27", "3:1", "5:1"]


SECRETS = [
    "sk-proj-Abcdefghijkl1234567890",
    "sk-ant-api03-Abcdefghijkl1234567890",
    "AIzaSyAbcdefghijklmnopqrstuvwxyz0123456",
    "gsk_Abcdefghijklmnopqrstuvwx",
    "hf_Abcdefghijklmnopqrstuvwx",
    "xai-Abcdefghijklmnopqrstuvwx",
    "AKIAABCDEFGHIJKLMNOP",
    "Bearer abcdefgh12345678",
]
PLACES = [
    "m: {{id: a/b, api_key: {0}}}\n",
    "m: {{id: a/b, api_key_env: {0}}}\n",
    "m: {{id: a/b, extra_body: {{x: [{0}]}}}}\n",
    "m: {{id: a/b, api_base: 'http://h/v1?k={0}'}}\n",
    "m: a/{0}\n",
    "m: {{id: a/b, note: {0}}}\n",
]


@pytest.mark.parametrize("secret", SECRETS)
@pytest.mark.parametrize("place", PLACES)
def test_a_key_in_the_file_is_refused_and_not_repeated(
    tmp_path: Path, place: str, secret: str
) -> None:
    found = problems_of(tmp_path, place.format(json.dumps(secret) if "'" not in place else secret))
    shown = "\n".join(map(str, found))
    assert "looks like a key" in shown
    assert "api_key_env" in shown
    assert secret[8:] not in shown


def test_a_password_in_an_address_or_a_body_is_refused(tmp_path: Path) -> None:
    for text in (
        "m: {id: a/b, api_base: 'https://me:hunter2@host/v1'}\n",
        "m: {id: a/b, extra_body: {api_key: hunter2}}\n",
        "m: {id: a/b, extra_body: {headers: {Authorization: hunter2}}}\n",
    ):
        (problem,) = problems_of(tmp_path, text)
        assert "looks like a key" in problem.message
        assert "hunter2" not in str(problem)


@pytest.mark.parametrize(
    "model_id", ["openai/task-abc-def", "azure_ai/org/risk-assessor-large", "a/disk-12345678"]
)
def test_ordinary_names_are_not_taken_for_keys(tmp_path: Path, model_id: str) -> None:
    assert load(tmp_path, f"m: {model_id}\n")["m"].id == model_id


def test_a_parameter_left_out_is_the_suites_and_null_is_not_sent() -> None:
    defaults = SamplingSpec(temperature=0.5, top_p=0.9, max_tokens=100)
    assert ModelConfig(id="a/b").with_defaults(defaults.model_dump()).params == {
        "temperature": 0.5,
        "top_p": 0.9,
        "max_tokens": 100,
    }
    own = ModelConfig(id="a/b", temperature=None, max_tokens=7, reasoning_effort="high")
    assert own.with_defaults(defaults.model_dump()).params == {
        "top_p": 0.9,
        "max_tokens": 7,
        "reasoning_effort": "high",
    }


def test_null_in_the_file_is_told_from_nothing(tmp_path: Path) -> None:
    models = load(tmp_path, "a: {id: x/y, temperature: null}\nb: {id: x/y}\n")
    defaults = SamplingSpec()
    assert "temperature" not in models["a"].with_defaults(defaults.model_dump()).params
    assert models["b"].with_defaults(defaults.model_dump()).params["temperature"] == 0.0


OPTIONS = st.fixed_dictionaries(
    {"id": st.just("openai/m")},
    optional={
        "temperature": st.none() | st.floats(0, 2),
        "max_tokens": st.none() | st.integers(1, 10**6),
        "rpm": st.none() | st.integers(1, 10**6),
        "seed": st.sampled_from(["auto", "always", "never"]),
        "price": st.none() | st.just({"input": 1.0, "output": 2.0}),
        "extra_body": st.dictionaries(st.sampled_from("abc"), st.booleans() | st.none()),
        "published": st.sampled_from(["GPT-4o", "é"]),
        "size_b": st.none() | st.floats(1e-3, 1e4),
    },
)


@given(options=st.dictionaries(st.from_regex(r"m[a-z0-9.-]{0,8}", fullmatch=True), OPTIONS))
def test_a_dumped_file_loads_equal(
    tmp_path_factory: pytest.TempPathFactory, options: dict[str, dict[str, object]]
) -> None:
    specs = {name: ModelConfig.model_validate(entry) for name, entry in options.items()}
    dumped = {
        n: s.model_dump(mode="json", exclude_unset=True, by_alias=True) for n, s in specs.items()
    }
    folder = tmp_path_factory.getbasetemp()
    loaded = load(folder, json.dumps(dumped))
    for name, spec in loaded.items():
        assert spec == specs[name].with_defaults({"name": name})
    defaults = SamplingSpec()
    assert [s.with_defaults(defaults.model_dump()).params for s in loaded.values()] == [
        s.with_defaults(defaults.model_dump()).params for s in specs.values()
    ]


def load_naming(folder: Path, models: str, *overrides: str) -> Suite:
    (folder / "data" / "phyblock-400").mkdir(parents=True)
    path = folder / "s.yaml"
    path.write_text(f"name: s\nmodels:\n{models}", encoding="utf-8")
    return load_suite(path, overrides, data_dir=folder / "data")


def test_names_resolve_in_the_suites_order(tmp_path: Path) -> None:
    known = {"b": ModelConfig(id="x/b"), "a": ModelConfig(id="x/a"), "c": ModelConfig(id="x/c")}
    loaded = load_naming(tmp_path, "  - oracle\n  - a\n  - b\n")
    assert list(resolve_models(loaded, known).items()) == [
        ("oracle", None),
        ("a", known["a"]),
        ("b", known["b"]),
    ]


def test_every_baseline_resolves_without_a_models_file(tmp_path: Path) -> None:
    loaded = load_naming(tmp_path, "".join(f"  - {name}\n" for name in baseline_names()))
    assert resolve_models(loaded, {}) == dict.fromkeys(baseline_names())


def test_every_unknown_name_is_pointed_at(tmp_path: Path) -> None:
    loaded = load_naming(tmp_path, "  - orcale\n  - oracle\n  - gpt4o\n")
    with pytest.raises(SpecError) as caught:
        resolve_models(loaded, {"gpt-4o": ModelConfig(id="openai/gpt-4o")})
    path = tmp_path / "s.yaml"
    assert [(p.where, p.hint) for p in caught.value.problems] == [
        (f"{path}:3:5", "did you mean oracle?"),
        (f"{path}:5:5", "did you mean gpt-4o?"),
    ]


def test_an_unknown_name_on_the_command_line(tmp_path: Path) -> None:
    loaded = load_naming(tmp_path, "  - oracle\n", "models=[oracel]")
    with pytest.raises(SpecError) as caught:
        resolve_models(loaded, {})
    assert caught.value.problems[0].where == "--set models=[oracel]"


def test_recorded_models_are_not_resolved_here(tmp_path: Path) -> None:
    (tmp_path / "official").mkdir()
    text = f"dataset={{format: official, path: {tmp_path / 'official'}}}"
    loaded = load_naming(tmp_path, "  - oracle\n", "models=recorded", text)
    with pytest.raises(ValueError, match="listed by its data set"):
        resolve_models(loaded, {})


@pytest.mark.parametrize(
    ("model_id", "detail", "allowed"),
    [
        ("openai/gpt-5.6", "ultra_high", "auto, low, high, original"),
        ("gemini/gemini-3.8-flash", "auto", "low, medium, high, ultra_high"),
        ("anthropic/claude-opus-5-5", "low", "none: anthropic has no such choice"),
        ("xai/grok-4.7", "close", "auto"),
    ],
)
def test_a_detail_that_a_provider_does_not_know_is_refused(
    tmp_path: Path, model_id: str, detail: str, allowed: str
) -> None:
    with pytest.raises(SpecError) as caught:
        load(tmp_path, f"m: {{id: {model_id}, image_detail: {detail}}}\n")
    (problem,) = caught.value.problems
    assert problem.field == "m.image_detail"
    assert allowed in problem.allowed


GROUPED = """\
b: {id: x/b, groups: [big, all]}
a: {id: x/a, groups: [all]}
c: x/c
"""


def test_a_group_stands_for_its_models_in_the_order_of_the_file(tmp_path: Path) -> None:
    known = load(tmp_path, GROUPED)
    loaded = load_naming(tmp_path, "  - oracle\n  - group:all\n  - a\n  - c\n  - group:big\n")
    assert list(resolve_models(loaded, known)) == ["oracle", "b", "a", "c"]


def test_an_unknown_group_is_pointed_at(tmp_path: Path) -> None:
    known = load(tmp_path, GROUPED)
    loaded = load_naming(tmp_path, "  - group:al\n  - c\n")
    with pytest.raises(SpecError) as caught:
        resolve_models(loaded, known)
    (problem,) = caught.value.problems
    assert problem.where == f"{tmp_path / 's.yaml'}:3:5"
    assert problem.message == "is no group of the models file"
    assert problem.hint == "did you mean group:all?"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("group:a: x/a\n", "begins with group:, which names groups"),
        ("a: {id: x/a, groups: [Big]}\n", "has characters that are not allowed"),
        ("a: {id: x/a, groups: [b, b]}\n", "stands twice"),
    ],
)
def test_what_cannot_be_a_group_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (problem,) = problems_of(tmp_path, text)
    assert said in problem.message
