"""Pose planning: blocks, order and positions in one reply."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag

from phyblock.config.suite import Suite
from phyblock.config.validation import PictureControls, Section, TemplateName, UniqueSome, refuse
from phyblock.data import AssemblyTask
from phyblock.domain import Block, CandidateSet, PoseStep, Scene
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models.request import Image, Request
from phyblock.parsing.poses import FARTHEST_PLACE_CM, MOST_POSE_STEPS
from phyblock.parsing.text import READER_VERSION
from phyblock.records.record import Record
from phyblock.resources import bundled
from phyblock.scoring.pose import POSE_ERRORS
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.sim.camera import VIEWS
from phyblock.sim.dynamics import ExecutionLimits
from phyblock.sim.geometry import box_height_cm, center_cm, upright
from phyblock.sim.pictures import PictureStyle, goal_style
from phyblock.sim.ruled import kit_key, kit_png, ruled_key, ruled_png, written_style
from phyblock.tracks.asked_once import AS_IN_FILE, WholePlanTrack
from phyblock.tracks.base import CARRYING, READER, engine_identity
from phyblock.tracks.by_hand import NumberField, Pick, Picking, candidate_choices
from phyblock.tracks.kind import Opening, TrackKind
from phyblock.tracks.measures import ListedScore, Listing, TrackReport
from phyblock.tracks.opening import (
    check_drawn,
    picture_folder,
    picture_style,
    task_showing,
    template_prompt,
)
from phyblock.tracks.pictures import Drawing, Studio, Workshop
from phyblock.tracks.pose_judging import (
    CARRY_VERSION,
    COUNTED,
    RIGHT,
    PoseJudgement,
    PoseRecord,
    PoseRules,
    buildable_order,
    judge_poses,
)
from phyblock.tracks.prompts import Prompt
from phyblock.tracks.selection import select_tasks
from phyblock.tracks.showing import ShownTask, TaskShowing
from phyblock.types import PoseRotation, View

_LIMITS = ExecutionLimits()
MOST_VIEWS = 4


class ViewSpec(Section):
    """A direction to see the goal from."""

    azimuth_deg: Annotated[float, Field(strict=True, ge=-360, le=360, allow_inf_nan=False)] = Field(
        description="0 looks from +x, 90 from +y [degrees]."
    )
    elevation_deg: Annotated[float, Field(strict=True, ge=1, le=90, allow_inf_nan=False)] = Field(
        description="90 looks straight down [degrees]."
    )


def _kind(view: object) -> str:
    """Return the kind of view that is meant, so that it is said to be wrong as that alone."""
    return "direction" if isinstance(view, Mapping | ViewSpec) else "name"


AnyView = Annotated[
    Annotated[View, Tag("name")] | Annotated[ViewSpec, Tag("direction")], Discriminator(_kind)
]


def _check_few(views: tuple[View | ViewSpec, ...]) -> tuple[View | ViewSpec, ...]:
    if len(views) <= MOST_VIEWS:
        return views
    raise refuse(f"has {len(views)} views", allowed=f"1 to {MOST_VIEWS}")


Tolerance = Annotated[float, Field(strict=True, gt=0, le=10, allow_inf_nan=False)]
Angle = Annotated[float, Field(strict=True, gt=0, le=90, allow_inf_nan=False)]


class PoseSpec(PictureControls):
    """Requests of poses in the pose_planning track, and the execution of plans."""

    rotation: PoseRotation = Field(
        default="candidate",
        description="candidate: blocks keep the orientation in which they are shown, and steps "
        "give a number and a place. free: each kind is shown once, upright, and steps give a "
        "rotation as well.",
    )
    views: Annotated[
        UniqueSome[AnyView],
        AfterValidator(_check_few),
        Field(max_length=MOST_VIEWS),
    ] = Field(
        default=("oblique", "top"),
        description="Where the goal is seen from, a picture each, 1 to 4 of them: "
        f"{', '.join(get_args(View))}, or an azimuth_deg and elevation_deg. Blocks are shown from "
        "where the first one is.",
    )
    overlap_cm: Tolerance = Field(
        default=_LIMITS.overlap_cm,
        description="A block that shares space with others is moved out of them by so much at "
        "most; one that would need more is refused [cm].",
    )
    stand_cm: Tolerance = Field(
        default=_LIMITS.stand_cm,
        description="A block that moves farther when it is let go has fallen, or was knocked over "
        "by another [cm].",
    )
    stand_deg: Angle = Field(
        default=_LIMITS.stand_deg, description="The same for how far it turns [degrees]."
    )
    reached_cm: Tolerance = Field(
        default=1.0,
        description="A block of the goal is reached where one of its kind lies so near in the end "
        "[cm].",
    )
    reached_deg: Angle = Field(default=10.0, description="The same for how it is turned [degrees].")
    prompt: TemplateName = Field(
        default="default", description="default, or the path of a .j2 template."
    )


_RIGHT = tuple(RIGHT.columns.index(f"absolute_{cm:g}") for cm in TOLERANCES_CM)
_STEPS, _BLOCKS = (RIGHT.columns.index(name) for name in ("steps", "blocks"))


def _in_c(record: Record) -> ListedScore | None:
    """Right steps as a mean over the tolerances, which gives the mean of their F1."""
    counts = record.counts.get(RIGHT.name)
    if counts is None:
        return None
    right = sum(counts[place] for place in _RIGHT) / len(_RIGHT)
    pose = record.pose if isinstance(record, PoseRecord) else None
    errors = {step.error for step in pose.steps if step.error is not None} if pose else ()
    return ListedScore(right, counts[_STEPS] - right, counts[_BLOCKS] - right, errors)


LISTED_IN_C = Listing("C", POSE_ERRORS, _in_c, is_counted=False)


_RANDOM_STEPS = 4
_RANDOM_REACH_CM = 15.0


@dataclass(frozen=True)
class PoseSubject:
    """A plan with poses is asked for; with `is_free` its steps bring a rotation."""

    scene: Scene
    candidates: CandidateSet
    is_free: bool


Center = tuple[float, float, float]


def written(steps: Iterable[PoseStep]) -> str:
    """Steps in the form that the prompt asks for."""
    return "\n".join(f"Step{n}: {_line(step)}" for n, step in enumerate(steps, 1))


def _line(step: PoseStep) -> str:
    turned = "" if step.euler_deg is None else f" turned ({_numbers(step.euler_deg)})"
    return f"block {step.candidate} at ({_numbers(step.center_cm)}){turned}"


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(f"{round(value, 4) + 0.0:g}" for value in values)


def _built(
    subject: PoseSubject,
    rng: np.random.Generator,
    move: Callable[[Block, Center], Center] = lambda _, center: center,
) -> str:
    """The goal's blocks in a random valid order, each moved from its true place.

    Layer by layer where that is in balance, else as near to it as is: a balance of which one arm is
    loaded to its top before the other topples, though the order is a valid one.
    """
    blocks, layers = subject.scene.blocks, subject.scene.graph.layers
    drawn = rng.random(len(blocks)).tolist()
    wanted = sorted(range(len(blocks)), key=lambda vertex: (layers[vertex], drawn[vertex]))
    order = buildable_order(subject.scene, wanted)
    return written(_step(subject, blocks[v], move(blocks[v], center_cm(blocks[v]))) for v in order)


def _step(subject: PoseSubject, block: Block, center: Center) -> PoseStep:
    candidates = subject.candidates
    if subject.is_free:
        number, euler = candidates.first_of(block.kind), block.euler_deg
        if number is not None:
            return PoseStep(number, center, euler)
    elif (number := candidates.index_of(block.look)) is not None:
        return PoseStep(number, center)
    where, field = f"scene {subject.scene.id}", f"blocks[order={block.order}]"
    found = f"{block.color} {block.type} turned {block.euler_deg}"
    raise DataError(Problem(where, "no candidate looks like this block", field, found))


def _oracle(subject: PoseSubject, rng: np.random.Generator) -> str:
    return _built(subject, rng)


def _noisy(sigma_cm: float) -> Callable[[PoseSubject, np.random.Generator], str]:
    """The oracle, every coordinate off by a Gaussian of so many centimeters."""

    def rule(subject: PoseSubject, rng: np.random.Generator) -> str:
        noise = np.random.default_rng(rng.integers(2**32))

        def moved(_: Block, center: Center) -> Center:
            x, y, z = np.array(center) + noise.normal(0.0, sigma_cm, 3)
            return float(x), float(y), float(z)

        return _built(subject, rng, moved)

    return rule


def _flat(subject: PoseSubject, rng: np.random.Generator) -> str:
    """Right sideways, all on the floor."""
    return _built(subject, rng, lambda block, center: (*center[:2], box_height_cm(block) / 2))


def _stack(subject: PoseSubject, rng: np.random.Generator) -> str:
    """All at the origin, one on another."""
    top = 0.0

    def stacked(block: Block, _: Center) -> Center:
        nonlocal top
        height = box_height_cm(block)
        top += height
        return 0.0, 0.0, top - height / 2

    return _built(subject, rng, stacked)


def _random(subject: PoseSubject, rng: np.random.Generator) -> str:
    """Any blocks anywhere, which sees nothing of the goal."""
    steps = []
    for _ in range(_RANDOM_STEPS):
        number = int(rng.integers(1, len(subject.candidates) + 1))
        x, y = rng.uniform(-_RANDOM_REACH_CM, _RANDOM_REACH_CM, 2)
        z = rng.uniform(0.0, _RANDOM_REACH_CM)
        turns = [90.0 * float(turn) for turn in rng.integers(0, 4, 3)]
        euler = (turns[0], turns[1], turns[2]) if subject.is_free else None
        steps.append(PoseStep(number, (float(x), float(y), float(z)), euler))
    return written(steps)


POSE_RULES = {
    "random": _random,
    "oracle": _oracle,
    "oracle-noise-1mm": _noisy(0.1),
    "oracle-noise-3mm": _noisy(0.3),
    "oracle-noise-1cm": _noisy(1.0),
    "oracle-2d": _flat,
    "stack": _stack,
}
"""Rules by name of the baseline."""
POSE_FLOORS = ("random",)
"""Those that never see the goal."""


_PLACE = tuple(
    NumberField(name, "cm", FARTHEST_PLACE_CM, decimals=2, step=0.5, leap=5.0) for name in "xyz"
)
_TURN = tuple(
    NumberField(f"r{name}", "degrees", 360.0, decimals=1, step=15.0, leap=90.0, start=0.0)
    for name in "xyz"
)
"""At first as the sheet of blocks shows it."""


def pick_poses(subject: PoseSubject) -> Picking:
    """Any candidates, each as often as needed, with its place, and its turn where that is free."""
    return Picking(
        candidate_choices(len(subject.candidates), (KIT_LABEL,)),
        least=1,
        most=MOST_POSE_STEPS,
        repeats=True,
        noun="step",
        write=lambda picks: written(map(_step_by_hand, picks)),
        fields=(*_PLACE, *(_TURN if subject.is_free else ())),
    )


def _step_by_hand(pick: Pick) -> PoseStep:
    x, y, z, *turn = pick.numbers
    return PoseStep(pick.place + 1, (x, y, z), (turn[0], turn[1], turn[2]) if turn else None)


KIT_LABEL = "blocks"
_LEAST_TURN_DEG, _LEAST_DEG, _MOST_DEG = 10.0, 10.0, 75.0


class PosePictures(Studio):
    """Pictures of assembly tasks: the goal from every view, then the sheet of the candidates."""

    def __init__(
        self,
        folder: Path,
        style: PictureStyle,
        views: tuple[View | ViewSpec, ...],
        shop: Workshop | int,
    ) -> None:
        super().__init__(folder, shop)
        # The prompt says that the sheet has one scale, whatever other pictures of candidates have.
        self._style = replace(style, candidate_scale="common")
        self._views = views

    async def of(self, task: AssemblyTask) -> tuple[Image, ...]:
        """The pictures of one task; StoreError where the cache folder cannot be written."""
        name = _name(task)
        recent = self.recalled(name)
        return recent or self.remembered(name, await self.images(self._drawings(task)))

    def outline(self, task: AssemblyTask) -> tuple[tuple[Image, ...], bool]:
        """The pictures as far as they are at hand, and whether all are; nothing is rendered."""
        side = written_style(self._style).size_px
        return self.outlined(self._drawings(task), (side, side))

    def keys(self, task: AssemblyTask) -> tuple[str, ...]:
        """Return what decides the pixels of a task's pictures."""
        return tuple(drawing.key for drawing in self._drawings(task))

    def _drawings(self, task: AssemblyTask) -> tuple[Drawing, ...]:
        seen = [_seen(self._style, view) for view in self._views]
        style = written_style(seen[0][1])
        sheet = partial(kit_png, task.candidates, style)
        drawings = [Drawing(KIT_LABEL, kit_key(task.candidates, style), sheet)]
        goal = task.goal if isinstance(task, ShownTask) else task
        if goal is not None:
            drawings = [*(self._goal(goal, name, one) for name, one in seen), *drawings]
        return tuple(drawings)

    def _goal(self, task: AssemblyTask, name: str, style: PictureStyle) -> Drawing:
        style = written_style(goal_style(task.scene, style))
        make = partial(ruled_png, task.scene, style)
        return Drawing(f"goal, {name}", ruled_key(task.scene, style), make)


def shows_three_sides(view: View | ViewSpec) -> bool:
    """True if a block that is seen so shows its top and two sides, as the sheet of blocks needs."""
    azimuth_deg, elevation_deg = _direction(view)
    off_axis_deg = abs((azimuth_deg + 45) % 90 - 45)
    return off_axis_deg >= _LEAST_TURN_DEG and _LEAST_DEG <= elevation_deg <= _MOST_DEG


def _direction(view: View | ViewSpec) -> tuple[float, float]:
    if isinstance(view, ViewSpec):
        return view.azimuth_deg, view.elevation_deg
    return VIEWS[view]


def _seen(style: PictureStyle, view: View | ViewSpec) -> tuple[str, PictureStyle]:
    """A view as words for people, and the style that looks from there."""
    azimuth_deg, elevation_deg = _direction(view)
    name = f"azimuth {azimuth_deg:g}°, elevation {elevation_deg:g}°"
    if not isinstance(view, ViewSpec):
        name = view
    return name, replace(style, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)


def _name(task: AssemblyTask) -> str:
    """Tells apart the ways in which a task is shown."""
    if not isinstance(task, ShownTask):
        return task.key
    return f"{task.key} {task.order} {task.goal and task.goal.key}"


class PosePlanning(WholePlanTrack[PoseRules, PosePictures]):
    """Prompt, parse and score of the track; pictures and physics are worked out elsewhere."""

    name = "pose_planning"

    def __init__(
        self,
        rules: PoseRules,
        prompt: Prompt | None = None,
        pictures: PosePictures | None = None,
        items: Sequence[AssemblyTask] = (),
        showing: TaskShowing = AS_IN_FILE,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording."""
        super().__init__(rules, prompt, pictures, items, showing)

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """The scene as a seed shows it; where steps bring a rotation, each kind once, upright."""
        shown = super().shown(item, seed)
        if not self.rules.is_free:
            return shown
        kit, numbers = upright(shown.candidates)
        if isinstance(shown, ShownTask):
            numbers = tuple(shown.order[number - 1] for number in numbers)
            return replace(shown, candidates=kit, order=numbers)
        return ShownTask(shown.scene, kit, shown.composite, numbers, shown, seed)

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, a digest of all that decides the pictures, the
        versions of the reader and of how plans are carried out, and the physics engine where it is
        another one than PyBullet.
        """
        return {
            **super().identity(),
            READER: READER_VERSION,
            CARRYING: CARRY_VERSION,
            **engine_identity(),
        }

    def outlines(self, item: AssemblyTask) -> Iterator[tuple[Request, bool]]:
        """The one request, made without rendering, and whether its pictures are the real ones."""
        yield from super().outlines(item if isinstance(item, ShownTask) else self.shown(item, 0))

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """Return the variables of templates; nothing in it gives an answer away."""
        return {**super().facts(item, pictures), "rotation": self.rules.rotation}

    def _subject(self, item: AssemblyTask) -> PoseSubject:
        return PoseSubject(item.scene, item.candidates, self.rules.is_free)

    def judge(self, item: AssemblyTask, text: str | None) -> PoseJudgement:
        """Read, score and carry out a reply; None, where there is none, is an empty plan."""
        return judge_poses(item, text, self.rules)

    async def judge_apart(
        self, item: AssemblyTask, text: str | None, earlier: Record | None
    ) -> PoseJudgement:
        """Return what `judge` does, computed in another process, or in a thread without one.

        A plan that an earlier record holds is not carried out again.
        """
        known = earlier if isinstance(earlier, PoseRecord) else None
        work = partial(judge_poses, item, text, self.rules, known)
        if self._pictures is None:
            return await asyncio.to_thread(work)
        return await self._pictures.work_out(work)


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
    """Return the rules by which a suite parses, scores and executes plans with poses."""
    return PoseRules(
        poses.rotation,
        suite.settings,
        suite.scoring.matchers,
        ExecutionLimits(poses.overlap_cm, poses.stand_cm, poses.stand_deg),
        poses.reached_cm,
        poses.reached_deg,
        suite.answer_format,
    )


def _report() -> TrackReport:
    from phyblock.tracks.pose_planning_results import REPORT

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
