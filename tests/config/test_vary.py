"""The section `vary`: how factors cross, what a variant changes, and what is refused."""

from __future__ import annotations

from math import prod
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.suite import FACTORS, REPEAT, Variant, VarySpec, load_suite
from phyblock.errors import SpecError
from phyblock.types import BACKGROUNDS

HEAD = "name: s\nmodels: [oracle]\n"
OFFICIAL = HEAD + "dataset: {format: official, path: .}\n"


def levels(*values: Any) -> st.SearchStrategy[tuple[Any, ...]]:
    some = st.permutations(values).flatmap(
        lambda order: st.integers(2, len(order)).map(lambda n: tuple(order[:n]))
    )
    return st.just(()) | some


sections = st.fixed_dictionaries(
    {
        "prompt": levels("default", "a/one.j2", "two.j2"),
        "background": levels(*BACKGROUNDS[:3]),
        "view": levels("oblique", "top", "front"),
        "candidate_order": levels("file", "shuffled"),
        "layout": levels("composite", "separate"),
        "examples": levels(0, 2, 5),
        REPEAT: st.integers(1, 3),
        "design": st.sampled_from(["crossed", "one_at_a_time"]),
    }
)


@given(section=sections)
def test_variants_are_all_choices_once_and_the_reference_is_the_first(
    section: dict[str, Any],
) -> None:
    vary = VarySpec.model_validate({name: found for name, found in section.items() if found})
    assert VarySpec.model_validate(vary.model_dump(mode="json")) == vary
    shown = [len(section[name]) or 1 for name in FACTORS if name != REPEAT]
    crossed = section["design"] == "crossed"
    ways = prod(shown) if crossed else 1 + sum(n - 1 for n in shown)
    keys = [variant.key for variant in vary.variants]
    assert len(keys) == len(set(keys)) == vary.n_variants == ways * section[REPEAT]
    assert keys[0] == ""
    assert all(one.repeat == n % section[REPEAT] + 1 for n, one in enumerate(vary.variants))
    assert {one.shown.key for one in vary.variants} <= set(keys)
    if not crossed:
        assert all(len(one.shown.levels) <= 1 for one in vary.variants)


def write(folder: Path, text: str) -> Path:
    (folder / "data" / "phyblock-400").mkdir(parents=True, exist_ok=True)
    (folder / "brief.j2").write_text("{% block user %}go{% endblock %}", encoding="utf-8")
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_variant_is_the_suite_with_other_values_in_its_fields(tmp_path: Path) -> None:
    text = HEAD + (
        "vary:\n  background: [lawn, white]\n  candidate_order: [file, shuffled]\n"
        "  prompt: [brief.j2, default]\n  repeats: 2\n"
    )
    loaded = load_suite(write(tmp_path, text), data_dir=tmp_path / "data")
    assert loaded.files.templates == {"full_planning": tmp_path / "brief.j2"}
    for variant in loaded.vary.variants:
        one = loaded.at(variant)
        told = dict(variant.levels)
        assert one.images.background == told.get("background", "lawn")
        assert one.candidates.order == told.get("candidate_order", "file")
        assert bool(one.files.templates) == ("prompt" not in told)
        assert (told.get("prompt", "brief")) in loaded.vary.names("prompt")


def test_a_suite_that_varies_nothing_is_written_as_before(tmp_path: Path) -> None:
    suite = load_suite(write(tmp_path, HEAD), data_dir=tmp_path / "data")
    dumped = suite.model_dump(mode="json")
    assert {"vary", "limit"}.isdisjoint(dumped)
    assert "view" not in dumped["images"]
    assert {"vary", "limit"}.isdisjoint(suite.identity())
    changed = load_suite(
        tmp_path / "s.yaml", ["images.view=top", "limit=3"], data_dir=tmp_path / "data"
    ).identity()
    # The limit itself decides nothing: what is asked about under it does.
    assert (changed["images"]["view"], "limit" in changed) == ("top", False)
    assert suite.at(Variant()) == suite


@pytest.mark.parametrize(
    ("text", "place", "field", "message"),
    [
        (HEAD + "vary: {background: [lawn]}\n", "3:20", "vary.background", "needs levels"),
        (HEAD + "vary: {background: [lawn, lawn]}\n", "3:27", "vary.background[1]", "twice"),
        (HEAD + "vary: {ground: [lawn]}\n", "3:8", "vary.ground", "not a known key"),
        (HEAD + "vary: {view: [top, under]}\n", "3:20", "vary.view[1]", "choices"),
        (HEAD + "vary: {prompt: [default, a/b.j2, c/b.j2]}\n", "3:16", "vary.prompt", "two temp"),
        (HEAD + "vary: {prompt: [default, gone.j2]}\n", "3:26", "vary.prompt[1]", "no such file"),
        (HEAD + "vary: {prompt: [default, official]}\n", "3:26", "vary.prompt[1]", "checkout"),
        (HEAD + "vary: {repeats: 0}\n", "3:17", "vary.repeats", "out of range"),
        (HEAD + "images: {background: white}\nvary: {background: [lawn, white]}\n",
         "3:22", "images.background", "varied by vary.background"),
        (HEAD + "tracks: [vqa]\nvary: {view: [top, front]}\n", "4:8", "vary.view", "in vqa"),
        (HEAD + "tracks: [full_planning, step_planning]\nvary: {prompt: [default, brief.j2]}\n",
         "4:8", "vary.prompt", "several tracks"),
        (OFFICIAL + "images: {source: dataset}\nvary: {view: [top, front]}\n",
         "5:8", "vary.view", "own pictures"),
        (OFFICIAL + "images: {source: dataset}\nvary: {candidate_order: [file, shuffled]}\n",
         "5:32", "vary.candidate_order[1]", "order of the file"),
        (HEAD + "vary: {background: [white, lawn, concrete], view: [top, front, side, oblique], "
         "repeats: 100}\n", "3:7", "vary", "crosses to 1,200"),
    ],
)  # fmt: skip
def test_what_cannot_be_varied_is_an_error_at_its_place(
    tmp_path: Path, text: str, place: str, field: str, message: str
) -> None:
    with pytest.raises(SpecError) as caught:
        load_suite(write(tmp_path, text), data_dir=tmp_path / "data")
    (problem,) = caught.value.problems
    assert problem.where.endswith(f"s.yaml:{place}")
    assert problem.field == field
    assert message in problem.message
