"""What of a reply is read: the answer behind the thinking, in plain forms of its characters."""

from __future__ import annotations

import re
import unicodedata

__all__ = ["after_reasoning", "plain_forms"]

_NOT_ASCII = re.compile(r"[^\x00-\x7f]")
_THINKING_ENDS = re.compile(r"</think(?:ing)?>", re.IGNORECASE)


def after_reasoning(text: str) -> str:
    """What follows the last closing tag of a reasoning section, or the whole text."""
    ends = list(_THINKING_ENDS.finditer(text))
    tail = text[ends[-1].end() :] if ends else ""
    return tail if tail.strip() else text


def plain_forms(text: str) -> str:
    """A text in compatibility form (NFKC, as full-width digits), but with exponents left alone.

    Superscripts, subscripts and fractions are no digits: "5 cm²" is not "5 cm2".
    """
    return unicodedata.normalize("NFC", _NOT_ASCII.sub(_plain_form, text))


def _plain_form(found: re.Match[str]) -> str:
    character = found[0]
    tag = unicodedata.decomposition(character).partition(" ")[0]
    kept = tag in ("<super>", "<sub>", "<fraction>")
    return character if kept else unicodedata.normalize("NFKC", character)
