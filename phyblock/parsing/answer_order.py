"""What a short piece of a reply names as an order of pictures; results as in `answer_value`."""

from __future__ import annotations

import re

from phyblock.parsing.answer_value import CONTRADICTION, EDGES, LETTERS
from phyblock.parsing.speech import BACKWARD, PLACES, words
from phyblock.parsing.text_forms import unmarked

__all__ = ["OrderReader"]

_BETWEEN = (
    r"(?:[\s,;>|/.:()\[\]{}<=\-\u2010-\u2015→⇒➔➜、\uff0c]|\b(?:and|then|to|first|next|finally"
    r"|lastly|followed|by|comes|goes|last|end|after that|und|dann|danach|zuletzt|et|puis|ensuite"
    r"|enfin|y|luego|después|por último|finalmente|e|poi|infine|depois|por fim|и|затем|потом"
    r"|наконец)\b|然后|再|最后|接着){1,16}"
)
_RANKS = f"({'|'.join(PLACES)}|last)"
_ORDINAL = words(r"\b(?:first|second|third|fourth)\b")
_CLAUSE = re.compile(r"[.;!?\n](?=\s)")
_DENIED = words(r"\b(?:not|nicht)\W{0,3}\Z|不是\s?\Z")
_CALLED_BACKWARD = words(
    rf"[\s,(]{{0,3}}(?:(?:is|in|are|as|the|order|sequence|pictures|listed|given"
    rf"|read)\s){{0,6}}(?:{BACKWARD.pattern})"
)
"""What calls the order before it one that goes from last to first."""
_ALL_BACKWARD = words(rf"\s?\((?:in )?(?:{BACKWARD.pattern})\)")
_REMARK = re.compile(r"\s?\((?![A-Za-z1-9]\))[^()\n]{1,40}\)|(?<=[A-Z])\s?\(\d{1,2}\)")
_THING = r"(?:(?:picture|image|option|figure|stage|step|photo|frame|img)\s{0,2}[(\[<]{0,1})?"


class OrderReader:
    """Reads an order of all `n` options out of a short text, by letters or by numbers from 1."""

    def __init__(self, n: int) -> None:
        self.letters = LETTERS[:n]
        one_letter = rf"{_THING}([{self.letters}])"
        one_number = rf"{_THING}([1-{n}])"
        guard = r"(?<![A-Za-z0-9'])"
        stop = r"(?![A-Za-z0-9']|\s?[,\->\u2192]\s?(?:\d|[A-Za-z](?![A-Za-z])))"
        ways = [
            between.join([one] * n)
            for one in (one_letter, one_number)
            for between in ("", _BETWEEN)
        ]
        self._order = words(rf"{guard}(?:{'|'.join(ways)}){stop}")
        self._item = re.compile(
            rf"^[\s>*+\-|]{{0,6}}(?:step\s)?([1-{n}])(?:st|nd|rd|th)?(?:\s(?:picture|image|step|place))?\s?[.):\-|]{{1,2}}\s{{0,3}}"
            rf"[(\[]?{_THING}([{self.letters}])(?![A-Za-z0-9'])",
            re.IGNORECASE | re.MULTILINE,
        )

        self._ranked = re.compile(
            rf"(?<![A-Za-z0-9'])([{self.letters}])\s?(?:(?:is|comes|goes)\s)?(?:the\s)?(?:{_RANKS}\b|[:=→]\s?([1-{n}])(?!\d))"
        )

    def read(self, text: str) -> str | None:
        """The order in a text; a contradiction where it holds two."""
        found = self.orders(text)
        if not found:
            return self.listed(text)
        return found[0] if len(set(found)) == 1 else CONTRADICTION

    def exact(self, text: str) -> str | None:
        """The order that a whole text is."""
        value = unmarked(text).strip(EDGES)
        match = self._order.fullmatch(value)
        return self._letters(match) if match else None

    def orders(self, text: str) -> list[str]:
        """All orders in a text, each naming every option once."""
        value = _REMARK.sub(
            lambda remark: remark[0] * bool(_ALL_BACKWARD.fullmatch(remark[0])), unmarked(text)
        )
        found = []
        for match in self._order.finditer(value):
            before = _CLAUSE.split(value[max(0, match.start() - 60) : match.start()])[-1]
            order = None if _DENIED.search(before) else self._letters(match)
            if order:
                is_down = BACKWARD.search(before) or _CALLED_BACKWARD.match(value, match.end())
                found.append(order[::-1] if is_down else order)
        return found

    def ranked(self, text: str) -> str | None:
        """The order that the places of all pictures say: "B is first, A second", "A: 2, B: 1"."""
        places = {**PLACES, "last": len(self.letters)}
        named = [
            (int(m[3]) if m[3] else places[m[2]], m[1])
            for m in self._ranked.finditer(unmarked(text))
        ]
        order = "".join(letter for _, letter in sorted(named))
        is_whole = [place for place, _ in sorted(named)] == list(range(1, len(self.letters) + 1))
        return order if is_whole and set(order) == set(self.letters) else None

    def listed(self, text: str) -> str | None:
        """The order in the last numbered list of letters."""
        counted = _ORDINAL.sub(lambda word: str(PLACES[word[0].lower()]), unmarked(text))
        items = [(int(m[1]), m[2].upper()) for m in self._item.finditer(counted)]
        last = items[-len(self.letters) :]
        numbers = "".join(letter for _, letter in last)
        in_turn = [number for number, _ in last] == list(range(1, len(self.letters) + 1))
        return numbers if in_turn and set(numbers) == set(self.letters) else None

    def _letters(self, match: re.Match[str]) -> str | None:
        given = "".join(group for group in match.groups() if group).upper()
        if given[0].isdigit():
            given = "".join(self.letters[int(digit) - 1] for digit in given)
        return given if set(given) == set(self.letters) else None
