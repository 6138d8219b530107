"""`phyblock init`, `validate` and `cache`: a working folder, its files, the paid replies."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import click

from phyblock.cli.console import make_console, print_path, print_rows, shown_path
from phyblock.cli.options import UserPath, models_file_option, sets_option
from phyblock.config.models import RECORDED, load_models
from phyblock.config.suite import suite_model
from phyblock.config.yaml import read_yaml
from phyblock.data.lookup import read_data_set
from phyblock.data.scenes import SCENES_FILE
from phyblock.errors import InputError, Problem, SpecError
from phyblock.files import bundled, check_free, reply_cache_file, writing
from phyblock.run.plan import (
    asking_remarks,
    bundled_suites,
    find_models_file,
    find_suite,
    make_plan,
    model_problems,
    read_suite,
)
from phyblock.text import counted
from phyblock.tracks.base import kind_of

_FILES = (
    ("models.yaml",),
    ("benchmarks", "schemas", "suite.schema.json"),
    ("benchmarks", "schemas", "models.schema.json"),
)


@click.command()
@click.argument("folder", type=UserPath())
@click.option(
    "--suite",
    type=click.Choice(bundled_suites()),
    default="quick",
    help="Bundled suite to begin with.",
)
def init(folder: Path, suite: str) -> None:
    """Lay out FOLDER with a suite, a models file and prompts to change.

    Never writes over files that are already there.
    """
    tracks = read_yaml(find_suite(suite)).data.get("tracks", ["full_planning"])
    templates = [kind_of(name).template for name in tracks]
    prompts = [
        ("prompts", path.name)
        for template in templates
        for path in sorted(bundled("prompts").glob(f"{template.stem}*.j2"))
    ]
    names = (*_FILES, ("benchmarks", f"{suite}.yaml"), *prompts)
    files = [folder.joinpath(*parts) for parts in names]
    check_free(files, "choose another folder")
    console = make_console()
    with writing(folder):
        for target, parts in zip(files, names, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("xb") as file:
                file.write(bundled(*parts).read_bytes())
            print_path(console, f"  {shown_path(target)}")
    console.print(
        "\nAdd a model with one line in models.yaml, then name it under models in the suite. "
        "What you change under prompts/ is used by every run from here (NAME_json.j2 where a suite "
        "asks for JSON). Next:"
    )
    place = shlex.quote(shown_path(folder))
    print_path(console, f"  cd {place} && phyblock run benchmarks/{suite}.yaml")


@click.command()
@click.argument("files", nargs=-1, required=True, type=UserPath())
@sets_option
@models_file_option
def validate(files: tuple[Path, ...], sets: tuple[str, ...], models_file: str | None) -> None:
    """Check FILES: suites (or names of bundled ones) and models files, data set folders, official
    checkouts.

    Shows all problems of all files; exits with 2 if there are any.
    """
    console = make_console()
    problems: list[Problem] = []
    for path in files:
        try:
            summary, *remarks = _check(path, sets, models_file)
        except InputError as error:
            problems += error.problems
        else:
            console.print(f"{shown_path(path)}: {summary}")
            for remark in remarks:
                console.print(f"  {remark}")
    if problems:
        raise InputError(problems)


def _check(path: Path, sets: tuple[str, ...], models_file: str | None) -> list[str]:
    """Describe a file without problems, and add remarks."""
    if os.path.isdir(path) or path.name == SCENES_FILE:
        dataset = read_data_set(str(path))
        levels = sorted({n for task in dataset.tasks for n in task.scene.levels})
        by_level = ", ".join(
            f"{sum(n in task.scene.levels for task in dataset.tasks)} of level {n}" for n in levels
        )
        scenes = counted(len(dataset.tasks), "scene")
        return [f"data set {dataset.name}, {scenes} ({by_level})"]
    path = find_suite(str(path))
    data = read_yaml(path).data
    if isinstance(data, dict) and isinstance(data.get("blocks"), list):
        message, allowed = "holds scenes", "a suite, a models file, or the folder of a data set"
        hint = f"`phyblock scenes complete {shown_path(path)}` makes a data set of them"
        raise SpecError(Problem(str(path), message, allowed=allowed, hint=hint))
    if isinstance(data, dict) and data.keys() & suite_model().model_fields.keys():
        suite = read_suite(str(path), sets)
        named = find_models_file(models_file, path)
        known = load_models(named)
        asked = () if suite.models == RECORDED else suite.models
        if problems := list(model_problems(named, known, asked)):
            raise SpecError(problems)
        plan = make_plan(suite, known)
        models = counted(len(plan.models), "model")
        samples = f"{counted(plan.samples_per_model, 'sample')} a model"
        return [f"suite {suite.name}, {models}, {samples}", *asking_remarks(suite, plan)]
    known = load_models(path)
    if problems := list(model_problems(path, known, known)):
        raise SpecError(problems)
    if not known:
        allowed = "a suite, or a models file with name: provider/model lines"
        raise SpecError(Problem(str(path), "names nothing", allowed=allowed))
    return [f"models file, {counted(len(known), 'model')}"]


@click.group()
def cache() -> None:
    """Show or clear the reply cache, which all runs of this user share."""


@cache.command()
def stats() -> None:
    """Show the number of cached replies of each model, and the size of the file."""
    from phyblock.models.cache import ReplyCache

    console = make_console()
    with ReplyCache(reply_cache_file()) as opened:
        counts, size = opened.counts(), f"{opened.size_bytes / 1e6:,.1f} MB"
    rows = [(model, f"{replies:,}") for model, replies in counts.items()]
    if rows:
        print_rows(console, ("model", "replies"), rows, numbers=1)
    replies = counted(sum(counts.values()), "reply", "replies")
    console.print(f"{replies}, {size}, in")
    print_path(console, opened.path)


@cache.command()
@click.option("--model", metavar="ID", help="Delete only the replies of this model id.")
@click.option("--yes", is_flag=True, help="Do not ask.")
def clear(model: str | None, yes: bool) -> None:
    """Delete cached replies; repeated calls will be billed."""
    from phyblock.models.cache import ReplyCache

    which = f"replies of {model}" if model else "all replies"
    if not yes:
        click.confirm(f"Delete {which}? Repeated calls will be billed.", abort=True)
    with ReplyCache(reply_cache_file()) as opened:
        make_console().print(f"Deleted {counted(opened.clear(model), 'reply', 'replies')}.")
