"""`phyblock scenes` and `phyblock questions`: make, check, show and draw data sets."""

from __future__ import annotations

import io
import json
import os
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import chain, product
from operator import call
from pathlib import Path
from typing import Any, TypeVar

import click
import numpy as np
from click.core import ParameterSource
from PIL import Image

from phyblock.cli import console
from phyblock.cli.console import NAME_OR_PATH, UserPath
from phyblock.data.base import QuestionSet
from phyblock.data.lookup import find_data_set, find_questions, read_data_set
from phyblock.data.questions import read_questions
from phyblock.data.scenes import SCENES_FILE
from phyblock.domain.question import LETTERS, SUBTASK_NAMES, SUBTASKS, Subtask
from phyblock.domain.scene import AssemblyTask, fingerprint
from phyblock.errors import DataError, Problem
from phyblock.files import OutFolder, bundled_sets, write_named
from phyblock.making import checks, files
from phyblock.making.questions.guesses import audit_questions
from phyblock.making.questions.production import MAKERS, make_questions, problem_of
from phyblock.making.scenes.completing import complete, read_given
from phyblock.making.scenes.production import Production, builtin_forms, make_candidates, shares
from phyblock.making.scenes.sketch import PALETTES, Palette, colorless
from phyblock.sim import pictures
from phyblock.sim.engine import described_engine, other_engine
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.sim.raster import VIEWS
from phyblock.text import counted, did_you_mean, hex_digest
from phyblock.tracks.base import DIFFICULTY
from phyblock.types import BACKGROUNDS
from phyblock.workers import Shards, Workers, open_workers

T = TypeVar("T")
R = TypeVar("R")
_GAP_PX = 8


@click.group("scenes")
def scenes() -> None:
    """Make data sets of scenes, check them by physics, and show them."""


@click.group("questions")
def questions() -> None:
    """Make, check and show multiple-choice questions about scenes."""


# Options and steps that commands share


def _several(known: Sequence[str]) -> Callable[..., tuple[str, ...]]:
    """Return a callback that reads a comma-separated list of known words, each once, or `all`."""

    def read(_: click.Context, __: click.Parameter, value: str) -> tuple[str, ...]:
        words = tuple(known) if value == "all" else tuple(value.upper().split(","))
        if not set(known).issuperset(words) or len(set(words)) < len(words):
            raise click.BadParameter(f"{value!r}: give all, or some of {','.join(known)}")
        return words

    return read


_out = click.option(
    "--out", "-o", type=UserPath(), required=True, metavar="DIR", help="Folder to write."
)
_seed = click.option("--seed", type=click.IntRange(0), default=0, metavar="S")


@contextmanager
def _making(
    out: Path, names: Sequence[str], work: str, shard: tuple[int, int] | None, **pool: Any
) -> Iterator[tuple[Workers, Shards | None]]:
    """Open workers for a set with files of these names; `work` describes it. Raises StoreError if
    `out` already has a set, unless shards continue in it.
    """
    if shard is None or not console.shards_folder(out).exists():
        files.check_out(out, names)
    work = f"{work}\n{described_engine()}\n{files.code_digest()}\n"
    if other := other_engine():
        message = f"made with {other}: the default one may make another set of the same seed"
        click.echo(message, err=True)
    shards = console.open_shards(shard, out, work)
    with open_workers(**pool, shards=shards) as workers:
        yield workers, shards


def _mapped(function: Callable[[T], R], items: Sequence[T], jobs: int, doing: str) -> list[R]:
    """Return the results of a function for the items, from `jobs` processes, with progress."""
    with open_workers(min(jobs, len(items) or 1)) as workers:
        return list(console.tracked(workers.map(function, items), len(items), doing))


def _conclude(
    name: str,
    headings: tuple[str, ...],
    rows: Iterable[tuple[tuple[str, ...], int, int]],
    problems: Sequence[Problem | str],
) -> None:
    """Print the table of checks, the problems and the verdict; exit with 1 if there are problems.

    Each row has words, the number of things that failed, and the number of all.
    """
    shown = [(*words, str(of - failed), str(of)) for words, failed, of in rows]
    console.print_rows(console.make_console(), (*headings, "of"), shown, numbers=2)
    for problem in problems:
        click.echo(f"failed: {problem}", err=True)
    verdict = counted(len(problems), "failure") if problems else "all checks passed"
    click.echo(f"{name}: {verdict}")
    if problems:
        raise click.exceptions.Exit(1)


# Scenes


@scenes.command("generate")
@click.option("--count", type=click.IntRange(1), default=400, metavar="N")
@click.option("--levels", callback=_several((*"1234", "5+")), default="1,2,3,4", metavar="WORDS")
@click.option(
    "--palette",
    type=click.Choice(["kit", "full"]),
    default="kit",
    help=f"The kit's {len(PALETTES['kit'])} pairs of type and color, or all pairs.",
)
@click.option(
    "--exclude", multiple=True, type=NAME_OR_PATH, metavar="SET", help="Also exclude its scenes."
)
@_seed
@console.worker_options()
@_out
def generate_scenes(
    count: int,
    levels: tuple[str, ...],
    palette: Palette,
    exclude: tuple[str, ...],
    seed: int,
    out: Path,
    **workers_options: Any,
) -> None:
    """Make N scenes with candidate sets, each checked by physics, and their data card.

    None equals one of the built-in set or an excluded SET, recolored, turned, mirrored or shifted.
    The same arguments and physics engine give the same files, on any Python and with any workers.
    """
    settled = _settled(count, levels, palette, exclude)
    command = f"phyblock scenes generate {settled} --seed {seed} --out {out.name}"
    others = (task.scene for name in exclude for task in read_data_set(name).tasks)
    excluded = builtin_forms().union(colorless(scene.blocks) for scene in others)
    work = f"{command}\n{hex_digest(b''.join(sorted(excluded)))}"
    with _making(out, files.SCENE_FILES, work, **workers_options) as (workers, shards):
        production = Production(seed, palette, workers, excluded)
        produced = production.tasks(shares(count, [int(level[0]) for level in levels]))
        tasks = list(console.tracked(produced, count, "Making"))
    if console.left_to_first(shards, out):
        return
    card = files.scene_card(out.name, tasks, command, palette, production.rejected)
    files.write_scenes(out, tasks, card)
    click.echo(f"{counted(count, 'scene')}, all checks passed: {console.shown_path(out)}")
    known = "the built-in set or an excluded one" if exclude else "the built-in set"
    click.echo(f"{counted(production.rejected, 'draft')} rejected: a scene of {known}")


def _settled(count: int, levels: Sequence[str], palette: str, exclude: Sequence[str]) -> str:
    """Return arguments of generate in canonical form."""
    text = f"--count {count} --levels {','.join(sorted(levels))} --palette {palette}"
    return text + "".join(f" --exclude {shlex.quote(name)}" for name in exclude)


@scenes.command("commit")
@click.argument("arguments", nargs=-1, metavar="-- [ARGUMENT]...")
@click.option("--public", required=True, metavar="TEXT", help="The later public value, in words.")
@_out
def commit(arguments: tuple[str, ...], public: str, out: Path) -> None:
    """Commit to a set, given by ARGUMENTS of generate, before anyone can choose or know its seed.

    Writes DIR/secret.txt, to be kept, and DIR/commitment.json, to be published: digests of the
    secret, of phyblock's code and of the built-in scenes, and the later public value to use.
    """
    secret, commitment = files.commit_season(out, _season_arguments(arguments), public)
    click.echo(f"publish {console.shown_path(commitment)}; keep {console.shown_path(secret)}")


@scenes.command("reveal")
@click.argument("commitment", type=UserPath())
@click.argument("secret", type=UserPath())
@click.option("--public", required=True, metavar="VALUE", help="The public value that came later.")
def reveal(commitment: Path, secret: Path, public: str) -> None:
    """Print the command that makes the set of a COMMITMENT, once its SECRET is revealed.

    Refuses a secret, code or physics engine other than the one committed to.
    """
    arguments, seed = files.reveal_season(commitment, secret, public)
    settled = _season_arguments(shlex.split(arguments))
    click.echo(f"phyblock scenes generate {settled} --seed {seed} --out DIR")


def _season_arguments(words: Sequence[str]) -> str:
    """Return arguments of generate in canonical form. Raises UsageError for those no season has."""
    context = generate_scenes.make_context("generate", ["--out", ".", *words])
    given = context.params
    if context.get_parameter_source("seed") is not ParameterSource.DEFAULT:
        raise click.UsageError("A season has no --seed: its secret and the public value give one.")
    if given["out"] != Path("."):
        raise click.UsageError("A season has no --out of generate: reveal prints the command.")
    bundled = bundled_sets(SCENES_FILE)
    if others := [name for name in given["exclude"] if name not in bundled]:
        message = f"{others[0]} can change before the season: exclude a bundled set"
        raise click.UsageError(f"{message} ({', '.join(bundled)}).")
    return _settled(given["count"], given["levels"], given["palette"], given["exclude"])


@scenes.command("compare")
@click.argument("first", metavar="A", type=NAME_OR_PATH)
@click.argument("second", metavar="B", type=NAME_OR_PATH)
def compare(first: str, second: str) -> None:
    """List the scenes of the data set A that B also holds, in any colors.

    Scenes are equal also if turned, mirrored or shifted; the list says where only colors differ.
    """
    tasks, known = read_data_set(first).tasks, read_data_set(second).tasks[::-1]
    rows = []
    # The first twin of each form in B counts.
    equal = {fingerprint(task.scene.blocks): task.key for task in known}
    nearly = {colorless(task.scene.blocks): task.key for task in known}
    for task in tasks:
        if twin := equal.get(fingerprint(task.scene.blocks)):
            rows.append((task.key, twin, "equal"))
        elif twin := nearly.get(colorless(task.scene.blocks)):
            rows.append((task.key, twin, "equal but for colors"))
    if rows:
        headings = ("scene of A", "scene of B", "")
        console.print_rows(console.make_console(), headings, rows, numbers=0)
    same = sum(how == "equal" for *_, how in rows)
    near = len(rows) - same
    click.echo(f"of {counted(len(tasks), 'scene')}: {same} equal, {near} equal but for colors")


@scenes.command("complete")
@click.argument("file", type=UserPath())
@console.jobs_option()
@click.option("--out", "-o", type=UserPath(), help="Folder to write.  [default: NAME-set here]")
def complete_set(file: Path, jobs: int, out: Path | None) -> None:
    """Make a data set from scenes that give type, color, position and euler of their blocks.

    FILE is YAML or JSON: a scene, a list, or a mapping with the list `scenes`. Derives dependencies
    from contacts, and layers and levels from those; draws candidates unless they are given. Refuses
    scenes whose blocks overlap, float or fall. Never overwrites its input.
    """
    given = read_given(file)
    folder = out or Path(f"{file.stem}-set")
    files.check_out(folder, files.SCENE_FILES)
    done = _mapped(complete, given, jobs, "Completing")
    if problems := [problem for one in done for problem in one.problems]:
        raise DataError(problems)
    made = [one.scene for one in done if one.scene]
    # Distractors are of the kit if it has all blocks of the scenes.
    kinds = {block.kind for scene in made for block in scene.blocks}
    palette: Palette = "kit" if kinds <= set(PALETTES["kit"]) else "full"
    tasks = [
        AssemblyTask(scene, one.offered or make_candidates(scene, palette=palette))
        for scene, one in zip(made, done, strict=True)
    ]
    command = f"phyblock scenes complete {shlex.quote(file.name)} --out {shlex.quote(folder.name)}"
    card = files.card("completed", name=folder.name, count=len(tasks), command=command)
    files.write_scenes(folder, tasks, card)
    for note in chain.from_iterable(one.notes for one in done):
        click.echo(f"note: {note}")
    for finding in checks.check_set(made):
        click.echo(f"note: scene {finding.where}: {finding.field} {finding.message}")
    click.echo(f"{counted(len(tasks), 'scene')} completed: {console.shown_path(folder)}")
    click.echo(f"Next: phyblock run quick --set dataset.path={shlex.quote(str(folder.resolve()))}")


@scenes.command("verify")
@click.argument("data", metavar="[PATH]", default="phyblock-400", type=NAME_OR_PATH)
@console.jobs_option()
def verify_scenes(data: str, jobs: int) -> None:
    """Check every number of every scene of PATH by geometry and physics.

    PATH is a folder with scenes.jsonl, an official checkout or a bundled set, by default
    phyblock-400.

    Checks contacts, layers, overlaps, gaps, stability of the whole at two time steps and of every
    step, candidates and duplicates. Overlaps and gaps of an official checkout may be 2 mm; other
    sets are also checked for sizes, hidden blocks, parents and checksums. Exits with 1 on failure.
    """
    where = find_data_set(data)
    is_official = not (where / SCENES_FILE).is_file()
    tasks = read_data_set(data).tasks
    names, work = (*checks.CHECKS, "duplicate", "parents"), checks.verify_scene
    if is_official:
        names, work = (*checks.FOREIGN_CHECKS, "duplicate"), checks.verify_foreign
    found = [one for one in checks.check_set([task.scene for task in tasks]) if one.check in names]
    found += chain.from_iterable(_mapped(work, tasks, jobs, "Verifying"))
    failed = Counter(check for _, check in {(one.where, one.check) for one in found})
    rows = [((check,), failed[check], len(tasks)) for check in names]
    summed, changed = (0, ()) if is_official else files.check_sums(where)
    if summed:
        rows.append((("checksums",), len(changed), summed))
    rows.append((("all",), len({one.where for one in found}), len(tasks)))
    _conclude(data, ("check", "passed"), rows, (*found, *changed))


@scenes.command("show")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.argument("scene")
def show_scene(data: str, scene: str) -> None:
    """Show the facts of SCENE in the data set PATH: blocks, layers, dependencies, candidates.

    "on" names the blocks below, "pick" the candidate, "seen" the share visible in the goal picture.
    """
    task = read_data_set(data).task(scene)
    shown, offered = task.scene, task.candidates
    terminal = console.make_console()

    def joined(numbers: Iterable[float]) -> str:
        return " ".join(f"{number:g}" for number in numbers)

    levels, parents = " and ".join(map(str, shown.levels)), ", ".join(shown.parents)
    size = f"{counted(len(shown), 'block')} · {counted(max(shown.graph.layers), 'layer')}"
    heading = f"scene {shown.id} · level {levels} · {size} · made from {parents}"
    terminal.print(heading, soft_wrap=True)
    numbers = (f"{name} {measure(task):.3g}" for name, measure in DIFFICULTY.items())
    terminal.print(f"difficulty: {' · '.join(numbers)}", soft_wrap=True)
    seen = pictures.visible_shares(shown, PictureStyle())
    blocks = [
        (
            *(str(block.order), block.type, block.color),
            " ".join(map(str, sorted(block.depend))) or "ground",
            joined(round(1000 * c, 1) + 0.0 for c in block.position_m),
            joined(block.euler_deg),
            *(str(block.layer), str(offered.index_of(block.look)), f"{seen[block.order]:.0%}"),
        )
        for block in shown.blocks
    ]
    columns = ["block", "type", "color", "on", "position mm", "euler deg", "layer", "pick", "seen"]
    console.print_rows(terminal, columns, blocks, numbers=3)
    looks = Counter(block.look for block in shown.blocks)
    candidates = [
        (str(n), one.type, one.color, joined(one.euler_deg), str(looks[one.look] or ""))
        for n, one in enumerate(offered.candidates, 1)
    ]
    columns = ["candidate", "type", "color", "euler deg", "needed"]
    console.print_rows(terminal, columns, candidates, numbers=1)


@scenes.command("render")
@click.argument("data", metavar="PATH", type=NAME_OR_PATH)
@click.argument("names", metavar="[SCENE]...", nargs=-1)
@click.option("--out", "-o", type=UserPath(file_okay=False), required=True, metavar="DIR")
@click.option("--view", type=click.Choice([*VIEWS, "all"]), default="oblique")
@click.option("--background", type=click.Choice([*BACKGROUNDS, "all"]), default="checkerboard")
@click.option("--composite", is_flag=True, help="Also draw goal and candidates side by side.")
@click.option("--gif", is_flag=True, help="Also draw the assembly as an animated GIF.")
@console.worker_options()
def render(
    data: str,
    names: tuple[str, ...],
    out: Path,
    view: str,
    background: str,
    composite: bool,
    gif: bool,
    shard: tuple[int, int] | None,
    **pool: Any,
) -> None:
    """Draw the scenes SCENE... of the data set PATH, or all of them, at 512 by 512 pixels.

    Files are named SCENE-VIEW-BACKGROUND; earlier ones of this command are overwritten.
    """
    read = read_data_set(data)
    views = [name for name in VIEWS if view in (name, "all")]
    floors = [name for name in BACKGROUNDS if background in (name, "all")]
    drawings: dict[str, Callable[[], bytes]] = {}
    tasks = [*map(read.task, names)] if names else read.tasks
    for task, seen, floor in product(tasks, views, floors):
        style = PictureStyle(512, floor, *VIEWS[seen])
        stem = f"{task.scene.id}-{seen}-{floor}"
        drawings[f"{stem}.png"] = partial(pictures.goal_png, task.scene, style)
        if composite:
            drawings[f"{stem}-composite.png"] = partial(_composite, task, style)
        if gif:
            drawings[f"{stem}.gif"] = partial(pictures.assembly_gif, task.scene, style)
    OutFolder(out).check(drawings)
    digest = hex_digest(repr([pictures.RENDER_VERSION, *drawings]))
    shards = console.open_shards(shard, out, f"scenes render: {read.sha256} {digest}\n")
    with open_workers(**pool, shards=shards) as workers:
        _draw(out, drawings, workers, shards)
    if not console.left_to_first(shards, out):
        click.echo(f"{counted(len(drawings), 'file')} in {console.shown_path(out)}")


def _composite(task: AssemblyTask, style: PictureStyle) -> bytes:
    goal = pictures.goal_png(task.scene, style)
    return pictures.composite_png(goal, pictures.candidates_png(task.candidates, style))


def _draw(
    out: Path, drawings: Mapping[str, Callable[[], bytes]], workers: Workers, shards: Shards | None
) -> None:
    """Draw the named pictures, and write them if this shard is the one that writes."""
    drawn = console.tracked(workers.map(call, drawings.values()), len(drawings), "Drawing")
    for name, picture in zip(drawings, drawn, strict=True):
        if shards is None or shards.writes:
            OutFolder(out).write({name: picture})


# Questions


_about = click.argument("path", metavar="[PATH]", default="phyblock-vqa", type=NAME_OR_PATH)
_data = click.option(
    "--data",
    default="phyblock-400",
    type=NAME_OR_PATH,
    metavar="PATH",
    help="The scenes that the questions are about: a folder or a bundled set.",
)


def _read(path: str, data: str) -> QuestionSet:
    return read_questions(find_questions(path), read_data_set(data))


@questions.command("generate")
@_data
@click.option("--subtasks", callback=_several(SUBTASKS), default="all", metavar="WORDS")
@click.option(
    "--per-subtask", type=click.IntRange(1), metavar="N", help="By default 150, and 100 for PD."
)
@click.option("--pictures", "is_drawn", is_flag=True, help="Also draw them into DIR/pictures.")
@_seed
@console.worker_options()
@_out
def generate_questions(
    data: str,
    subtasks: tuple[Subtask, ...],
    per_subtask: int | None,
    is_drawn: bool,
    seed: int,
    out: Path,
    **workers_options: Any,
) -> None:
    """Make questions with derived answers, and their data card.

    The same arguments and physics engine give the same files, on any Python and with any workers.
    """
    command = f"phyblock questions generate --data {data} --seed {seed} --out {out.name}"
    if len(subtasks) < len(SUBTASKS):
        command += f" --subtasks {','.join(subtasks)}"
    if per_subtask is not None:
        command += f" --per-subtask {per_subtask}"
    if is_drawn:
        command += " --pictures"
    wanted = {subtask: per_subtask or MAKERS[subtask].count for subtask in subtasks}
    read = read_data_set(data)
    work = f"{command}\n{read.sha256}"
    with _making(out, files.QUESTION_FILES, work, **workers_options) as (workers, shards):
        originals = {task.scene.id: task.scene for task in read.tasks}
        made = make_questions(list(originals.values()), wanted, seed, workers, console.tracked)
        shown = [(q.id, one) for q in made if is_drawn for one in q.pictures]
        drawings = {
            f"{files.PICTURES}/{name}-{one.label}.png": partial(question_png, one, PictureStyle())
            for name, one in shown
        }
        _draw(out, drawings, workers, shards)
    if console.left_to_first(shards, out):
        return
    card = files.question_card(out.name, read.name, made, command, has_pictures=is_drawn)
    files.write_questions(out, made, originals, card, list(drawings))
    outcome = f"{counted(len(made), 'question')} in {counted(len(subtasks), 'subtask')}"
    each_s = sum(os.times()[:4]) / len(made)
    click.echo(f"{outcome}, {each_s:.1f} CPU seconds each: {console.shown_path(out)}")


@questions.command("verify")
@_about
@_data
@console.jobs_option()
def verify_questions(path: str, data: str, jobs: int) -> None:
    """Derive every answer of PATH again, from scene, pictures and simulator.

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Exits with 1 if an answer differs, a question is not fair, or a file has changed.
    """
    read = _read(path, data)
    # Questions about one scene are processed together, so that pictures are shared.
    asked = sorted((task.question for task in read.tasks), key=lambda question: question.scene.id)
    problems = zip(asked, _mapped(problem_of, asked, jobs, "Verifying"), strict=True)
    found = [(q, problem) for q, problem in problems if problem]
    counts, failed = (Counter(q.subtask for q in some) for some in (asked, [q for q, _ in found]))
    summed, changed = files.check_sums(read.root)
    rows = [((s, SUBTASK_NAMES[s]), failed[s], counts[s]) for s in SUBTASKS if counts[s]]
    sums = (("", "checksums"), len(changed), summed)
    failures = sorted(f"{question.id}: {problem}" for question, problem in found)
    _conclude(path, ("subtask", "", "derived again"), (*rows, sums), (*failures, *changed))


@questions.command("show")
@click.argument("question")
@click.option("--questions", "path", default="phyblock-vqa", type=NAME_OR_PATH)
@_data
@click.option("--out", type=UserPath(), metavar="FILE", help="Draw the pictures to this PNG.")
def show_question(question: str, path: str, data: str, out: Path | None) -> None:
    """Show QUESTION, an id like sh-001: text, options, answer and evidence.

    With --out, draw its pictures side by side, in the order of the recipe.
    """
    read = _read(path, data)
    by_id = {task.question.id: task.question for task in read.tasks}
    if question not in by_id:
        hint = did_you_mean(question, by_id)
        raise DataError(Problem(str(read.root), "holds no such question", "", question, hint=hint))
    shown = by_id[question]
    terminal = console.make_console()
    for line in (
        f"{shown.id} · {SUBTASK_NAMES[shown.subtask]} · scene {shown.scene.id}",
        f"pictures: {', '.join(picture.label for picture in shown.pictures)}",
        "",
        shown.text,
        *(f"  {letter}. {text}" for letter, text in zip(LETTERS, shown.options, strict=True)),
        "",
        f"answer: {shown.answer_letters}",
        f"evidence: {json.dumps(shown.evidence)}",
    ):
        terminal.print(line, soft_wrap=True)
    if out is not None:
        pngs = (io.BytesIO(question_png(one, PictureStyle())) for one in shown.pictures)
        images = [np.asarray(Image.open(png)) for png in pngs]
        gap = np.full_like(images[0][:, :_GAP_PX], 255)
        sheet = np.hstack([part for image in images for part in (gap, image)][1:])
        write_named(out, pictures.to_png(Image.fromarray(sheet)))
        terminal.print(f"pictures: {console.shown_path(out)}", soft_wrap=True)


@questions.command("audit")
@_about
@_data
def audit(path: str, data: str) -> None:
    """Audit the questions of PATH for ways to answer them without understanding.

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Reports by subtask how often each letter is right and the accuracy of three probes on questions
    about base scenes that they did not learn from: the most frequent answer, the texts alone, and
    simple measures of the pictures. Exits with 0, whatever it finds.
    """
    asked = [task.question for task in _read(path, data).tasks]
    subtasks = len({question.subtask for question in asked})
    audits = list(console.tracked(audit_questions(asked), subtasks, "Auditing"))
    rows = [
        (
            *(one.subtask, SUBTASK_NAMES[one.subtask], str(one.n)),
            *(f"{100 * share:.0f}" for share in (*one.letters, one.chance)),
            *(str(one.probes.get(name, "-")) for name in ("majority", "text", "pictures")),
        )
        for one in audits
    ]
    terminal = console.make_console()
    headings = ("", "subtask", "n", *LETTERS, "chance", "majority", "texts", "pictures")
    console.print_rows(terminal, headings, rows, numbers=9)
    terminal.print(
        "Percent. A to D: how often the letter is right (ordering: comes first). Probes: accuracy "
        "with a 95 % interval."
    )
    for name, probe in ((n, p) for one in audits for n, p in one.probes.items() if "," in n):
        terminal.print(f"{name}: {probe} of {probe.n}")
    findings = [finding for one in audits for finding in one.findings()]
    for finding in findings:
        terminal.print(finding, soft_wrap=True)
    terminal.print(f"{counted(len(asked), 'question')}, {counted(len(findings), 'finding')}")
