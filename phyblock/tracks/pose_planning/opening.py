"""Open the pose-planning track of a suite."""

from __future__ import annotations

from phyblock.errors import Problem, SpecError
from phyblock.sim.carry import CarryLimits
from phyblock.specs import SuiteSpec
from phyblock.tracks.kind import Opening
from phyblock.tracks.opening import picture_folder, picture_style, task_showing, template_prompt
from phyblock.tracks.pose_planning.judging import PoseRules
from phyblock.tracks.pose_planning.pictures import PosePictures
from phyblock.tracks.pose_planning.spec import PoseSpec
from phyblock.tracks.pose_planning.track import PosePlanning
from phyblock.tracks.selection import select_tasks

__all__ = ["open_pose_planning"]


def open_pose_planning(opening: Opening) -> PosePlanning:
    """The track; SpecError, DataError or PromptError with what is wrong."""
    loaded, suite = opening.loaded, opening.loaded.suite
    poses = suite.section(PoseSpec)
    tasks = select_tasks(opening.dataset.tasks, suite.levels, opening.limit, opening.named)
    showing = task_showing(suite, PoseSpec, "pose", tasks, opening.dataset.tasks)
    rules = _rules(suite, poses)
    if not opening.with_prompts:
        return PosePlanning(rules, items=tasks, showing=showing)
    if suite.images.source == "dataset":
        where = loaded.where("images", "source")
        message = "the floor is ruled in pictures that are drawn here"
        hint = "render the pictures: --set images.source=render"
        raise SpecError(Problem(where, message, "images.source", "dataset", hint=hint))
    style = picture_style(suite.images)
    pictures = PosePictures(picture_folder(), style, poses.views, opening.shop)
    prompt = template_prompt(loaded, PosePlanning.name)
    return PosePlanning(rules, prompt, pictures, tasks, showing)


def _rules(suite: SuiteSpec, poses: PoseSpec) -> PoseRules:
    """How a suite reads, scores and carries out plans with poses."""
    return PoseRules(
        poses.rotation,
        suite.settings,
        suite.scoring.matchers,
        CarryLimits(poses.overlap_cm, poses.stand_cm, poses.stand_deg),
        poses.reached_cm,
        poses.reached_deg,
        suite.answer_format,
    )
