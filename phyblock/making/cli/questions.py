"""`phyblock questions`: make, check and show questions about scenes."""

from __future__ import annotations

import io
import json
import os
from collections import Counter
from pathlib import Path

import click
from PIL import Image

from phyblock.cli.console import (
    NAME_OR_PATH,
    UserPath,
    jobs_option,
    left_to_first,
    make_console,
    print_rows,
    shown_path,
    tracked,
)
from phyblock.data.base import QuestionSet
from phyblock.data.lookup import find_questions, read_data_set
from phyblock.data.questions import read_questions
from phyblock.domain.question import LETTERS, SUBTASK_NAMES, SUBTASKS, Subtask
from phyblock.errors import DataError, Problem
from phyblock.files import write_named
from phyblock.making.cli.options import (
    Several,
    begin_set,
    conclude,
    making_options,
    mapped,
    print_engine,
)
from phyblock.making.files import (
    QUESTION_FILES,
    check_sums,
    question_card,
    write_questions,
)
from phyblock.making.questions.audit import Probe, audit_questions
from phyblock.making.questions.production import MAKERS, make_questions, problem_of
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.text import counted, did_you_mean
from phyblock.workers import open_workers

_QUESTIONS = "phyblock-vqa"
_GAP_PX = 8
_argument = click.argument("questions", metavar="[PATH]", default=_QUESTIONS, type=NAME_OR_PATH)
_data_option = click.option(
    "--data",
    default="phyblock-400",
    type=NAME_OR_PATH,
    show_default=True,
    metavar="PATH",
    help="The scenes that the questions are about: a folder or a bundled set.",
)


@click.group("questions")
def questions() -> None:
    """Make, check and show multiple-choice questions about scenes."""


@questions.command("generate")
@_data_option
@click.option("--subtasks", type=Several(SUBTASKS), default="all", show_default=True)
@click.option(
    "--per-subtask",
    type=click.IntRange(1),
    metavar="N",
    help="Questions of each subtask; by default 150, of PD 100.",
)
@making_options
def generate(
    data: str,
    subtasks: tuple[Subtask, ...],
    per_subtask: int | None,
    seed: int,
    jobs: int,
    ray_address: str | None,
    shard: tuple[int, int] | None,
    out: Path,
) -> None:
    """Make questions with derived answers, and their data card.

    The same scenes, subtasks, numbers and seed give the same files with the same physics engine,
    on any Python, any number of processes or a cluster.
    """
    command = f"phyblock questions generate --data {data} --seed {seed} --out {out.name}"
    if len(subtasks) < len(SUBTASKS):
        command += f" --subtasks {','.join(subtasks)}"
    if per_subtask is not None:
        command += f" --per-subtask {per_subtask}"
    wanted = {subtask: per_subtask or MAKERS[subtask].count for subtask in subtasks}
    read = read_data_set(data)
    shards = begin_set(shard, out, QUESTION_FILES, f"{command}\n{read.sha256}")
    originals = {task.scene.id: task.scene for task in read.tasks}
    with open_workers(jobs, ray_address, shards) as workers:
        made = make_questions(list(originals.values()), wanted, seed, workers, tracked)
    if left_to_first(shards, out):
        return
    write_questions(out, made, originals, question_card(out.name, read.name, made, command))
    outcome = f"{counted(len(made), 'question')} in {counted(len(subtasks), 'subtask')}"
    each_s = sum(os.times()[:4]) / len(made)
    click.echo(f"{outcome}, {each_s:.1f} CPU seconds each: {shown_path(out)}")
    print_engine()


@questions.command("verify")
@_argument
@_data_option
@jobs_option()
def verify(questions: str, data: str, jobs: int) -> None:
    """Derive every answer of PATH again, from scene, pictures and simulator.

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Exits with 1 when an answer differs, a question is not fair, or a file has changed.
    """
    read = _read(questions, data)
    # Questions about one scene are processed together, so that pictures are shared.
    asked = sorted((task.question for task in read.tasks), key=lambda question: question.scene.id)
    problems = mapped(problem_of, asked, jobs, "Verifying")
    counts = Counter(question.subtask for question in asked)
    failed = Counter(q.subtask for q, p in zip(asked, problems, strict=True) if p)
    files, changed = check_sums(read.root)
    rows: list[tuple[str, ...]] = [
        (s, SUBTASK_NAMES[s], str(counts[s] - failed[s]), str(counts[s]))
        for s in SUBTASKS
        if counts[s]
    ]
    rows.append(("", "checksums", str(files - len(changed)), str(files)))
    print_rows(make_console(), ("subtask", "", "derived again", "of"), rows, numbers=2)
    failures = [f"{q.id}: {p}" for q, p in zip(asked, problems, strict=True) if p]
    conclude(questions, (*sorted(failures), *changed))


@questions.command("show")
@click.argument("question")
@click.option("--questions", default=_QUESTIONS, type=NAME_OR_PATH, show_default=True)
@_data_option
@click.option("--out", type=UserPath(), metavar="FILE", help="Draw the pictures to this PNG.")
def show(question: str, questions: str, data: str, out: Path | None) -> None:
    """Show QUESTION, an id like sh-001: text, options, answer and evidence.

    With --out, draw its pictures side by side, in the order of the recipe.
    """
    read = _read(questions, data)
    by_id = {task.question.id: task.question for task in read.tasks}
    if question not in by_id:
        hint = did_you_mean(question, by_id)
        raise DataError(Problem(str(read.root), "holds no such question", "", question, hint=hint))
    shown = by_id[question]
    console = make_console()
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
        console.print(line, soft_wrap=True)
    if out is not None:
        style = PictureStyle()
        images = [Image.open(io.BytesIO(question_png(one, style))) for one in shown.pictures]
        step = style.size_px + _GAP_PX
        sheet = Image.new("RGB", (len(images) * step - _GAP_PX, style.size_px), "white")
        for i, image in enumerate(images):
            sheet.paste(image, (i * step, 0))
        file = io.BytesIO()
        sheet.save(file, "PNG")
        write_named(out, file.getvalue())
        console.print(f"pictures: {shown_path(out)}", soft_wrap=True)


def _read(questions: str, data: str) -> QuestionSet:
    return read_questions(find_questions(questions), read_data_set(data))


@questions.command("audit")
@_argument
@_data_option
def audit(questions: str, data: str) -> None:
    """Audit the questions of PATH: could they be answered without understanding?

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Shows by subtask how often each letter is right and the accuracy of three probes on questions
    about base scenes that they did not learn from: the most frequent answer, the texts alone, and
    simple features of the pictures that are options. Exits with 0, whatever it finds.
    """
    asked = [task.question for task in _read(questions, data).tasks]
    subtasks = len({question.subtask for question in asked})
    audits = list(tracked(audit_questions(asked), subtasks, "Auditing"))
    rows = [
        (
            one.subtask,
            SUBTASK_NAMES[one.subtask],
            str(one.n),
            *(f"{100 * share:.0f}" for share in one.letters),
            f"{100 * one.chance:.0f}",
            *(_shown(one.probes.get(name)) for name in ("majority", "text", "pictures")),
        )
        for one in audits
    ]
    console = make_console()
    headings = ("", "subtask", "n", *LETTERS, "chance", "majority", "texts", "pictures")
    print_rows(console, headings, rows, numbers=9)
    console.print(
        "Percent. A to D: how often the letter is right (ordering: comes first). Probes: accuracy "
        "with a 95 % interval."
    )
    for name, probe in ((n, p) for one in audits for n, p in one.probes.items() if "," in n):
        console.print(f"{name}: {_shown(probe)} of {probe.n}")
    findings = [finding for one in audits for finding in one.findings()]
    for finding in findings:
        console.print(finding, soft_wrap=True)
    console.print(f"{counted(len(asked), 'question')}, {counted(len(findings), 'finding')}")


def _shown(probe: Probe | None) -> str:
    if probe is None:
        return "-"
    low, high = probe.interval
    return f"{100 * probe.accuracy:.0f} [{100 * low:.0f}, {100 * high:.0f}]"
