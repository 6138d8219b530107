"""`phyblock questions`: make questions about scenes, check them, look at them."""

from __future__ import annotations

import io
import json
from collections import Counter
from pathlib import Path

import click
from PIL import Image
from rich.progress import Progress, TaskID

from phyblock.cli.console import make_console, print_rows, shown_path
from phyblock.cli.options import UserPath
from phyblock.data import QuestionSet, read_data_set
from phyblock.domain import LETTERS, SUBTASK_NAMES, SUBTASKS, Question, Subtask
from phyblock.errors import DataError, Problem
from phyblock.files import write_named
from phyblock.making.cli.options import (
    data_option,
    jobs_option,
    questions_argument,
    questions_option,
    ray_option,
    read_question_set,
    seed_option,
    size_option,
    subtasks_option,
    tell_simulators,
    tracked,
)
from phyblock.making.questions.audit import Probe, audit_questions
from phyblock.making.questions.production import (
    PER_SUBTASK,
    check_place,
    make_questions,
    verify_questions,
    write_questions,
)
from phyblock.making.scenes.files import check_sums
from phyblock.making.workers import open_workers
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.text import counted, did_you_mean


@click.group("questions")
def questions() -> None:
    """Make multiple-choice questions about scenes, check them, and look at them."""


@questions.command("generate")
@data_option
@subtasks_option
@click.option(
    "--per-subtask",
    type=click.IntRange(1),
    metavar="N",
    help="Questions of each subtask; by default 150, of ordering and affordance 50.",
)
@seed_option("Another seed gives other questions.")
@jobs_option
@ray_option
@click.option("--out", type=UserPath(), required=True, metavar="DIR", help="Folder to write.")
@click.option("--replace", is_flag=True, help="Replace questions that are in the folder.")
def generate(
    data: str,
    subtasks: tuple[Subtask, ...],
    per_subtask: int | None,
    seed: int,
    jobs: int,
    ray_address: str | None,
    out: Path,
    replace: bool,
) -> None:
    """Make questions, each with an answer that is derived, and their data card.

    The same scenes, subtasks, numbers and seed give the same files with the same physics engine,
    on any Python, any number of processes or a cluster.
    """
    check_place(out, replace)
    wanted = {subtask: per_subtask or PER_SUBTASK.get(subtask, 150) for subtask in subtasks}
    read = read_data_set(data)
    scenes = [task.scene for task in read.tasks]
    console = make_console(stderr=True)
    with (
        open_workers(jobs, ray_address) as workers,
        Progress(console=console, transient=True, disable=not console.is_terminal) as progress,
    ):
        bars: dict[Subtask, TaskID] = {}

        def report(subtask: Subtask, total: int) -> None:
            if subtask not in bars:
                if not console.is_terminal:
                    click.echo(f"drafting {subtask} from {counted(total, 'scene')}", err=True)
                bars[subtask] = progress.add_task(f"drafting {subtask}", total=total)
            progress.advance(bars[subtask])

        questions = list(make_questions(scenes, wanted, seed, workers, report))
    made_by = f"phyblock questions generate --data {data} --seed {seed} --out {out.name}"
    if len(subtasks) < len(SUBTASKS):
        made_by += f" --subtasks {','.join(subtasks)}"
    if per_subtask is not None:
        made_by += f" --per-subtask {per_subtask}"
    originals = {scene.id: scene for scene in scenes}
    write_questions(out, questions, originals, read.name, made_by)
    outcome = f"{counted(len(questions), 'question')} in {counted(len(subtasks), 'subtask')}"
    click.echo(f"{outcome}: {shown_path(out)}")
    tell_simulators()


@questions.command("verify")
@questions_argument
@data_option
@jobs_option
@ray_option
def verify(questions: str, data: str, jobs: int, ray_address: str | None) -> None:
    """Derive every answer of PATH again, from scene, pictures and simulator.

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Exits with 1 when an answer differs, or a question is not fair.
    """
    read = read_question_set(questions, data)
    asked = [task.question for task in read.tasks]
    good: Counter[str] = Counter()
    failures: list[str] = []
    with open_workers(jobs, ray_address) as workers:
        verified = verify_questions(asked, workers)
        for question, problem in tracked(verified, len(asked), "Verifying", "questions"):
            good[question.subtask] += problem is None
            if problem is not None:
                failures.append(f"{question.id}: {problem}")
    files, changed = check_sums(read.root)
    failures += map(str, changed)
    rows: list[tuple[str, ...]] = [
        (s, SUBTASK_NAMES[s], str(good[s]), str(sum(q.subtask == s for q in asked)))
        for s in SUBTASKS
        if any(q.subtask == s for q in asked)
    ]
    rows.append(("", "checksums", str(files - len(changed)), str(files)))
    console = make_console()
    print_rows(console, ("subtask", "", "derived again", "of"), rows, numbers=2)
    for failure in sorted(failures):
        click.echo(f"failed: {failure}", err=True)
    verdict = counted(len(failures), "failure") if failures else "all answers derived again"
    summary = f"{questions}: {sum(good.values())} of {counted(len(asked), 'question')}, {verdict}"
    console.print(summary, markup=False, soft_wrap=True)
    if failures:
        raise click.exceptions.Exit(1)


_GAP_PX = 8


@questions.command("show")
@click.argument("question")
@questions_option
@data_option
@click.option("--out", type=UserPath(), metavar="FILE", help="Draw the pictures to this PNG.")
@size_option
@click.option("--blind", is_flag=True, help="Leave out answer and evidence.")
def show(
    question: str, questions: str, data: str, out: Path | None, size: int, blind: bool
) -> None:
    """Show QUESTION, an id like sh-001: text, options, answer and evidence.

    With --out, draw its pictures side by side, in the order of the recipe.
    """
    shown = _find(read_question_set(questions, data), question)
    console = make_console()
    labels = ", ".join(picture.label for picture in shown.pictures)
    lines = [
        f"{shown.id} · {SUBTASK_NAMES[shown.subtask]} · scene {shown.scene.id}",
        f"pictures: {labels}",
        "",
        shown.text,
        *(f"  {letter}. {text}" for letter, text in zip(LETTERS, shown.options, strict=True)),
    ]
    if not blind:
        lines += ["", f"answer: {shown.answer_letters}"]
        lines.append(f"evidence: {json.dumps(shown.evidence)}")
    for line in lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        write_named(out, _side_by_side(shown, PictureStyle(size)))
        console.print(f"pictures: {shown_path(out)}", markup=False, soft_wrap=True)


def _find(questions: QuestionSet, name: str) -> Question:
    by_id = {task.question.id: task.question for task in questions.tasks}
    if name not in by_id:
        message, hint = "holds no such question", did_you_mean(name, by_id)
        raise DataError(Problem(str(questions.root), message, "", name, hint=hint))
    return by_id[name]


def _side_by_side(question: Question, style: PictureStyle) -> bytes:
    images = [Image.open(io.BytesIO(question_png(one, style))) for one in question.pictures]
    width = len(images) * (style.size_px + _GAP_PX) - _GAP_PX
    sheet = Image.new("RGB", (width, style.size_px), "white")
    for i, image in enumerate(images):
        sheet.paste(image, (i * (style.size_px + _GAP_PX), 0))
        image.close()
    file = io.BytesIO()
    sheet.save(file, "PNG")
    return file.getvalue()


@questions.command("audit")
@questions_argument
@data_option
@click.option("--no-text-probe", is_flag=True, help="Leave out the text probe (scikit-learn).")
@click.option("--no-pictures", is_flag=True, help="Leave out the probe that looks at pictures.")
def audit(questions: str, data: str, no_text_probe: bool, no_pictures: bool) -> None:
    """Audit the questions of PATH: could they be answered without understanding?

    PATH is a folder with questions.jsonl or a bundled set, by default the built-in phyblock-vqa.
    Shows by subtask how often each letter is right and the accuracy of three probes on questions
    about base scenes that they did not learn from: the most frequent answer, the texts alone, and
    simple features of the pictures that are options. Exits with 0, whatever it finds.
    """
    asked = [task.question for task in read_question_set(questions, data).tasks]
    subtasks = len({question.subtask for question in asked})
    audits = list(
        tracked(
            audit_questions(asked, with_texts=not no_text_probe, with_pictures=not no_pictures),
            subtasks,
            "Auditing",
            "subtasks",
        )
    )
    rows = [
        (
            one.subtask,
            SUBTASK_NAMES[one.subtask],
            str(one.n),
            str(one.base_scenes),
            *(f"{100 * one.letters[letter] / one.n:.0f}" for letter in LETTERS),
            f"{100 * one.chance:.0f}",
            *map(_shown, (one.majority, one.text, one.pictures)),
        )
        for one in audits
    ]
    console = make_console()
    headings = ("", "subtask", "n", "base scenes", *LETTERS)
    probes = ("chance", "majority", "texts", "pictures")
    print_rows(console, (*headings, *probes), rows, numbers=10)
    console.print(
        "Percent. A to D: how often the letter is right (ordering: comes first). Probes: accuracy "
        "with a 95 % interval.",
        style="dim",
    )
    findings = [finding for one in audits for finding in one.findings()]
    for finding in findings:
        console.print(finding, markup=False, soft_wrap=True)
    verdict = counted(len(findings), "finding") if findings else "no findings"
    console.print(f"{counted(len(asked), 'question')}, {verdict}", markup=False)


def _shown(probe: Probe | None) -> str:
    if probe is None:
        return "-"
    low, high = probe.interval
    return f"{100 * probe.accuracy:.0f} [{100 * low:.0f}, {100 * high:.0f}]"
