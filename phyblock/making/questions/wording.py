"""Filling templates of questions, and telling whether a text is a template filled as claimed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phyblock.domain.question import Question
from phyblock.making.questions.dynamic_templates import DYNAMIC_TEMPLATES
from phyblock.making.questions.question_draft import UnfairError
from phyblock.making.questions.static_templates import TEMPLATES

__all__ = ["WORDINGS", "fill", "fill_template", "slots_of", "stem_of", "wording_ids"]

WORDINGS: Mapping[str, str] = {**TEMPLATES, **DYNAMIC_TEMPLATES}
"""All templates by id."""


def wording_ids(stem: str) -> Sequence[str]:
    """The ids `stem-1`, `stem-2` and so on, in that order."""
    return [name for name in WORDINGS if stem_of(name) == stem]


def stem_of(wording: str) -> str:
    """What all wordings of one kind of question share: `rp-corner` of `rp-corner-2`."""
    return wording.rsplit("-", 1)[0]


def fill(wording: str, **slots: str) -> str:
    """The template of a known wording with its slots filled, first letter large."""
    return fill_template(WORDINGS[wording], slots)


def fill_template(template: str, slots: Mapping[str, str]) -> str:
    """A template with its slots filled, first letter large."""
    text = template.format(**slots)
    return text[:1].upper() + text[1:]


def slots_of(question: Question) -> Mapping[str, str]:
    """The slots of a question's text, from its evidence; UnfairError unless the text holds them.

    The text of a wording that is known must be its template filled with exactly these; of any
    other wording, each slot must stand in the text.
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
