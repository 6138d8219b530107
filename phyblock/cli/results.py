"""The commands that read finished runs; each imports what it needs when it is called."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from phyblock.cli import console as ui
from phyblock.errors import DataError, Problem, SpecError, StoreError
from phyblock.results.text import REPORT_FILE, TABLES
from phyblock.text import counted, one_line, some_of

if TYPE_CHECKING:
    from phyblock.records.record import Record


@click.command()
@ui.run_argument
@click.option("--print", "prints", is_flag=True, help="Print all tables; write nothing.")
@click.option("--only", "names", multiple=True, metavar="NAME", help="Print only this table.")
@click.option(
    *("--format", "form"),
    type=click.Choice(["text", "md", "tex"]),
    default="text",
    help="Form of printed tables.",
)
@ui.data_option
def report(run: Path, prints: bool, names: tuple[str, ...], form: str, data: Path | None) -> None:
    """Write tables and report.html of the folder RUN again, or print its tables.

    Uses only the files of the run: no model, no network. Draws scenes if their data are there.
    """
    console = ui.make_console()
    if not (prints or names or form != "text"):
        ui.print_path(console, show_tables(run, data))
        return
    from phyblock.results.load import load_run
    from phyblock.results.tables import make_tables, table_names
    from phyblock.results.text import to_latex, to_markdown

    loaded = load_run(run)
    _check_names(run, names, table_names(loaded), "table")
    if not (tables := make_tables(loaded, names or table_names(loaded))):
        console.print("The run has no numbers for this table.")
    for name, table in tables.items():
        if form == "text":
            ui.print_table(console, table)
        else:
            click.echo(to_markdown(table) if form == "md" else to_latex(table, f"phyblock-{name}"))


def _check_names(run: Path, names: Sequence[str], known: Iterable[str], noun: str) -> None:
    if unknown := [name for name in names if name not in set(known)]:
        found, allowed = ", ".join(unknown), ", ".join(known)
        raise SpecError(Problem(str(run), f"has no such {noun}", "--only", found, allowed))


def show_tables(folder: Path, data: Path | None = None, *, page: bool = True) -> Path:
    """Write a run's tables and page, and print the summary; return the path of page or tables."""
    from phyblock.results.tables import summary_of, write_tables

    written = write_tables(folder)
    console, (tables, blind, failures) = ui.make_console(), summary_of(written.run)
    for table in tables:
        ui.print_table(console, table)
    for model, message, times in failures[:4]:
        console.print(one_line(f"{times:,} x {model}: {message}"), style="yellow")
    for sentence in blind:
        console.print(sentence)
    if page:
        from phyblock.web.pages import write_report

        write_report(written, data)
    return folder / (REPORT_FILE if page else TABLES)


@click.command()
@ui.run_argument
@click.argument("sample")
@ui.data_option
def show(run: Path, sample: str, data: Path | None) -> None:
    """Show SAMPLE of the folder RUN: prompt, reply, parsed answer, and the verdict of each step.

    SAMPLE is an id as in records.jsonl (TRACK/MODEL/ITEM/sSEED), or any unique part of it.
    """
    from phyblock.records.files import RECORDS, newest_starts, read_manifest, run_records
    from phyblock.registry import known_track
    from phyblock.run.rescore import recorded_dataset
    from phyblock.tracks.base import as_recorded

    lines = run_records(run)
    starts = newest_starts(lines)
    matching = [sample] if sample in starts else [name for name in starts if sample in name]
    if len(matching) != 1:
        message, allowed = f"{len(matching):,} samples fit", some_of(matching or list(starts))
        raise StoreError(Problem(str(run / RECORDS), message, "sample", sample, allowed))
    record = next(iter(lines.at([starts[matching[0]]])))
    console = ui.make_console()
    console.print(record.sample, style="bold")
    facts = [f"scene {record.scene}", f"level {', '.join(map(str, record.levels))}"]
    facts += [counted(record.n_blocks, "block"), record.outcome.replace("_", " ")]
    facts += [f"{factor} {level}" for factor, level in record.variant.items()]
    console.print(" · ".join(facts))
    _print_prompt(console, run, record)
    console.print("\nReply", style="bold")
    if record.error is not None:
        console.print(f"{record.error.kind}: {record.error.message}", style="red")
    turns = [turn.reply for turn in record.asked_turns]
    for number, reply in enumerate(turns or record.replies, 1):
        if reply.reasoning:
            console.print(reply.reasoning, style="dim")
        console.print((f"{number}. " if turns else "") + (reply.text or "(empty)"))
        facts = [reply.finish]
        if reply.usage.completion_tokens:
            facts.append(counted(reply.usage.completion_tokens, "token"))
        facts.append("cost unknown" if reply.cost_usd is None else f"${reply.cost_usd:.4f}")
        facts.append("from the cache" if reply.cached else f"{reply.latency_s:.1f} s")
        console.print(" · ".join(facts), style="dim")
    console.print("\nRead", style="bold")
    parser = getattr(record.parse, "rule", None)
    console.print((record.parsed_text or "nothing") + (f" (rule {parser})" if parser else ""))
    if record.is_correct is not None:
        verdict = "right" if record.is_correct else f"wrong: the answer is {record.target}"
        console.print(verdict, style="green" if record.is_correct else "red")
    if (course := record.course("")) is None:
        return
    try:
        dataset = recorded_dataset(run, read_manifest(run), data)
        task = as_recorded(dataset.task(record.scene), record)
        blocks = enumerate(task.candidates.candidates, 1)
        names = ", ".join(f"{n} {one.color} {one.type}" for n, one in blocks)
        places = (task.candidates.index_of(block.look) for block in task.scene.blocks)
        needed = ", ".join("none" if place is None else str(place) for place in places)
        console.print(f"Candidates: {names}\nGoal: {needed}\n", style="dim")
    except DataError as error:
        console.print(f"Names of blocks are not shown: {error}\n", style="dim")
    heading = known_track(record.track).report().heading
    for n, (name, why) in enumerate(course.steps, 1):
        step = f"block {name}" if name.isdecimal() else name
        verdict = "right" if why is None else heading(why)
        console.print(one_line(f"{n}. {step}: {verdict}"), style="red" if why else "green")
    end = f"{record.n_blocks - course.missing} of {counted(record.n_blocks, 'block')} placed"
    console.print(end + (f"; ended: {heading(course.ending)}" if course.ending else ""))


def _print_prompt(console: Console, run: Path, record: Record) -> None:
    """Print the prompt (of an episode the first), with labels and sizes of pictures."""
    from phyblock.records.files import PromptLines

    if record.prompt is None:
        return
    console.print(f"\nPrompt ({record.prompt.template})", style="bold")
    prompts = (line for _, line in PromptLines(run) if line.sha256 == record.prompt.messages)
    for message in (message for line in prompts for message in line.messages):
        for part in message.parts:
            text = part if isinstance(part, str) else f"(picture {part.image})"
            console.print(f"{message.role}: {text}")
    for image in record.prompt.images:
        size = f"{image.width_px} x {image.height_px}"
        console.print(f"picture {image.label}, {size} pixels, {image.sha256[:12]}", style="dim")


@click.command()
@ui.run_argument
@click.argument("other", type=ui.UserPath(), required=False)
@ui.models_option("Only these models; of two runs, A of the first.")
@click.option("--track", metavar="NAME", default="", show_default="the first in both")
@click.option("--measure", metavar="NAME", default="", show_default="the headline measure")
@click.option("--out", type=ui.UserPath(), metavar="DIR", help="Folder for CSV, Markdown, LaTeX.")
def compare(
    run: Path, other: Path | None, models: Sequence[str], track: str, measure: str, out: Path | None
) -> None:
    """Compare the models of the folder RUN with one another, or those of RUN with OTHER's.

    Pairs samples of the same scene or question and seed, and tests them by a t test that accounts
    for scenes that share base scenes. Shows p values with Holm's correction, and the difference
    that each test could have detected.
    """
    from phyblock.results.compare import compare_view, ranks_view, write_comparison
    from phyblock.results.load import load_run

    beside = None if other is None else load_run(other)
    comparison = load_run(run).compare(beside, models, track, measure)
    console = ui.make_console()
    ui.print_table(console, compare_view(comparison))
    if len(comparison.table[["a", "b"]].drop_duplicates()) > 1 and len(comparison.ranks):
        ui.print_table(console, ranks_view(comparison))
    if out is not None:
        write_comparison(comparison, out)
        ui.print_path(console, out)


@click.command()
@ui.run_argument
@click.option("--only", "names", multiple=True, metavar="NAME", help="Only this one; repeatable.")
@click.option(
    "--width",
    type=click.FloatRange(60, 400),
    default=178,
    metavar="MM",
    help="Width in millimeters; a column of a two-column paper has 85.",
)
@click.option("--no-title", is_flag=True, help="Leave the title to the caption.")
@click.option("--out", type=ui.UserPath(), metavar="DIR", help="Folder. [default: RUN/paper]")
def figures(
    run: Path, names: tuple[str, ...], width: float, no_title: bool, out: Path | None
) -> None:
    """Draw figures of the folder RUN for a paper: PDF and SVG with real text, PNG, captions.

    Draws all figures that the run has numbers for, or those named with --only.
    """
    from phyblock.results.figures import figures_of, write_paper_figures
    from phyblock.results.load import load_run

    loaded, console = load_run(run), ui.make_console()
    _check_names(run, names, figures_of(loaded), "figure")
    drawn = write_paper_figures(loaded, names, out, width_in=width / 25.4, titled=not no_title)
    for file in drawn:
        ui.print_path(console, file)
    if not drawn:
        console.print("The run has no numbers for any figure.")


@click.command()
@ui.run_argument
@click.option("--out", type=ui.UserPath(), metavar="FILE", help="[default: RUN/bundle.zip]")
def bundle(run: Path, out: Path | None) -> None:
    """Write the folder RUN as one file: manifest, records, digests.

    Contains replies and sampling parameters, but no keys, pictures, prompts or server addresses,
    and only the last part of local paths. `phyblock verify` scores it again.
    """
    from phyblock.bundle import bundle_run

    console = ui.make_console()
    path = bundle_run(run, out)
    console.print(f"{path.stat().st_size / 1000:,.0f} kB:")
    ui.print_path(console, path)


@click.command()
@click.argument("file", type=ui.UserPath())
@ui.data_folders_option
def verify(file: Path, data: tuple[Path, ...]) -> None:
    """Score the replies in the bundle FILE again, and report if its records are the same bytes,
    what was not verified, and if samples are missing. Exits with 2 if the records differ.

    Calls no model. A bundle contains no data set: bundled sets are found; name others with --data.
    """
    from phyblock.bundle import opened_bundle

    console = ui.make_console()
    with opened_bundle(file, data) as verified:
        console.print(f"{ui.shown_path(file)} verifies.")
        samples = f"{verified.records:,} of {verified.expected:,} expected samples"
        is_whole = verified.records == verified.expected
        console.print(f"{samples}." if is_whole else f"{samples}: the run is not complete.")
        models = counted(len(verified.manifest.models), "model")
        records = counted(verified.records, "record")
        console.print(f"{records} of {models}, scored again, are the same bytes.")
        console.print(f"Run {verified.manifest.run}, made with phyblock {verified.phyblock}.")
        console.print("Not verified:")
        for sentence in verified.unverified:
            console.print(f"* {sentence}")


@click.command()
@click.argument("runs", nargs=-1, required=True, type=ui.UserPath())
@click.option("--out", type=ui.UserPath(), required=True, metavar="DIR", help="Folder of the site.")
@ui.data_folders_option
@click.option("--title", default="PhyBlock leaderboard", help="Its title.")
def site(runs: tuple[Path, ...], out: Path, data: tuple[Path, ...], title: str) -> None:
    """Write RUNS, folders and bundles, as one static folder: ranks, models, scenes and samples.

    The folder opens from disk or from any web server. Runs must use one version of the data and one
    prompt. Bundles are scored again first, and those that do not verify are refused.
    """
    from phyblock.web.pages import write_site

    console = ui.make_console()
    made = write_site(runs, out, data, title)
    if made.lacking:
        console.print(made.lacking)
    console.print(f"{made.models:,} models and baselines, {counted(made.samples, 'sample')}:")
    ui.print_path(console, made.path)
