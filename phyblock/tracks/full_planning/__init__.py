"""Full planning: one picture and prompt in, one whole plan out (paper section 4.1)."""

from phyblock.resources import bundled
from phyblock.tables.track_report import TrackReport
from phyblock.tracks.full_planning.baselines import PLAN_RULES, PlanSubject
from phyblock.tracks.full_planning.by_hand import pick_plan
from phyblock.tracks.full_planning.opening import open_full_planning
from phyblock.tracks.full_planning.record import PlanRecord
from phyblock.tracks.full_planning.spec import PlanningSpec
from phyblock.tracks.full_planning.track import FullPlanning
from phyblock.tracks.kind import TrackKind
from phyblock.tracks.poses import POSE_COUNTS

__all__ = ["TRACK"]


def _report() -> TrackReport:
    from phyblock.tracks.full_planning.report import REPORT

    return REPORT


TRACK = TrackKind(
    name=FullPlanning.name,
    title="Full planning",
    item="scene",
    about="a whole plan in one reply",
    open=open_full_planning,
    report=_report,
    subject=PlanSubject,
    baselines=PLAN_RULES,
    by_hand=pick_plan,
    section=("full_planning", PlanningSpec, "How scenes are shown in the full_planning track."),
    record=PlanRecord,
    template=bundled("prompts", "full_planning.j2"),
    json_template=bundled("prompts", "full_planning_json.j2"),
    counted=(POSE_COUNTS,),
    tables=("assembly", "table1", "errors"),
    rescored=True,
    no_examples="",
    varies=("prompt", "background", "view", "candidate_order", "layout", "examples", "repeats"),
)
