"""Shared parts of opening tracks: picture style, worker processes, prompts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from phyblock.config.suite import ImagesSpec, Suite
from phyblock.config.validation import PictureControls
from phyblock.data import AssemblyTask
from phyblock.errors import Problem, SpecError
from phyblock.resources import cache_dir
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks.base import AnyTrack
from phyblock.tracks.kind import Opening, kind_of
from phyblock.tracks.pictures import PicturePolicy, Pictures, Workshop, render_workers
from phyblock.tracks.prompts import TemplatePrompt
from phyblock.tracks.showing import Showing, TaskShowing
from phyblock.types import BACKGROUNDS

__all__ = [
    "assembly_pictures",
    "check_drawn",
    "open_tracks",
    "picture_folder",
    "picture_policy",
    "picture_style",
    "task_showing",
    "template_prompt",
]


def open_tracks(opening: Opening, names: Sequence[str]) -> tuple[AnyTrack, ...]:
    """The tracks of these names, in their order.

    Raises SpecError, DataError or PromptError with what is wrong.
    """
    suite = opening.suite
    if suite.answer_format == "json_schema":
        lacking = [name for name in names if kind_of(name).json_template is None]
        if lacking:
            where, message = suite.where("answer_format"), "cannot be asked for as JSON"
            found, hint = f"track {', '.join(lacking)}", "use answer_format: text"
            raise SpecError(Problem(where, message, "answer_format", found, hint=hint))
    if suite.examples:
        for name in names:
            if reason := kind_of(name).no_examples:
                where, message = suite.where("examples"), f"cannot be shown in {name}: {reason}"
                raise SpecError(Problem(where, message, "examples", hint="leave them out"))
    return tuple(kind_of(name).open(opening) for name in names)


def picture_folder() -> Path:
    """Return the folder of drawn pictures."""
    return cache_dir() / "pictures"


def picture_style(images: ImagesSpec) -> PictureStyle:
    """Return the style in which a suite wants pictures drawn."""
    ground = images.background or BACKGROUNDS[0]
    seen = PictureStyle.from_view(images.view, images.size_px, ground)
    return replace(seen, candidate_scale=images.candidate_scale)


def picture_policy(images: ImagesSpec) -> PicturePolicy:
    """Return which pictures of goals and candidates a suite wants, and how they are drawn."""
    return PicturePolicy(images.source, images.layout, images.order, picture_style(images))


def assembly_pictures(suite: Suite, shop: Workshop | None = None) -> Pictures:
    """Pictures of goals and candidates as a suite wants them, drawn in a shop of their own or this
    one.
    """
    return Pictures(picture_folder(), picture_policy(suite.images), shop or render_workers())


def check_drawn(suite: Suite, reason: str) -> None:
    """Raise SpecError, with the reason, for a suite that takes pictures from the data set."""
    if suite.images.source == "dataset":
        where, hint = (
            suite.where("images", "source"),
            "render the pictures: --set images.source=render",
        )
        raise SpecError(Problem(where, reason, "images.source", "dataset", hint=hint))


def task_showing(
    suite: Suite,
    section: type[PictureControls],
    name: str,
    tasks: Sequence[AssemblyTask],
    pool: Sequence[AssemblyTask],
) -> TaskShowing:
    """Return how a suite shows the scenes of a track, whose section is of this type and name.

    Raises SpecError where another goal is wanted and `pool` has none for one of `tasks`.
    """
    controls = suite.section(section)
    how = Showing(suite.candidates.order, controls.blind, controls.wrong_image, suite.seeds)
    return TaskShowing(how, tasks, pool, f"{name}.wrong_image")


def template_prompt(suite: Suite, name: str) -> TemplatePrompt:
    """The prompt of a track: the suite's own template, else the bundled one for its format.

    Raises PromptError for a broken one.
    """
    kind = kind_of(name)
    own = kind.template if suite.answer_format == "text" else kind.json_template
    default = None if own is None else TemplatePrompt(own, "default")
    path = suite.files.templates.get(name)
    if path is not None:
        return TemplatePrompt(path, path.stem, default)
    assert default is not None, f"{name} has no prompt of its own"
    return default
