"""Files that a suite is made of, and remarks on how its models are asked, before a run."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from PIL import Image as PillowImage

from phyblock.config.models import RECORDED, ModelConfig
from phyblock.config.suite import Suite
from phyblock.data import recorded_models
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models import (
    Image,
    Message,
    Reply,
    Request,
    RetryPolicy,
    build_model,
)
from phyblock.records.manifest import Manifest
from phyblock.resources import bundled
from phyblock.run.plan import RunPlan
from phyblock.text import did_you_mean
from phyblock.tracks.base import template_prompt
from phyblock.tracks.prompts import FORM_FACTS


def bundled_suites() -> list[str]:
    """Names of the suites that come with the project, sorted."""
    return sorted(path.stem for path in bundled("benchmarks").glob("*.yaml"))


def find_suite(name: str) -> Path:
    """The suite file that `name` means: a path, or the name of a bundled suite.

    Raises SpecError that lists the bundled suites when there is no such file, or for a prompt.
    """
    path = Path(name)
    if os.path.isfile(path):
        if path.suffix == ".j2":
            hint = "name the suite that uses it: its prompts are rendered"
            raise SpecError(Problem(name, "is a prompt, not a suite", hint=hint))
        return path
    if not name.strip():
        allowed = "a suite file, or a bundled suite: " + ", ".join(bundled_suites())
        raise SpecError(Problem("suite", "is empty", found=repr(name), allowed=allowed))
    if path.suffix in ("", ".yaml") and path.parent == Path():
        inside = bundled("benchmarks", f"{path.stem}.yaml")
        if os.path.isfile(inside):
            return inside
    names = bundled_suites()
    hint = did_you_mean(path.stem, names)
    allowed = "a suite file, or a bundled suite: " + ", ".join(names)
    message = what_it_is(path) or "there is no such suite"
    raise SpecError(Problem(name, message, allowed=allowed, hint=hint))


def what_it_is(path: Path) -> str:
    """Return why something that is no file cannot be read; "" where there is nothing at all."""
    if os.path.isdir(path):
        return "is a folder"
    return "is not a regular file" if os.path.exists(path) else ""


def find_models_file(named: str | None, suite: Path | None) -> Path:
    """The models file: the one named, else models.yaml here, near the suite, or the bundled one.

    Raises SpecError when the one named is not there.
    """
    if named is not None:
        if os.path.isfile(named):
            return Path(named)
        message = what_it_is(Path(named)) or "there is no such models file"
        raise SpecError(Problem(named, message))
    for folder in _near(suite):
        if os.path.isfile(folder / "models.yaml"):
            return folder / "models.yaml"
    return bundled("models.yaml")


def prompt_dirs(suite: Path) -> list[Path]:
    """Folders of prompts of one's own: where the models file is looked for, too."""
    return [folder / "prompts" for folder in _near(suite)]


def _near(suite: Path | None) -> list[Path]:
    """Here, and near the suite."""
    return [Path(), *([] if suite is None else [suite.parent, suite.parent.parent])]


def asking_remarks(suite: Suite, plan: RunPlan) -> list[str]:
    """Models that are asked although recordings of them are there; prompts of one's own; and where
    answers are asked for as JSON, which models are sent the schema, which hear of it in the prompt
    alone, and which of these prompts do not say it.
    """
    called = [model.name for model in plan.models if model.config.kind == "litellm"]
    if not called:
        return []
    asked = {variant.shown: suite.at(variant.shown) for variant in plan.variants}
    used = {
        (track, path): one for one in asked.values() for track, path in one.files.templates.items()
    }
    own = [*_recorded(called, suite)]
    own += [_named(track, path, one) for (track, path), one in used.items()]
    if plan.extractor is not None:
        own.append(f"replies that cannot be read are sent to {plan.extractor.name}, as text")
    if suite.answer_format == "text":
        return own
    unsaid = [_unsaid(track, path) for (track, path), one in used.items() if not _says(track, one)]
    return [*own, *_models(plan), *unsaid]


def moved_remarks(begun: Manifest, plan: RunPlan) -> list[str]:
    """Return the models served elsewhere than when the run began: its replies still stand."""
    before = {model.name: model.served_at for model in begun.models}
    return [
        f"{model.name} was asked at {', '.join(before[model.name])} and is now at "
        f"{', '.join(model.config.addresses)}: taken to be the same weights (other ones need "
        "another revision in the models file)"
        for model in plan.models
        if before.get(model.name) and model.config.addresses
        if set(before[model.name]).isdisjoint(model.config.addresses)
    ]


def _recorded(called: Sequence[str], suite: Suite) -> Iterator[str]:
    if suite.dataset.format != "official":
        return
    with contextlib.suppress(DataError):
        known = recorded_models(suite.files.dataset)
        if names := ", ".join(name for name in called if name in known):
            yield (
                f"{names}: called anew, though {suite.files.dataset} holds recorded replies "
                f"(models: {RECORDED} in the suite replays them, of those that --models names)"
            )


def _models(plan: RunPlan) -> Iterator[str]:
    configs = [model.config for model in plan.models if model.config.kind == "litellm"]
    if sent := [config.name for config in configs if config.sends_format]:
        yield f"the JSON schema of answers is sent to {', '.join(sent)}"
    if others := [config.name for config in configs if not config.sends_format]:
        yield (
            f"the prompt alone asks for JSON of {', '.join(others)} "
            "(response_format: always in the models file sends the schema)"
        )


def _named(track: str, path: Path, suite: Suite) -> str:
    prompt = template_prompt(suite, track)
    more = f" (with {', '.join(file.name for file in prompt.included)})" if prompt.included else ""
    line = prompt.unsent_line
    lost = "" if line is None else f"; the text outside of its blocks (line {line}) is NOT sent"
    return f"prompt of {track}: {path}{more}{lost}"


def _says(track: str, suite: Suite) -> bool:
    return template_prompt(suite, track).says_form


def _unsaid(track: str, path: Path) -> str:
    names = " and ".join(FORM_FACTS)
    return (
        f"{path.name}, the prompt of {track}, does not use {names}: unless it says the form of the "
        "answer in words of its own, models are not told it"
    )


_SIDE_PX = 64
_QUESTION = "What color is this picture? Answer with one word."


async def check_model(config: ModelConfig) -> Reply:
    """Show the model a small red square and ask for its color; one attempt, nothing cached.

    Raises the ModelError that the call met, SpecError or DataError when the model cannot be built.
    """
    buffer = io.BytesIO()
    PillowImage.new("RGB", (_SIDE_PX, _SIDE_PX), (216, 49, 49)).save(buffer, "PNG")
    picture = Image(buffer.getvalue(), "check", _SIDE_PX, _SIDE_PX)
    messages = (Message("user", (picture, _QUESTION)),)
    request = Request("check", 0, messages, {}, "", None)
    model = build_model(
        config.model_copy(update={"seed": "never", "batch": False}),
        cache=None,
        policy=RetryPolicy(attempts=1, retry_for_s=0.0),
    )
    try:
        reply = await model.ask(request)
    finally:
        await model.aclose()
    return reply or Reply(text="")
