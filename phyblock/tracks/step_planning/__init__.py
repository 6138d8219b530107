"""Step planning: one operation at a time, with the assembly in view (paper section 4.1)."""

from collections.abc import Mapping
from typing import Any

from phyblock.resources import bundled
from phyblock.tables.design import read_section
from phyblock.tables.track_report import TrackReport
from phyblock.tracks.kind import TrackKind
from phyblock.tracks.poses import POSE_COUNTS
from phyblock.tracks.step_planning.baselines import STEP_RULES, StepSubject
from phyblock.tracks.step_planning.by_hand import pick_step
from phyblock.tracks.step_planning.opening import open_step_planning
from phyblock.tracks.step_planning.record import EpisodeRecord
from phyblock.tracks.step_planning.spec import StepsSpec
from phyblock.tracks.step_planning.track import StepPlanning

__all__ = ["TRACK"]


def _physics(suite: Mapping[str, Any]) -> bool:
    return read_section(suite, "steps", StepsSpec).physics != "off"


def _report() -> TrackReport:
    from phyblock.tracks.step_planning.report import REPORT

    return REPORT


TRACK = TrackKind(
    name=StepPlanning.name,
    title="Step planning",
    item="episode",
    about="step by step in the simulator",
    open=open_step_planning,
    report=_report,
    subject=StepSubject,
    baselines=STEP_RULES,
    by_hand=pick_step,
    physics=_physics,
    plays=True,
    section=("steps", StepsSpec, "The rules of the step_planning track."),
    record=EpisodeRecord,
    template=bundled("prompts", "step_planning.j2"),
    json_template=bundled("prompts", "step_planning_json.j2"),
    prompt_field=("steps", "prompt"),
    counted=(POSE_COUNTS,),
    tables=("table3", "endings", "progress"),
    no_examples="one would be an episode of several turns, each with a picture of its own",
    varies=("prompt", "background", "view", "candidate_order", "layout", "repeats"),
)
