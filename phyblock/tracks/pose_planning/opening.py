"""Open the pose-planning track of a suite."""

from __future__ import annotations

from phyblock.config.suite import Suite
from phyblock.errors import Problem, SpecError
from phyblock.sim.dynamics import ExecutionLimits
from phyblock.tracks.kind import Opening
from phyblock.tracks.opening import (
    check_drawn,
    picture_folder,
    picture_style,
    task_showing,
    template_prompt,
)
from phyblock.tracks.pose_planning.judging import PoseRules
from phyblock.tracks.pose_planning.pictures import PosePictures, shows_three_sides
from phyblock.tracks.pose_planning.spec import PoseSpec
from phyblock.tracks.pose_planning.track import PosePlanning
from phyblock.tracks.selection import select_tasks

__all__ = ["open_pose_planning"]


def open_pose_planning(opening: Opening) -> PosePlanning:
    """The track; SpecError, DataError or PromptError with what is wrong."""
    suite = opening.suite
    poses = suite.section(PoseSpec)
    tasks = select_tasks(opening.dataset.tasks, suite.levels, opening.limit)
    showing = task_showing(suite, PoseSpec, "pose", tasks, opening.dataset.tasks)
    rules = _rules(suite, poses)
    if not opening.with_prompts:
        return PosePlanning(rules, items=tasks, showing=showing)
    check_drawn(suite, "the floor is ruled in pictures that are drawn here")
    _check_sheet(suite, poses)
    style = picture_style(suite.images)
    pictures = PosePictures(picture_folder(), style, poses.views, opening.shop)
    prompt = template_prompt(suite, PosePlanning.name)
    return PosePlanning(rules, prompt, pictures, tasks, showing)


def _check_sheet(suite: Suite, poses: PoseSpec) -> None:
    """Raise SpecError for a first view from which blocks of the sheet cannot be told apart."""
    first = poses.views[0]
    if shows_three_sides(first):
        return
    name = first if isinstance(first, str) else "a view along an axis, or too steep or too flat"
    problem = Problem(
        suite.where("pose", "views"),
        "the sheet of blocks is seen from the first view, and blocks look alike from there",
        "pose.views[0]",
        name,
        "first oblique, or an azimuth 10 degrees off the axes and an elevation of 10 to 75; others "
        "after it",
        hint=f"put oblique first: views: [oblique, {name}]" if isinstance(first, str) else "",
    )
    raise SpecError(problem)


def _rules(suite: Suite, poses: PoseSpec) -> PoseRules:
    """How a suite reads, scores and carries out plans with poses."""
    return PoseRules(
        poses.rotation,
        suite.settings,
        suite.scoring.matchers,
        ExecutionLimits(poses.overlap_cm, poses.stand_cm, poses.stand_deg),
        poses.reached_cm,
        poses.reached_deg,
        suite.answer_format,
    )
