"""What a reply says of its own words: that it takes them back, supposes, declines or concludes.

Plans, answers and moves share these words; each adds what only it can mean by them.
"""

from __future__ import annotations

import re

__all__ = [
    "BACKWARD",
    "CONDITIONAL",
    "PLACES",
    "REFUSAL",
    "REVISED",
    "SLIPS",
    "SUPPOSES",
    "TAKES_BACK",
    "TURNED_ROUND",
    "UNSURE",
    "words",
]

SLIPS = r"wait|oops|sorry|scratch that|correct(?:ion|ed)|i mean(?:t)?|pardon|moment"
"""Words that take back what was just said, in the same breath."""
TAKES_BACK = (
    rf"\b(?:{SLIPS}|hmm+|correcting|(?:my )?mistakes?"
    r"|on (?:second thought|reflection)|i (?:forgot|missed|overlooked)|revis\w+"
    r"|re-?(?:check|think|consider|examin|evaluat|look|assess)\w*"
    r"|korrektur|korrigier\w*|corrección)\b"
    r"|\b(?:actually|no|rather)\b[,:]|等等|更正|訂正"
)
"""That what was said before does not hold."""
_TURNS = r"\b(?:actually|instead|rather|however|but|wrong|incorrect|doch|aber|sondern)\b|但是?|不过"
_CONCLUDES = r"\b(?:final(?:ly)?|therefore|thus|hence|so|overall|conclusion|conclude)\b|因此|所以"
_IF = (
    r"\b(?:if|unless|provided|assuming|(?<=, )falls|wenn|si|otherwise|sonst|or else"
    r"|depend(?:s|ing))\b"
    r"(?! (?:I|we) (?:had|have|must)\b)|如果|否则|取决于"
)
_MAY = r"\b(?:could|might|let me know|könnte|peut|podría)\b|可以"
_PICTURE = r"\b(?:image|picture|photo|goal|structure)"
_DECLINES = (
    r"\bI(?:['\u2019]m| am) (?:sorry|unable|not able|afraid)"
    r"|\bI (?:cannot|can['\u2019]?t|could not|won['\u2019]t|am not able|apologi[sz]e)"
    r"|\b(?:cannot|can['\u2019]?t|not possible to|impossible to|unable to) (?:determine|give"
    r"|provide|build|produce|see|view|make|create|identify|plan|be built)"
    r"|as an ai|please (?:provide|send|upload|share)"
    r"|ich kann (?:das |die |den |leider )?(?:\w+ )?(?:nicht|kein)|无法|抱歉|不能确定"
    r"|lo siento|désolé|не могу"
)
_NO_PLAN = (
    rf"\bno (?:valid )?plan\b|leider|(?<!of )(?<!of the ){_PICTURE}s? (?:is|are) not visible"
    rf"|need to see (?:the |an? |your )?{_PICTURE}"
    r"|\bno (?:image|picture)s? (?:(?:is|was|were|has|have) )?(?:been )?"
    r"(?:here|attached|available|given|included|provided|sent|supplied|uploaded)\b"
)
"""Not to see the picture is a reason to decline, not to see the back of a block is none."""
_CANNOT = (
    r"\b(?:cannot|can['\u2019]?t|could not|couldn['\u2019]t|unable to|not able to|impossible to"
    r"|not possible to|insufficient|not enough|(?:don['\u2019]t|do not) know|not sure|unclear"
    r"|no (?:image|picture)|none of the|neither(?![^.;\n]{1,60}\bnor\b))\b"
)


def words(*patterns: str) -> re.Pattern[str]:
    """Any of several patterns, whatever the case of their letters."""
    return re.compile("|".join(patterns), re.IGNORECASE)


REVISED = words(TAKES_BACK, _TURNS, _CONCLUDES)
"""That a further word replaces what was said: it is taken back, turned from, or come to."""
CONDITIONAL = words(_IF)
"""That what is said holds only under a condition."""
SUPPOSES = words(_IF, _MAY)
"""That what is said is only thought of."""
REFUSAL = words(_DECLINES, _NO_PLAN)
UNSURE = words(_DECLINES, _CANNOT)
"""That the reply cannot tell, in a text as short as an answer is."""

BACKWARD = re.compile(
    r"\b(?:in |the )?revers(?:e|ed)(?: (?:order|of))?\b|\bbackwards?\b"
    r"|from (?:the )?last to (?:the )?first"
    r"|last (?:step|block|one|item|picture) first|read (?:it )?from (?:the )?(?:bottom|end|right)"
    r"|umgekehrte?r? reihenfolge|rückwärts|von hinten|倒序|逆序|反过来"
    r"|从后(?:往|到|向)前|相反的?顺序"
    r"|ordre inverse"
    r"|orden inverso",
    re.IGNORECASE,
)
"""That a list stands in the opposite order."""

_ORDER = r"(?:order\w*|sequence|list(?:ing)?|letters|ranking|arrangement)"
_MUST_BE = r"\s(?:ha(?:s|ve) to|must|should|needs? to|is to) be (?:\w+ )?"
TURNED_ROUND = re.compile(
    rf"\b{_ORDER}(?:[^.!?\n]{{0,60}}?\b(?:it|this|that|which))?{_MUST_BE}"
    r"(?:turned|reversed|flipped|inverted)"
    rf"|(?:\A|[.,;:!)\n\u2013\u2014-])\s{{0,3}}(?:\w+,? )?(?:it|this|that){_MUST_BE}"
    r"(?:reversed|inverted)"
    rf"|{_MUST_BE}read (?:backwards?|from)"
    rf"|\b(?:turn|reverse|flip|invert) (?:the|this|that) (?:\w+ )?{_ORDER}\b"
    r"|\breverse (?:it|this|that)\b(?! [^\W\d])",
    re.IGNORECASE,
)
"""That an order is to be taken the other way round; a block that "must be turned" says no such."""

PLACES = {
    name: place
    for place, names in enumerate(
        ("first 1st", "second 2nd", "third 3rd", "fourth 4th", "fifth 5th", "sixth 6th"), start=1
    )
    for name in names.split()
}
"""Words for a place in an order."""
