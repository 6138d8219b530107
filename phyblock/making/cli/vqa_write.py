"""`phyblock questions write`: further wordings from a model, checked, into a file for review."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from contextlib import AsyncExitStack
from pathlib import Path

import click

from phyblock.cli.console import make_console, may_spend, shown_path
from phyblock.cli.options import UserPath, models_file_option, yes_option
from phyblock.config.models import ModelConfig, load_models
from phyblock.config.suite import Suite
from phyblock.domain import Question, Subtask
from phyblock.errors import DataError, Problem, SpecError
from phyblock.files import check_free, make_folder, write_named
from phyblock.making.cli.question_sets import data_option, questions_option, read_question_set
from phyblock.making.cli.subtasks_option import subtasks_option
from phyblock.making.cli.working import seed_option
from phyblock.making.questions.rewording import Paraphrase, stems_of, write_wordings
from phyblock.models import ReplyCache, build_model, is_billed
from phyblock.models.litellm_client import be_quiet
from phyblock.resources import bundled, reply_cache_file
from phyblock.run.models import to_config
from phyblock.run.preflight import find_models_file
from phyblock.text import counted, did_you_mean
from phyblock.tracks import TemplatePrompt

__all__ = ["command"]

_AT_ONCE = 8


@click.command("write")
@click.option("--model", "name", required=True, metavar="NAME", help="A model of models.yaml.")
@questions_option
@data_option
@subtasks_option
@click.option(
    *("--count", "count"),
    type=click.IntRange(1, 20),
    default=4,
    show_default=True,
    metavar="N",
    help="Paraphrases asked for, of each kind of question.",
)
@click.option(
    "--checks",
    type=click.IntRange(1, 10),
    default=2,
    show_default=True,
    metavar="N",
    help="Questions that each paraphrase is checked with.",
)
@seed_option("Another seed asks for other wordings.")
@click.option(
    "--out",
    type=UserPath(dir_okay=False),
    required=True,
    metavar="FILE",
    help="JSON Lines for review.",
)
@models_file_option
@click.option("--no-cache", is_flag=True, help="Neither read nor write the reply cache.")
@yes_option
def command(
    name: str,
    questions: str,
    data: str,
    subtasks: tuple[Subtask, ...],
    count: int,
    checks: int,
    seed: int,
    out: Path,
    models_file: str | None,
    no_cache: bool,
    yes: bool,
) -> int:
    """Ask a model for further wordings of questions, and check what they mean.

    Accepts a paraphrase when its slots are intact, when the answers of questions asked in it can be
    derived again, and when the model finds these answers. Writes every paraphrase to the file, with
    the reason where it is not accepted. Nothing is used before a person has read it.
    """
    config = _config(name, models_file)
    check_free([out], "name another file")
    make_folder(out.parent)
    asked = [task.question for task in read_question_set(questions, data).tasks]
    stems = stems_of([question for question in asked if question.subtask in subtasks])
    if not stems:
        message = "holds no question of these subtasks in a known wording"
        raise DataError(Problem(questions, message))
    console = make_console()
    most = counted(len(stems) * (1 + count * checks), "call")
    billed = [name] if is_billed(config) and not yes else []
    if not may_spend(billed, lambda: console.print(f"{name} may bill up to {most}.")):
        console.print("Nothing was asked.")
        return 1
    prompt = TemplatePrompt(bundled("prompts", "vqa_write.j2"), "vqa_write")
    asking = _ask(config, prompt, stems, count, checks, seed, use_cache=not no_cache)
    paraphrases = asyncio.run(asking)
    lines = [paraphrase.line(name, number) for number, paraphrase in _numbered(paraphrases)]
    write_named(out, "".join(line + "\n" for line in lines))
    accepted = sum(paraphrase.fault is None for paraphrase in paraphrases)
    written = counted(len(paraphrases), "paraphrase")
    summary = f"{written}, {accepted} accepted, in {shown_path(out)}"
    console.print(f"{summary}; read them before they are used")
    return 0


def _config(name: str, models_file: str | None) -> ModelConfig:
    known = load_models(find_models_file(models_file, None))
    if name not in known:
        hint = did_you_mean(name, list(known)) or "list them: phyblock models"
        raise SpecError(Problem("--model", "is not in the models file", "", name, hint=hint))
    return to_config(name, known[name], Suite(name="write", models=(name,)))


async def _ask(
    config: ModelConfig,
    prompt: TemplatePrompt,
    stems: Mapping[str, Sequence[Question]],
    count: int,
    checks: int,
    seed: int,
    *,
    use_cache: bool,
) -> list[Paraphrase]:
    tell = make_console(stderr=True).print
    async with AsyncExitStack() as stack:
        cache = None
        if use_cache:
            cache = stack.enter_context(ReplyCache(reply_cache_file(), tell))
        be_quiet()
        model = build_model(config, cache=cache, overall=asyncio.Semaphore(_AT_ONCE), tell=tell)
        stack.push_async_callback(model.aclose)
        by_stem = await asyncio.gather(
            *(
                write_wordings(model, prompt, stem, questions, count, checks, seed)
                for stem, questions in stems.items()
            )
        )
    return [paraphrase for of_stem in by_stem for paraphrase in of_stem]


def _numbered(paraphrases: Sequence[Paraphrase]) -> list[tuple[int, Paraphrase]]:
    """Each with its number inside its stem, from 1."""
    counts: dict[str, int] = {}
    numbered = []
    for paraphrase in paraphrases:
        counts[paraphrase.stem] = counts.get(paraphrase.stem, 0) + 1
        numbered.append((counts[paraphrase.stem], paraphrase))
    return numbered
