"""Suites: each bad one is told in words at its place; laws of those that are sound."""

import contextlib
import copy
import json
import re
from math import prod

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.config.suite import FACTORS, REPEAT, Variant, VarySpec, load_suite, suite_model
from phyblock.config.yaml import dump_yaml
from phyblock.errors import SpecError
from phyblock.files import bundled
from phyblock.types import BACKGROUNDS
from tests.config.tables import table, told
from tests.fuzz.strategies import FIELDS, OVERRIDES, REQUIRED, SECTIONS, SOUND_SUITES, SUITES

SUITE_MODEL = suite_model()
HEAD = "name: s\nmodels: [oracle]\n"
BAD = [("suite", one) for one in table("bad_suites.yaml")]
BAD += [("models", one) for one in table("bad_models.yaml")]
JARGON = r"pydantic|Input should|valid (dictionary|tuple|string)|_type\b|extra_forbidden|Spec\b"


@pytest.mark.parametrize(("kind", "entry"), BAD, ids=range(len(BAD)))
def test_all_that_is_wrong_is_told_in_the_order_of_the_file(tmp_path, kind, entry):
    says = told(tmp_path, kind, entry[kind], entry.get("set", ()))
    assert says == entry["says"], "if this is meant: python -m tests.config.tables"
    assert not re.search(JARGON, says)


def test_many_problems_are_reported_in_part(tmp_path):
    says = told(tmp_path, "suite", HEAD + "".join(f"sede{i}: 1\n" for i in range(3_000)))
    assert says.count("is not a known key") == 100
    text = HEAD + "? " + "k" * 90_000 + "\n: 1\n"
    assert len(told(tmp_path, "suite", text, ["seeds=" + "x" * 90_000])) < 9_000
    assert not re.search("[\x1b\u202e]", told(tmp_path, "suite", HEAD + '"\\e[2J\\u202e": 1\n'))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("suites")
    (folder / "official").mkdir()
    (folder / "brief.j2").write_text("{% block user %}go{% endblock %}", encoding="utf-8")
    return folder


def load(folder, text, *overrides):
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    return load_suite(path, overrides)


@given(raw=SOUND_SUITES)
def test_a_dumped_suite_loads_equal(folder, raw):
    suite = SUITE_MODEL.model_validate(raw)
    dumped = suite.model_dump(mode="json")
    for text in (dump_yaml(dumped), json.dumps(dumped), json.dumps(raw)):
        assert load(folder, text).model_dump() == suite.model_dump()


@given(raw=SOUND_SUITES, data=st.data())
def test_identity_is_json_without_bounds_places_and_order(raw, data):
    def identity(**changes):
        return SUITE_MODEL.model_validate({**raw, **changes}).identity()

    json.dumps(identity(), allow_nan=False)
    listed = raw.keys() & {"seeds", "levels", "settings"}
    shuffled = {key: data.draw(st.permutations(raw[key])) for key in sorted(listed)}
    moved = {"dataset": {**raw.get("dataset", {}), "path": "/b"}, "limits": {"max_attempts": 3}}
    assert identity(**shuffled, **moved, name="another", description="x") == identity()
    assert identity(prompt="a.j2") == identity(prompt="b/c.j2") != identity()


INNER = {f"{name}.{key}": some for name, one in SECTIONS.items() for key, some in one.items()}
UNKNOWN = {"levls": st.just(1), "images.x": st.just(1)}
CHANGES = st.one_of(
    *(st.fixed_dictionaries({}, optional=o) for o in ({**FIELDS, **REQUIRED}, INNER, UNKNOWN))
)


def outcome(folder, raw, *overrides):
    """The suite, or the set of what is wrong with which field."""
    try:
        return load(folder, json.dumps(raw), *overrides).model_dump()
    except SpecError as error:
        return {(problem.field, problem.message) for problem in error.problems}


@given(raw=SOUND_SUITES, changes=CHANGES)
def test_overrides_equal_editing_the_file(folder, raw, changes):
    edited = copy.deepcopy(raw)
    for key, value in changes.items():
        section, _, name = key.rpartition(".")
        (edited.setdefault(section, {}) if section else edited)[name] = value
    texts = [f"{key}={json.dumps(value)}" for key, value in changes.items()]
    assert outcome(folder, raw, *texts) == outcome(folder, edited)


def test_paths_start_at_the_file_or_for_overrides_at_the_working_directory(folder, monkeypatch):
    monkeypatch.setenv("PHYBLOCK_TEST_ROOT", str(folder))
    monkeypatch.setenv("HOME", str(folder))
    monkeypatch.chdir(folder / "official")
    named = ("$PHYBLOCK_TEST_ROOT/official", "${PHYBLOCK_TEST_ROOT}/official", "~/official")
    for path in (*named, "../official"):
        suite = load(folder, HEAD, "dataset.format=official", f"dataset.path={path}")
        assert suite.files.dataset == folder / "official"
    text = "dataset: {format: official, path: ./official}\nprompt: brief.j2\n"
    suite = load(folder, HEAD + text)
    assert suite.files.dataset == folder / "official"
    assert suite.template("full_planning") == folder / "brief.j2"
    assert suite.where("dataset", "path") == f"{folder / 's.yaml'}:3:35"
    assert load(folder, HEAD).files.dataset == bundled("benchmarks", "data", "phyblock-400")
    assert load(folder, HEAD, "seeds=[1]", "seeds=[2]", "levels=[1]").seeds == (2,)


def levels(*values):
    some = st.lists(st.sampled_from(values), min_size=2, unique=True).map(tuple)
    return st.just(()) | some


VARIED = st.fixed_dictionaries(
    {
        "prompt": levels("default", "a/one.j2", "two.j2"),
        "background": levels(*BACKGROUNDS[:3]),
        "view": levels("oblique", "top", "front"),
        "candidate_order": levels("file", "shuffled"),
        "layout": levels("composite", "separate"),
        REPEAT: st.integers(1, 3),
    }
)


@given(section=VARIED)
def test_variants_are_all_choices_once_and_the_reference_is_the_first(section):
    vary = VarySpec.model_validate({name: found for name, found in section.items() if found})
    shown = [len(section[name]) or 1 for name in FACTORS if name != REPEAT]
    keys = [variant.key for variant in vary.variants]
    assert len(keys) == len(set(keys)) == len(vary.variants) == prod(shown) * section[REPEAT]
    assert keys[0] == ""
    assert all(one.repeat == n % section[REPEAT] + 1 for n, one in enumerate(vary.variants))
    assert {one.shown.key for one in vary.variants} <= set(keys)


def test_a_variant_is_the_suite_with_other_values_in_its_fields(folder):
    text = HEAD + (
        "vary:\n  background: [lawn, white]\n  candidate_order: [file, shuffled]\n"
        "  prompt: [brief.j2, default]\n  repeats: 2\n"
    )
    suite = load(folder, text)
    assert suite.template("full_planning") == folder / "brief.j2"
    for variant in suite.vary.variants:
        one, chosen = suite.at(variant), dict(variant.levels)
        assert one.images.background == chosen.get("background", "lawn")
        assert one.candidates.order == chosen.get("candidate_order", "file")
        assert bool(one.template("full_planning")) == ("prompt" not in chosen)
    plain = load(folder, HEAD)
    assert plain.at(Variant()) == plain


@settings(max_examples=40)
@given(data=SUITES, override=st.none() | OVERRIDES)
def test_any_suite_is_read_or_refused(folder, data, override):
    (folder / "law.yaml").write_bytes(data)
    with contextlib.suppress(SpecError):
        overrides = () if override is None else (override,)
        suite = load_suite(folder / "law.yaml", overrides)
        assert json.dumps(suite.identity(), allow_nan=False)
