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

SLIPS = (
    r"wait|oops|sorry|scratch that|correct(?:ion|ed)|i mean(?:t)?|pardon|moment|halt|hang on"
    r"|hold on|attend(?:s|ez)|espera|perd[óo]n|aspetta|scusa|anzi|desculpe|подожди(?:те)?|стоп"
)
"""Words that take back what was just said, in the same breath."""
TAKES_BACK = (
    rf"\b(?:{SLIPS}|hmm+|correcting|(?:my )?mistakes?|(?:strike|ignore) that|i was wrong"
    rf"|miscount\w*"
    r"|on (?:second thoughts?|reflection|(?:a )?closer (?:look|inspection))|looking (?:again"
    r"|closer)|i(?:['\u2019]ve| have)? (?:forg[oe]t\w*|missed|overlooked|left out an?)|revis\w+"
    r"|re-?(?:check|think|consider|examin|evaluat|look|assess|count)\w*|korrektur|korrigier\w*"
    r"|irrtum|(?:ver(?:gessen|zählt)|übersehen)|corrección|corrijo|oublié|erreur|olvidé|equivoqué"
    r"|dimenticato|sbagliat[oa]|esqueci|enganei|ошиб\w+|исправ\w+|пропустил\w?|забыл\w?)\b"
    r"|\b(?:actually|no|rather|nein|non|não|нет|en (?:fait|realidad)|in realtà|na verdade)\b[,:]"
    r"|等等|等一下|(?<![也都])不[对對](?=[,。!])|漏了|更正|修正|訂正|待って|잠깐|정정"
)
"""That what was said before does not hold."""
_TURNS = (
    r"\b(?:actually|instead|rather|however|but|wrong|incorrect|doch|aber|sondern|mais|pero|sino"
    r"|però|mas|но|однако)\b|但是?|不过|しかし|하지만"
)
_CONCLUDES = (
    r"\b(?:final(?:ly)?|therefore|thus|hence|so|overall|conclusion|conclude|daher|donc|quindi"
    r"|entonces|portanto|поэтому)\b|因此|所以"
)
_IF = (
    r"\b(?:if|unless|provided|assuming|(?<=, )falls|wenn|si|otherwise|sonst|or else|sinon|если"
    r"|иначе|depend(?:s|ing))\b(?! (?:I|we) (?:had|have|must)\b)|如果|否则|取决于"
)
_MAY = r"\b(?:could|might|let me know|könnte|peut|podría)\b|可以"
_PICTURE = r"\b(?:image|picture|photo|goal|structure)"
_DECLINES = (
    r"\bI(?:['\u2019]m| am) (?:sorry|unable|not able|afraid)|\bI (?:cannot|can['\u2019]?t|could not"
    r"|won['\u2019]t|am not able|apologi[sz]e)|\b(?:cannot|can['\u2019]?t|not possible to"
    r"|impossible to|unable to) (?:determine|give|provide|build|produce|see|view|make|create"
    r"|identify|plan|be built)|as an ai|please (?:provide|send|upload|share)|ich kann (?:das |die "
    r"|den |leider )?(?:\w+ )?(?:nicht|kein)|无法|抱歉|不能确定|lo siento|désolé|не могу"
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
    r"|no (?:image|picture)|none of the|neither(?![^.;\n]{1,60}\bnor\b)|toss[- ]?up|a guess"
    r"|weiß (?:es )?nicht|unklar|(?:je ne|no|non|não) (?:sais pas|sé|so|sei)|не знаю)\b|不知道"
    r"|不确定"
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
    r"\b(?:in |the )?revers(?:e|ed)(?: (?:order|of))?\b|\bbackwards?\b|\b(?:opposite"
    r"|inverse) (?:order|sequence)\b|\b(?:buil[dt]\w*|read|order|list"
    r"|sequence)\b[^.,;:\d\n]{0,40}\bthe other way (?:a)?round\b"
    r"|from (?:the )?last(?: \w+)? to (?:the )?first|last (?:step|block|one|item|picture) first"
    r"|read (?:it )?from (?:the )?(?:bottom|end|right)|(?:umgekehrte?r?"
    r"|entgegengesetzte?r?) reihenfolge|rückwärts|von hinten|倒序|逆序|反过来|从后(?:往|到|向)前"
    r"|相反的?顺序|顺序相反|逆順|逆の順|역순|(?:ordre|ordine) (?:inverse|inverso)"
    r"|orden inverso|ordem inversa|обратном порядке",
    re.IGNORECASE,
)
"""That a list stands in the opposite order."""

_ORDER = r"(?:order\w*|sequence|list(?:ing)?|letters|ranking|arrangement)"
_MUST_BE = r"\s(?:ha(?:s|ve) to|must|should|needs? to|is to) be (?:\w+ )?"
TURNED_ROUND = re.compile(
    rf"\b{_ORDER}(?:[^.!?\n]{{0,60}}?\b(?:it|this|that|which))?{_MUST_BE}(?:turned|reversed"
    r"|flipped|inverted)|(?:\A|[.,;:!)\n\u2013\u2014-])\s{0,3}(?:\w+,? )?(?:it|this"
    rf"|that){_MUST_BE}(?:reversed|inverted)|{_MUST_BE}read (?:backwards?|from)|\b(?:turn|reverse"
    rf"|flip|invert) (?:the|this|that) (?:\w+ )?{_ORDER}\b|\breverse (?:it|this"
    r"|that)\b(?! [^\W\d])",
    re.IGNORECASE,
)
"""That an order is to be taken the other way round; a block that "must be turned" says no such."""

PLACES = {
    name: place
    for place, names in enumerate(
        (
            "first 1st erste première primera primeira",
            "second 2nd zweite deuxième segunda seconda",
            "third 3rd dritte troisième tercera terceira terza",
            "fourth 4th vierte quatrième cuarta quarta",
            "fifth 5th",
            "sixth 6th",
        ),
        start=1,
    )
    for name in names.split()
}
"""Words for a place in an order."""
