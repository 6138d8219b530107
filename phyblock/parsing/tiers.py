"""Words that say how high a part of a structure stands, so that parts are built from the ground."""

from __future__ import annotations

import re
from collections.abc import Sequence

from phyblock.parsing.speech import PLACES, words
from phyblock.parsing.text_forms import number_of_word

__all__ = ["lowest_first", "tier_of"]

_TIERS = (
    "ground base bottom lowest lower foundation unten untere unterste boden fundament bas abajo"
    " inferior inferiore 底",
    "middle mid mitte mittlere milieu medio 中",
    "upper",
    "top topmost highest oben obere oberste haut arriba superior superiore 顶 頂",
    "roof dach toit",
)
_RANKS = {word: rank for rank, words in enumerate(_TIERS) for word in words.split()}
_TOPS = ((1, len(_TIERS) - 2), (1, len(_TIERS) - 1))
_WORD = re.compile(r"[^\W\d_]+")
_PART = r"(?:layers?|levels?|rows?|tiers?|stor(?:e?y|ies)|floors?)"
_NUMBER = words(
    rf"(?:\b(?:{_PART}|ebene|schicht|couche|niveau|capa|nivel|strato|livello|camada|слой|l)|层"
    rf"|層)\s{{0,2}}#?(?P<after>\d{{1,2}})\b"
    r"|第?(?P<cjk>\d{1,2}|[一二三四五六七八九])[层層段층]|^\W*(?P<alone>\d{1,2})\W*\Z"
    rf"|\b(?P<ordinal>first|second|third|fourth|fifth|sixth)\s{_PART}\b"
)


def tier_of(label: str) -> tuple[int, int] | None:
    """How high a label says that a part stands: by its number, else by its word; None: it does not.

    Of two tiers the greater stands on the lesser. Numbers and words are told apart by the first
    value, so that a list that says some by numbers and others by words is not sorted by both.
    """
    numbered = _NUMBER.search(label)
    if numbered:
        ordinal = (numbered["ordinal"] or "").lower()
        digits = numbered["after"] or numbered["cjk"] or numbered["alone"]
        return (0, (number_of_word(digits) or int(digits)) if digits else PLACES[ordinal])
    ranks = [_RANKS[word] for word in _WORD.findall(label.lower()) if word in _RANKS]
    ranks += [_RANKS[sign] for sign in "底中顶頂" if sign in label]
    return (1, ranks[0]) if ranks else None


def lowest_first(labels: Sequence[str]) -> list[int] | None:
    """The order of parts from the ground up, by positions; None where labels do not say it.

    Between the ground and the top, other names ("walls") go up as they stand; so do
    "ground floor, first floor" and "base, second layer, third layer" go up as they stand.
    """
    tiers = [tier_of(label) for label in labels]
    known = [tier for tier in tiers if tier is not None]
    counted = [rank for kind, rank in known if kind == 0]
    if tiers and tiers[0] == (1, 0) and tiers[-1] in _TOPS and counted == sorted({*counted}):
        return list(range(len(tiers)))
    if len(known) < len(tiers) or len({*known}) < len(known) or len(known) < 2:
        return None
    kinds = {kind for kind, _ in known}
    if len(kinds) > 1:
        counted_parts = known[known[0] == (1, 0) : len(known) - (known[-1] in _TOPS)]
        is_rising = {kind for kind, _ in counted_parts} == {0} and counted == sorted(counted)
        return list(range(len(known))) if is_rising else None
    return sorted(range(len(known)), key=lambda i: known[i])
