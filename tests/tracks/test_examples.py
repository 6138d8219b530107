"""Worked examples: never what is asked about or its kin, answered rightly, and known to the run."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.config.suite import Variant, load_suite
from phyblock.data import AssemblyTask
from phyblock.domain.symmetry import Symmetry, canonical_form
from phyblock.errors import SpecError
from phyblock.making.poses import transformed
from phyblock.models.request import Image
from phyblock.resources import bundled
from phyblock.run.manifest import make_manifest
from phyblock.run.plan import open_dataset
from phyblock.tracks import Opening, open_tracks, questions
from phyblock.tracks.full_planning import worked_plan
from phyblock.tracks.items import Examples
from phyblock.tracks.questions import VqaSpec
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

DATA = open_dataset("builtin", bundled("benchmarks", "data", "phyblock-400"))
DATA_PARENTS = {task.key: {task.scene.id, *task.scene.parents} for task in DATA.tasks}
names = st.lists(st.sampled_from([task.key for task in DATA.tasks]), max_size=3, unique=True)


@functools.cache
def suite_file(folder: Path) -> Path:
    path = folder / "suite.yaml"
    path.write_text("name: s\nmodels: [oracle]\nimages: {size_px: 128}\n", encoding="utf-8")
    return path


@pytest.fixture(autouse=True, scope="module")
def _questions_are_read_once() -> Iterator[None]:
    read, known = questions.open_questions, {}

    def once(*args: Any) -> Any:
        if not known:
            known[""] = read(*args)
        return known[""]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(questions, "open_questions", once)
        yield


def opened(folder: Path, *sets: str, limit: int | None = None) -> Any:
    data = bundled("benchmarks", "data")
    loaded = load_suite(suite_file(folder), sets, data_dir=data)
    (track,) = open_tracks(Opening(loaded, DATA, limit, True), loaded.tracks)
    return track, loaded


def bases(task: Any) -> set[str]:
    return {task.scene.id, *task.scene.parents}


@given(first=names, n=st.integers(0, 6), seed=st.integers(0, 9))
@settings(max_examples=8, deadline=None)
def test_no_example_is_kin_of_what_is_asked_about(first: list[str], n: int, seed: int) -> None:
    examples: Examples[AssemblyTask] = Examples(DATA.tasks, n, first, seed)
    for task in DATA.tasks[seed::20]:
        shown = examples.of(task)
        assert len({one.scene.id for one in shown}) == len(shown) == n
        assert all(bases(task).isdisjoint(bases(one)) for one in shown)
        forms = {canonical_form(one.scene.blocks) for one in shown}
        assert canonical_form(task.scene.blocks) not in forms
        may = [name for name in first if name in {one.key for one in shown}]
        assert [one.key for one in shown][: len(may)] == may


@given(turns=st.integers(0, 3), mirrored=st.booleans(), place=st.integers(0, 399))
@settings(max_examples=20, deadline=None)
def test_a_goal_turned_or_mirrored_is_no_example(turns: int, mirrored: bool, place: int) -> None:
    task = DATA.tasks[place]
    blocks = transformed(task.scene.blocks, Symmetry(turns, mirrored))
    twin = replace(task, scene=replace(task.scene, id="twin", parents=("twin",), blocks=blocks))
    assert canonical_form(blocks) == canonical_form(task.scene.blocks)
    others = Examples([twin, DATA.tasks[place - 1]], 1, ["twin"])
    assert [one.key for one in others.of(task)] != ["twin"]


@pytest.mark.parametrize("form", ["text", "json_schema"])
def test_the_answers_of_examples_are_right_and_follow_no_order_of_the_file(
    tmp_path: Path, form: str
) -> None:
    track, _ = opened(tmp_path, f"answer_format={form}", limit=1)
    first, expected = 0, []
    for task in DATA.tasks[::4]:
        judged = track.judge(task, worked_plan(task, track.rules.form(task)))
        counts = next(score.counts for score in judged.scores if score.criterion == "aov")
        assert (counts.tp, counts.fp, counts.fn) == (len(task.scene), 0, 0)
        assert (judged.parsed.rule == "json") == (form == "json_schema")
        ready = [task.scene.blocks[vertex].look for vertex in task.scene.graph.ready()]
        if len(set(ready)) == len(ready) > 1:
            first += judged.steps[0] == task.candidates.index_of(ready[0])
            expected.append(1 / len(ready))
    assert abs(first - sum(expected)) < 4 * math.sqrt(sum(p * (1 - p) for p in expected))


@pytest.mark.parametrize(
    ("track", "form", "more"),
    [
        ("full_planning", "text", ()),
        ("full_planning", "json_schema", ("candidates.order=shuffled", "full_planning.blind=true")),
        ("vqa", "text", ("vqa.options_as=letters",)),
        ("vqa", "json_schema", ("vqa.blind=true", "vqa.circular=true")),
    ],
)
def test_examples_are_turns_before_the_question(
    tmp_path: Path, form: str, track: str, more: tuple[str, ...]
) -> None:
    sets = (f"tracks=[{track}]", f"answer_format={form}", *more)
    plain, _ = opened(tmp_path, *sets, limit=16)
    shown, loaded = opened(tmp_path, *sets, "examples=2", limit=16)
    for item in plain.items:
        ((bare, _),) = plain.outlines(item)
        ((asked, _),) = shown.outlines(item)
        assert [m.role for m in asked.messages] == [
            *("system", "user", "assistant", "user", "assistant", "user")
        ]
        assert (asked.messages[0], asked.messages[-1]) == bare.messages
        assert (len(asked.examples), bare.examples) == (2, ())
        for key, question, answer in zip(
            asked.examples, asked.messages[1::2], asked.messages[2::2], strict=False
        ):
            n = len(bare.messages[-1].parts)
            if track == "full_planning" or loaded.section(VqaSpec).blind:
                assert len(question.parts) == n
            pictures = [part for part in question.parts if isinstance(part, Image)]
            assert all(part.label.startswith(f"example {key}: ") for part in pictures)
            assert track == "vqa" or pictures
            about = item if track == "full_planning" else item.question
            rule = shown.rules.read(about, answer.parts[0]).rule
            assert (rule == "json") if form == "json_schema" else rule


def test_questions_have_examples_of_their_subtask_with_the_right_option(tmp_path: Path) -> None:
    """They are about two scenes: those named, wherever both have a question of the subtask."""
    asked_of, _ = opened(tmp_path, "tracks=[vqa]")
    known = {task.key: task for task in asked_of._questions.tasks}
    in_scene: dict[str, set[str]] = {}
    for task in known.values():
        in_scene.setdefault(task.scene.id, set()).add(task.question.subtask)
    two = sorted(in_scene, key=lambda scene: (-len(in_scene[scene]), scene))[:2]
    track, _ = opened(tmp_path, "tracks=[vqa]", f"examples=[{', '.join(two)}]", limit=32)
    subtasks = set()
    both = 0
    for item in track.items:
        ((asked, _),) = track.outlines(item)
        scenes = {known[key].scene.id for key in asked.examples}
        assert len(scenes) == len(asked.examples) == 2
        may = {one for one in two if item.question.subtask in in_scene[one]}
        if all(bases(item).isdisjoint(DATA_PARENTS[one]) for one in two):
            assert may <= scenes
            both += len(may) == 2
        for key, answer in zip(asked.examples, asked.messages[2::2], strict=True):
            example = known[key]
            assert example.question.subtask == item.question.subtask
            assert bases(example).isdisjoint(bases(item))
            read = track.rules.read(example.question, answer.parts[0])
            assert read.letters == example.question.answer_letters
        subtasks.add(item.question.subtask)
    assert len(subtasks) == 16
    assert both


@pytest.mark.parametrize("track", ["full_planning", "vqa"])
def test_no_example_is_kin_of_what_is_shown_instead(tmp_path: Path, track: str) -> None:
    sets = (f"tracks=[{track}]", f"{track}.wrong_image=true", "seeds=[0, 1]", "examples=6")
    shown, _ = opened(tmp_path, *sets)
    for item in shown.items[::3]:
        for seed in (0, 1):
            if track == "vqa":
                asked = item
                instead = shown._elsewhere.of(item.task, seed)
            else:
                asked = shown.shown(item, seed)
                instead = asked.goal
            assert all(bases(instead).isdisjoint(bases(one)) for one in shown._examples.of(asked))


def manifest_of(folder: Path, *sets: str) -> Any:
    track, loaded = opened(folder, *sets, limit=4)
    return make_manifest(loaded, (), DATA, {Variant(): (track,)}, 4)


def test_examples_are_a_part_of_what_a_run_is_only_where_there_are_some(tmp_path: Path) -> None:
    plain, none = manifest_of(tmp_path), manifest_of(tmp_path, "examples=0")
    assert plain.identity == none.identity
    assert "examples" not in plain.tracks["full_planning"]
    two, three = manifest_of(tmp_path, "examples=2"), manifest_of(tmp_path, "examples=3")
    named = manifest_of(tmp_path, f"examples=[{DATA.tasks[7].key}, {DATA.tasks[9].key}]")
    assert len({one.identity for one in (plain, two, three, named)}) == 4
    assert len(two.tracks["full_planning"]["examples"]) >= 2


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (("examples=17",), "examples"),
        (("examples=[nowhere]",), "examples[0]: is no scene that an example can be about"),
        (("examples=[l1-001-animals]",), "did you mean l1-001-animal?"),
        (("examples=1", "tracks=[step_planning]"), "episode of several turns"),
        (("examples=1", "tracks=[pose_planning]"), "the floor and the sheet of blocks"),
        (("vary.examples=[0, 2]", "tracks=[step_planning]"), "has no meaning in step_planning"),
    ],
)
def test_what_cannot_be_shown_is_refused(tmp_path: Path, sets: tuple[str, ...], said: str) -> None:
    with pytest.raises(SpecError) as caught:
        opened(tmp_path, *sets, limit=2)
    assert said in str(caught.value)


def test_too_few_others_are_refused(workspace: Workspace) -> None:
    workspace.write_suite(models=["alpha"], examples=5)
    workspace.write_models("http://127.0.0.1:9", "alpha")
    done = workspace.phyblock("validate", "suite.yaml")
    assert done.code == 2
    assert "fewer others" in done.err
    assert "suite.yaml:" in done.err


def test_a_run_shows_examples_varies_them_and_says_which(workspace: Workspace) -> None:
    workspace.write_suite(models=["alpha"], seeds=[0], limit=3, vary={"examples": [0, 2]})
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha")
        estimated = workspace.run("--dry-run")
        done = workspace.run()
        seen = sorted(len(one.parts) for one in running.server.seen)
        again = workspace.run()
        assert len(running.server.seen) == 6
    assert (estimated.code, done.code, again.code) == (0, 0, 0), done.err
    told = " ".join(estimated.out.split())
    assert "0 or 2 worked examples before each question" in told
    assert seen[:3] == [seen[0]] * 3
    assert seen[3] > 2 * seen[0]
    records = workspace.records()
    by_way = {bool(one.get("variant")): one["prompt"] for one in records}
    assert "examples" not in by_way[False]
    assert len(by_way[True]["examples"]) == 2
    labels = [image["label"] for image in by_way[True]["images"]]
    assert labels[-1] == "composite"
    assert labels[0] == f"example {by_way[True]['examples'][0]}: composite"
