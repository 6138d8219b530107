"""Further wordings of questions, written by a model and held against answers that are known.

A model is asked for paraphrases of a wording with its slots, such as `{block}`. One is accepted
when its slots are those of the original, each as often; when it is new; when a question of the set,
asked in it with that question's own slots, has the answer derived again from the scene
(`problem_of`); and when the model itself, told what the original question is and what its right
answer is, finds that same answer for the paraphrase among options in another order, one of which
says that something else is asked. Nothing that is accepted is used before a person has read it.
"""

from __future__ import annotations

import json
import re
import string
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import StrictBool

from phyblock.data.base import lines_of, parse_json, read_text
from phyblock.data.scenes import Name
from phyblock.domain import LETTERS, Question, Subtask, is_picture_option
from phyblock.errors import DataError, Problem
from phyblock.files import load_json
from phyblock.making.questions.draft import WORDINGS, fill_template, pick, stem_of, wording_ids
from phyblock.making.questions.production import problem_of
from phyblock.models import Message, Model, Request
from phyblock.parsing.answer import parse_answer
from phyblock.records.line import Fault, Line, refuse, shown, validated
from phyblock.tracks import TemplatePrompt

_LENGTHS = (15, 400)
_SHOWN_CHARS = 200
_LETTERS = "ABCDE"
_ELSE = "something else is asked, or it cannot be told"
_LETTER = re.compile(r"\boptions?\b|\b[A-D]\)|\([A-D]\)|answer:", re.IGNORECASE)


@dataclass(frozen=True)
class Paraphrase:
    """A wording that a model wrote; `fault` says why it is not accepted, None where it is."""

    stem: str
    subtask: Subtask
    template: str
    fault: str | None
    checked_with: tuple[str, ...] = ()

    def line(self, model: str, number: int) -> str:
        """As one line of JSON, without its end."""
        fields = {
            "wording": f"{self.stem}-m{number}",
            "subtask": self.subtask,
            "template": self.template,
            "accepted": self.fault is None,
            "fault": self.fault,
            "checked_with": list(self.checked_with),
            "model": model,
        }
        return json.dumps(fields, ensure_ascii=False)


def stems_of(questions: Sequence[Question]) -> dict[str, list[Question]]:
    """Questions by the stem of their wording (`rp-corner` of `rp-corner-2`), known ones alone."""
    by_stem: dict[str, list[Question]] = {}
    for question in questions:
        if question.wording in WORDINGS:
            by_stem.setdefault(stem_of(question.wording), []).append(question)
    return by_stem


def fault_of_form(template: str, originals: Sequence[str]) -> str | None:
    """Return the fault of a text as a wording in the form of the originals, or None."""
    try:
        slots = _slots(template)
    except ValueError as error:
        return f"its braces are broken: {error}"
    wanted = _slots(originals[0])
    if slots != wanted:
        held = ", ".join(sorted(slots.elements())) or "none"
        return f"its slots are {held}, not {', '.join(sorted(wanted.elements())) or 'none'}"
    if not _LENGTHS[0] <= len(template) <= _LENGTHS[1] or "\n" in template:
        return "it is no single sentence or two"
    if not template.rstrip().endswith(("?", ".")):
        return "it does not end as a question"
    if _LETTER.search(template):
        return "it speaks of options or letters"
    if _plain(template) in map(_plain, originals):
        return "it is not new"
    return None


async def write_wordings(
    model: Model,
    prompt: TemplatePrompt,
    stem: str,
    questions: Sequence[Question],
    count: int,
    checks: int,
    seed: int,
) -> list[Paraphrase]:
    """Ask for `count` paraphrases of a stem's wordings and check each with `checks` questions.

    A reply that is no list of texts is one paraphrase with that fault: the cache would give it
    again, and what was written for other stems counts. Raises what models raise.
    """
    originals = [WORDINGS[name] for name in wording_ids(stem)]
    facts: dict[str, object] = {"originals": originals, "count": count}
    facts["slots"] = [f"{{{name}}}" for name in sorted(_slots(originals[0]))]
    text = await _ask(model, prompt, "user", facts, f"write-{stem}", seed, questions[0])
    subtask = questions[0].subtask
    texts = texts_in(text)
    if texts is None:
        shown = " ".join(text.split())[:_SHOWN_CHARS]
        return [Paraphrase(stem, subtask, shown, "the reply holds no JSON list of texts")]
    paraphrases: list[Paraphrase] = []
    for template in texts:
        fault = fault_of_form(template, [*originals, *(one.template for one in paraphrases)])
        chosen = _chosen(questions, checks, seed)
        for question in chosen if fault is None else ():
            fault = fault or await _fault_of_meaning(model, prompt, template, question, seed)
        names = tuple(question.id for question in chosen)
        paraphrases.append(Paraphrase(stem, subtask, template, fault, names))
    return paraphrases


async def _fault_of_meaning(
    model: Model, prompt: TemplatePrompt, template: str, question: Question, seed: int
) -> str | None:
    """Return the difference in meaning of a paraphrase, by a question whose answer is known."""
    slots: Mapping[str, str] = question.evidence.get("slots", {})
    text = fill_template(template, slots)
    asked = replace(question, text=text, wording=f"{stem_of(question.wording)}-m0")
    problem = problem_of(asked)
    if problem is not None:
        return f"filled as {question.id}: {problem}"
    words = _words(question)
    truth = words[0 if question.subtask == "OR" else question.answer[0]]
    rng = np.random.default_rng([seed, *_plain(template).encode()])
    options = [*(words[int(place)] for place in rng.permutation(len(words))), _ELSE]
    facts: dict[str, object] = {
        "original": question.text,
        "truth": truth,
        "paraphrase": asked.text,
        "options": list(zip(_LETTERS, options, strict=True)),
    }
    name = f"check-{question.id}-{_plain(template)}"
    reply = await _ask(model, prompt, "check", facts, name, seed, asked)
    given = parse_answer(reply, options, False).letters
    right = _LETTERS[options.index(truth)]
    if given != right:
        return f"filled as {question.id}: the model answers {given or 'nothing'}, not {right}"
    return None


def _words(question: Question) -> list[str]:
    """The options in words: pictures by their letters; of ordering the right order comes first."""
    if question.subtask == "OR":
        turned = [question.answer[i:] + question.answer[:i] for i in range(len(LETTERS))]
        return ["the order " + ", ".join(LETTERS[i] for i in order) for order in turned]
    letters = zip(LETTERS, question.options, strict=False)
    return [f"picture {x}" if is_picture_option(option) else option for x, option in letters]


async def _ask(
    model: Model,
    prompt: TemplatePrompt,
    block: str,
    facts: Mapping[str, object],
    key: str,
    seed: int,
    question: Question,
) -> str:
    messages = (Message("user", (prompt.text(block, facts),)),)
    reply = await model.ask(Request(key, seed, messages, {}, prompt.version, question))
    return "" if reply is None else reply.text


def texts_in(reply: str) -> list[str] | None:
    """The texts of the JSON list in a reply; None where there is none."""
    start, end = reply.find("["), reply.rfind("]")
    try:
        texts = load_json(reply[start : end + 1]) if 0 <= start < end else None
    except ValueError:
        texts = None
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        return None
    return [" ".join(text.split()) for text in texts]


def _chosen(questions: Sequence[Question], checks: int, seed: int) -> list[Question]:
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(questions))[:checks]
    return [questions[int(place)] for place in order]


def _slots(template: str) -> Counter[str]:
    """Count each slot of a template; ValueError for broken braces.

    With a conversion or a format, such as `block!r`, it is another slot.
    """
    counts: Counter[str] = Counter()
    for _, name, form, conversion in string.Formatter().parse(template):
        if name is not None:
            counts[
                f"{name}{'!' + conversion if conversion else ''}{':' + form if form else ''}"
            ] += 1
    return counts


def _plain(text: str) -> str:
    return re.sub(r"[^a-z{}]+", " ", text.lower()).strip()


_ALLOWED = "a file that phyblock questions write wrote"


class _StoredWording(Line, extra="ignore"):
    wording: Name
    accepted: StrictBool
    template: str


@dataclass(frozen=True)
class Wording:
    """A further wording of a kind of question: `sh-m2` of the stem `sh`."""

    name: str
    template: str

    @property
    def stem(self) -> str:
        """The stem that the wordings of one kind of question share."""
        return stem_of(self.name)

    def asks(self, question: Question) -> Question:
        """The question in this wording, under an id of its own."""
        slots: Mapping[str, str] = question.evidence.get("slots", {})
        name = f"{question.id}-{self.name.removeprefix(f'{self.stem}-')}"
        return replace(
            question, id=name, text=fill_template(self.template, slots), wording=self.name
        )


def read_wordings(path: Path) -> tuple[Wording, ...]:
    """The accepted wordings of a file; raises DataError with everything that is wrong in it."""
    wordings: list[Wording] = []
    problems: list[Problem] = []
    for number, text in enumerate(lines_of(read_text(path, _ALLOWED)), 1):
        where = f"{path}:{number}"
        try:
            line = validated(_StoredWording, parse_json(text, path, number), where)
            if line.accepted:
                refuse(_faults(line, wordings), where)
                wordings.append(Wording(line.wording, line.template))
        except DataError as error:
            problems += error.problems
    if problems:
        raise DataError(problems)
    if not wordings:
        raise DataError(Problem(str(path), "holds no accepted wording", allowed=_ALLOWED))
    return tuple(wordings)


def reword(
    questions: Iterable[Question], wordings: Sequence[Wording], seed: int
) -> dict[str, Question]:
    """By its id, each question that a wording is for, asked in one of these.

    Which one depends on the seed and the question's id alone.
    """
    reworded = {}
    for question in questions:
        stem = stem_of(question.wording)
        fitting = [wording for wording in wordings if wording.stem == stem]
        if fitting and question.wording in WORDINGS:
            rng = np.random.default_rng([seed, *question.id.encode()])
            reworded[question.id] = pick(rng, fitting).asks(question)
    return reworded


def _faults(line: _StoredWording, earlier: Sequence[Wording]) -> Iterator[Fault]:
    """Yield the faults of an accepted line beside those before it."""
    stem = stem_of(line.wording)
    originals = [WORDINGS[known] for known in wording_ids(stem)]
    if not originals:
        allowed = "a wording of a known kind of question, such as sh-m1"
        yield Fault("is of no known kind", allowed, shown(line.wording), ("wording",))
    elif line.wording in WORDINGS or any(other.name == line.wording for other in earlier):
        allowed = "a name of its own, such as sh-m1"
        yield Fault("is used already", allowed, shown(line.wording), ("wording",))
    else:
        alike = [other.template for other in earlier if other.stem == stem]
        fault = fault_of_form(line.template, [*originals, *alike])
        if fault is not None:
            message = f"cannot be used: {fault}"
            yield Fault(message, found=shown(line.template), at=("template",))
