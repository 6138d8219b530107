"""VQA: a question with its pictures in, a letter or an order out (paper section 3.3)."""

from collections.abc import Mapping
from typing import Any

from phyblock.config.suite import Suite
from phyblock.data import read_version
from phyblock.records import Manifest
from phyblock.resources import bundled
from phyblock.tables.track_report import TrackReport
from phyblock.tracks.kind import TrackKind
from phyblock.tracks.vqa.baselines import CHOICE_RULES, ChoiceSubject
from phyblock.tracks.vqa.by_hand import pick_answer
from phyblock.tracks.vqa.opening import open_vqa
from phyblock.tracks.vqa.record import ChoiceRecord
from phyblock.tracks.vqa.spec import VqaSpec
from phyblock.tracks.vqa.track import Vqa

__all__ = ["TRACK"]


def _questions(suite: Suite) -> tuple[str, tuple[str, ...], bool]:
    spec = suite.section(VqaSpec)
    return spec.path, ("vqa", "path"), spec.format == "builtin"


def _manifest(suite: Suite) -> Mapping[str, Any]:
    spec = suite.section(VqaSpec)
    root = suite.files.folders[Vqa.name]
    questions = {"format": spec.format, "root": str(root), "version": read_version(root)}
    return {"questions": questions}


def _found_at(manifest: Manifest) -> str | None:
    return None if manifest.questions is None else manifest.questions.root


def _report() -> TrackReport:
    from phyblock.tracks.vqa.report import REPORT

    return REPORT


TRACK = TrackKind(
    name=Vqa.name,
    title="VQA",
    item="question",
    about="multiple-choice questions",
    open=open_vqa,
    report=_report,
    subject=ChoiceSubject,
    baselines=CHOICE_RULES,
    by_hand=pick_answer,
    section=("vqa", VqaSpec, "The questions of the vqa track, and how they are shown."),
    record=ChoiceRecord,
    template=bundled("prompts", "vqa.j2"),
    json_template=bundled("prompts", "vqa_json.j2"),
    prompt_field=("vqa", "prompt"),
    tables=("table2",),
    own_data=_questions,
    manifest=_manifest,
    own_root=_found_at,
    no_examples="",
    varies=("prompt", "background", "examples", "repeats"),
)
