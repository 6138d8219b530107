"""Pose planning: a whole plan with the place of every block, scored by geometry and by physics."""

from phyblock.resources import bundled
from phyblock.tables.track_report import TrackReport
from phyblock.tracks.kind import TrackKind
from phyblock.tracks.pose_planning.baselines import POSE_RULES, PoseSubject
from phyblock.tracks.pose_planning.by_hand import pick_poses
from phyblock.tracks.pose_planning.counts import COUNTED
from phyblock.tracks.pose_planning.opening import open_pose_planning
from phyblock.tracks.pose_planning.record import PoseRecord
from phyblock.tracks.pose_planning.spec import PoseSpec
from phyblock.tracks.pose_planning.track import PosePlanning

__all__ = ["TRACK"]


def _report() -> TrackReport:
    from phyblock.tracks.pose_planning.report import REPORT

    return REPORT


TRACK = TrackKind(
    name=PosePlanning.name,
    title="Pose planning",
    item="scene",
    about="a whole plan with the place of every block",
    open=open_pose_planning,
    report=_report,
    subject=PoseSubject,
    baselines=POSE_RULES,
    physics=lambda _: True,
    section=(
        "pose",
        PoseSpec,
        "How poses are asked for in the pose_planning track, and how plans are carried out.",
    ),
    record=PoseRecord,
    template=bundled("prompts", "pose_planning.j2"),
    json_template=bundled("prompts", "pose_planning_json.j2"),
    prompt_field=("pose", "prompt"),
    counted=COUNTED,
    tables=("table_c", "pose_errors"),
    rescored=True,
    no_examples="one would need the floor and the sheet of blocks of a scene of its own",
    by_hand=pick_poses,
    varies=("prompt", "background", "candidate_order", "repeats"),
)
