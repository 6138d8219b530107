"""Wordings of questions: templates with named slots, in `wordings.yaml`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from phyblock.domain.question import Question
from phyblock.making.questions.question_draft import UnfairError

_FILE = Path(__file__).with_name("wordings.yaml")

WORDINGS: Mapping[str, str] = {
    f"{stem}-{number}": text
    for stem, texts in yaml.safe_load(_FILE.read_text(encoding="utf-8")).items()
    for number, text in enumerate(texts, 1)
}
"""All templates by id: subtask, kind where there are several, and number (`rp-corner-2`)."""


def wording_ids(stem: str) -> Sequence[str]:
    """Return the ids `stem-1`, `stem-2` and so on, in that order."""
    return [name for name in WORDINGS if stem_of(name) == stem]


def stem_of(wording: str) -> str:
    """Return the part that all wordings of a kind share: `rp-corner` of `rp-corner-2`."""
    return wording.rsplit("-", 1)[0]


def fill(wording: str, **slots: str) -> str:
    """Return the template of a known wording with its slots filled, capitalized."""
    return fill_template(WORDINGS[wording], slots)


def fill_template(template: str, slots: Mapping[str, str]) -> str:
    """Return a template with its slots filled, capitalized."""
    text = template.format(**slots)
    return text[:1].upper() + text[1:]


def slots_of(question: Question) -> Mapping[str, str]:
    """Return the slots of a question's text, from its evidence.

    The text of a wording that is known must be its template filled with exactly these; of any
    other wording, each slot must stand in the text; UnfairError otherwise.
    """
    slots = question.evidence.get("slots", {})
    if question.wording in WORDINGS:
        try:
            held = fill(question.wording, **slots) == question.text
        except KeyError:
            held = False
    else:
        held = all(str(slot).lower() in question.text.lower() for slot in slots.values())
    if not held:
        raise UnfairError("the text is not its wording with the slots of the evidence")
    return {name: str(slot) for name, slot in slots.items()}
