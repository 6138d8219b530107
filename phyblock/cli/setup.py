"""`phyblock init`, `validate`, `models` and `cache`: a working folder, its files, the cache."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import click

from phyblock.cli import console as ui
from phyblock.config.models import GROUP, RECORDED, load_models, with_members
from phyblock.config.suite import Suite, suite_model
from phyblock.config.yaml import read_yaml
from phyblock.data.lookup import read_data_set
from phyblock.data.scenes import SCENES_FILE
from phyblock.errors import InputError, Problem, SpecError
from phyblock.files import bundled, check_free, reply_cache_file, writing
from phyblock.registry import baseline_names
from phyblock.run import plan as plans
from phyblock.text import counted, did_you_mean
from phyblock.tracks.base import kind_of

_FILES = (
    ("models.yaml",),
    ("benchmarks", "schemas", "suite.schema.json"),
    ("benchmarks", "schemas", "models.schema.json"),
)


@click.command()
@click.argument("folder", type=ui.UserPath())
@click.option(
    "--suite",
    type=click.Choice(plans.bundled_suites()),
    default="quick",
    help="Bundled suite to begin with.",
)
def init(folder: Path, suite: str) -> None:
    """Create FOLDER with a suite, a models file and prompts to edit.

    Never overwrites existing files.
    """
    tracks = read_yaml(plans.find_suite(suite)).data.get("tracks", ["full_planning"])
    templates = [kind_of(name).template for name in tracks]
    prompts = [
        ("prompts", path.name)
        for template in templates
        for path in sorted(bundled("prompts").glob(f"{template.stem}*.j2"))
    ]
    names = (*_FILES, ("benchmarks", f"{suite}.yaml"), *prompts)
    files = [folder.joinpath(*parts) for parts in names]
    check_free(files, "choose another folder")
    console = ui.make_console()
    with writing(folder):
        for target, parts in zip(files, names, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("xb") as file:
                file.write(bundled(*parts).read_bytes())
            ui.print_path(console, f"  {ui.shown_path(target)}")
    console.print(
        "\nAdd a model with one line in models.yaml, then name it under models in the suite. "
        "What you change under prompts/ is used by every run from here (NAME_json.j2 where a suite "
        "asks for JSON). Next:"
    )
    place = shlex.quote(ui.shown_path(folder))
    ui.print_path(console, f"  cd {place} && phyblock run benchmarks/{suite}.yaml")


@click.command()
@click.argument("files", nargs=-1, required=True, type=ui.UserPath())
@ui.sets_option
@ui.models_file_option
def validate(files: tuple[Path, ...], sets: tuple[str, ...], models_file: str | None) -> None:
    """Check FILES: suites or names of bundled ones, models files, data sets, official checkouts.

    Shows all problems of all files; exits with 2 if there are any.
    """
    console = ui.make_console()
    problems: list[Problem] = []
    for path in files:
        try:
            summary = _check(path, sets, models_file)
        except InputError as error:
            problems += error.problems
        else:
            console.print(f"{ui.shown_path(path)}: {summary}")
    if problems:
        raise InputError(problems)


def _check(path: Path, sets: tuple[str, ...], models_file: str | None) -> str:
    """Return a description of a valid file."""
    if os.path.isdir(path) or path.name == SCENES_FILE:
        dataset = read_data_set(str(path))
        levels = sorted({n for task in dataset.tasks for n in task.scene.levels})
        by_level = ", ".join(
            f"{sum(n in task.scene.levels for task in dataset.tasks)} of level {n}" for n in levels
        )
        scenes = counted(len(dataset.tasks), "scene")
        return f"data set {dataset.name}, {scenes} ({by_level})"
    path = plans.find_suite(str(path))
    data = read_yaml(path).data
    if isinstance(data, dict) and data.keys() & suite_model().model_fields.keys():
        suite = plans.read_suite(str(path), sets)
        named = plans.find_models_file(models_file, path)
        known = load_models(named)
        asked = () if suite.models == RECORDED else suite.models
        names = [name for name in with_members(asked, known) if name in known]
        plans.check_models([known[name] for name in names], read_yaml(named))
        planned = plans.make_plan(suite, known)
        models = counted(len(planned.models), "model")
        samples = f"{counted(planned.samples_per_model, 'sample')} a model"
        return f"suite {suite.name}, {models}, {samples}"
    known = load_models(path)
    plans.check_models(known.values(), read_yaml(path))
    if not known:
        allowed = "a suite, or a models file with name: provider/model lines"
        raise SpecError(Problem(str(path), "is empty", allowed=allowed))
    return f"models file, {counted(len(known), 'model')}"


@click.command()
@ui.models_file_option
def models(models_file: str | None) -> None:
    """List the models that suites may name."""
    from phyblock.models.client import api_key_status
    from phyblock.models.costs import tariff_of

    path = plans.find_models_file(models_file, None)
    known = load_models(path)
    console = ui.make_console()
    rows: list[tuple[str, ...]] = []
    suite = Suite(name="models", models=("random",))
    for name, entry in known.items():
        if (config := plans.to_config(name, entry, suite)).kind != "litellm":
            rows.append((name, str(config.replay), "", "0, 0"))
            continue
        status, tariff = api_key_status(config), tariff_of(config)
        key = f"no {status.variables[0]}" if status.is_needed else "not needed"
        key = "set" if status.key else key
        price = f"{tariff.input:.10g}, {tariff.output:.10g}" if tariff else "unknown"
        rows.append((name, config.id, key, price))
    ui.print_rows(console, ("model", "id", "key", "$/M in, out"), rows, numbers=1)
    console.print(f"{counted(len(known), 'model')} in {ui.shown_path(path)}")
    for group in dict.fromkeys(group for config in known.values() for group in config.groups):
        console.print(f"{GROUP}{group}: {', '.join(with_members([GROUP + group], known))}")
    console.print(f"Baselines, at no cost: {', '.join(baseline_names())}")


@click.command()
@click.option("--clear", metavar="ID", help="Ask, then delete the replies of this model id.")
def cache(clear: str | None) -> None:
    """List the replies in the reply cache, which all runs of this user share, by model id."""
    from phyblock.models.cache import ReplyCache

    console, path = ui.make_console(), reply_cache_file()
    with ReplyCache(path) as opened:
        counts = opened.counts()
        if clear is not None:
            if clear not in counts:
                hint = did_you_mean(clear, counts)
                raise SpecError(Problem(str(path), "has no replies of", "", clear, hint=hint))
            which = f"{counted(counts.pop(clear), 'reply', 'replies')} of {clear}"
            click.confirm(f"Delete {which}? The same calls are billed again.", abort=True)
            opened.clear(clear)
    rows = [(model, f"{number:,}") for model, number in counts.items()]
    ui.print_rows(console, ("model", "replies"), rows, numbers=1)
    total = counted(sum(counts.values()), "reply", "replies")
    console.print(f"{total}, {path.stat().st_size / 1e6:,.1f} MB, in")
    ui.print_path(console, path)
