"""How replies state an answer, correct themselves, turn an option down, or say that they cannot."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

from phyblock.parsing.speech import words

__all__ = [
    "BRANDED",
    "CHOSEN",
    "CONCLUDED",
    "CONFIRMED",
    "CORRECTED",
    "COUNTED",
    "DANGLES",
    "DENIED",
    "DENIED_BEHIND",
    "IS_REJECTED",
    "IS_RIGHT",
    "JSON",
    "LABEL",
    "LEADING",
    "LINE",
    "MAKES",
    "NOT_BUT",
    "ORDER",
    "QUOTED",
    "REJECTS",
    "SENTENCE",
    "SO",
    "TURNED",
    "VERDICT",
]

_WORDS = (
    r"answer|antwort|l(?:ö|oe)sung|respuesta|resposta|r[ée]ponse|risposta|ответ|答案|回答|答え|解答|正解"
    r"|정답|답|jawaban|cevap|odpowied[źz]|antwoord|svar|đáp án|الإجابة|απάντηση"
)
_IS = (
    r"(?::|=|\bis\b|\bist\b|\bes\b|\best\b|\bè\b|\bé\b|είναι|是|为|為|は|은|는"
    r"|[\-\u2013\u2014](?=\s))"
)
_QUALIFIED = (
    r"(?:(?:my|the|your|final|correct|best|right|so|thus|therefore|overall|la|le|die|el|a)"
    r"\s{1,3}){0,4}"
)
_VALUE = r"[ \t*_`#>]{0,8}\n?[ \t]{0,4}(?=(?P<value>[^\n]{1,240}))"
LINE = re.compile(
    rf"^[ \t>*_#`\-]{{0,12}}(?P<lead>{_QUALIFIED}(?:{_WORDS})(?:\s(?:choice|option|key))?)"
    rf"[ \t]?[*_`]{{0,3}}[ \t]{{0,2}}(?:{_IS}|(?=[*_ ]{{0,4}}\n))[ \t*_`]{{0,6}}:?{_VALUE}",
    re.IGNORECASE | re.MULTILINE,
)
SENTENCE = words(
    rf"(?<![a-z])(?P<lead>(?:final\s)?(?:{_WORDS}))(?:\s(?:choice|option|key|correcta|correcte"
    rf"|correta|corretta|giusta))?(?:\sto\s(?:the|this|your)\squestion)?[ \t*_`]{{0,4}}(?:{_IS}"
    rf"|\b(?:would|should|must|has to) be\b)[ \t*_`:]{{0,6}}{_VALUE}"
)
CHOSEN = words(
    r"(?:\bI(?:['\u2019]ll|['\u2019]d| will| would| am going to)? (?:choose|pick|select|prefer"
    r"|go with|answer|say|lean (?:more )?(?:to|towards?))|\bmy (?:choice|pick|guess"
    r"|selection) (?:is|would be)|\b(?:correct|right|best) (?:option|choice|one|picture|image"
    r"|letter|place|match)(?: is| would be| must be| should be|:)|\b(?:nehme|wähle)(?: aber| daher"
    r"| also)?|^(?:it )?looks like|\bje choisis|\b(?:elijo|escolho|scelgo)|我认为(?:答案)?是?"
    r"|应?(?:该)?选(?:择|项)?(?:是|为)?)[ \t*_`:]{0,6}(?=(?P<value>[^\n]{1,80}))"
)
CONFIRMED = words(r"(?<![A-Za-z0-9])(?P<value>[A-Z])\)?\?\s{1,2}(?:yes|yep|correct|right)\b")
"""A question that the reply itself says yes to."""
IS_RIGHT = re.compile(
    r"(?<![A-Za-z0-9'\-])(?P<value>[A-Z])[)\]*_`\"]{0,4}(?:\s?[(:][^()\n]{1,60}\))?\s{1,2}(?:is"
    r"|must be|seems|appears to be) (?:therefore |clearly |definitely "
    r"|likely )?(?:the )?(?:most )?(?:correct|right|best|better (?:match|fit|choice|answer)|likely"
    r"|plausible|answer|only (?:one|option|correct))\b"
)
ORDER = words(
    rf"\b(?:order|ordering|sequence|arrangement)(?:\s(?:of|in)\s[^\n.:]{{1,60}}?)?[ \t*_`]{{0,4}}"
    rf"(?::|=|\bis\b|\bwould be\b|\bshould be\b|\bmust be\b)[ \t*_`:]{{0,6}}{_VALUE}"
)
SO = words(
    r"(?:(?:^|[.;,:]\s|\s[\u2013\u2014]\s)(?:and )?(?:so|therefore|thus|hence|but then|also|daher"
    r"|donc)\b,?|\bnot\b[^.;,\n]{1,60}\bbut\b)\s(?=(?P<value>[^\n.;]{1,120}))"
)
"""Behind this stands what follows from the rest of a sentence."""
MAKES = words(
    r"[,;]\s(?:(?:but|yet|so)\b[^,;\n]{0,80}?\b(?:is|are|be|makes it|it['\u2019]s)|it is"
    r"|it['\u2019]s)\s(?:\w+ly\s){0,2}(?P<value>[^,;\n]{1,80})\Z"
)
"""The clause that a reply ends with, that says what the thing asked for is."""
COUNTED = words(
    r"(?:\b(?:I count|(?:in|a) total(?: of|:| is)|total(?: number)?(?: of \w{1,12})?(?::| is)"
    r"|which (?:gives|makes)|gives|makes?))"
    r"\s{1,2}(?P<a>\d{1,3})\b(?!\s?[+*x×/.\-]\s?\d|,?\s(?:or|maybe|perhaps|possibly)\b)"
    r"|(?<![+*/.\d] )\b(?P<b>\d{1,3})(?:\s\w{1,12}){0,2}\s(?:in total|altogether|overall)\b"
)
"""How many there are in all."""
CONCLUDED = re.compile(
    r"(?:\b|(?<=[\s.;]))(?i:(?:\u2192|=>)\s?|(?:it|this|that|which|what(?: is)? left|what remains"
    r"|answer|option|choice|picture|image|place)(?: must be| has to be| should be| is|['\u2019]s"
    r"| leaves| matches| corresponds to)(?: (?:the |with )?(?:option|picture|image|choice|place))?"
    r"|(?:so|therefore|thus|hence|also|daher|donc|alors|entonces)[:,]?|leaves(?: only)?|only"
    r"|(?:verdict|remaining|conclusion)\s?(?:is|:|=|->|\u2192)|(?:choose|pick|select)"
    r"|[;,] then)[ *_`]{0,4}(?P<value>\(?[A-Z]\)?)[*_`]{0,3}(?: it is| is left"
    r"| remains)?(?=[\s.!,;]{0,3}(?:\Z|\n|[.!;]))",
)
CORRECTED = words(
    rf"\b(?P<lead>correction|edit|korrektur|final(?: decision| choice)?|更正)\s?[:：]{_VALUE}"
)
"""An answer that takes the place of what was said before."""
NOT_BUT = re.compile(
    r"(?:\b(?:not|nicht|no es|n't)\s|不是)(?:option )?\(?[A-Z]\)?(?:,|，)?\s?"
    r"(?:(?:but|sondern|es|it's|it is)\s|而是)(?:option )?(?P<value>\(?[A-Z]\)?(?![A-Za-z]))"
)
"""Not this but that: what is meant is that."""
QUOTED = words(
    rf"(?<=[\w:] )[\"'\u201c\u00ab](?:[^\"'\u201d\u00bb\n]{{0,40}}?(?:{_WORDS})\s?[:：]"
    r"[^\"'\u201d\u00bb\n]{0,40})[\"'\u201d\u00bb]"
)
"""An answer in quotation marks within a sentence: somebody else's words."""
TURNED = words(
    r"(?:\b(?:but|however|actually|yet|aber|doch)\b|但是?|不过)[^\n]{0,100}?(?:\b(?:is|be|ist)\s"
    r"|是)(?:option )?\(?(?P<value>[A-Z])\)?\s{0,2}(?=[.!;。]|\Z)"
)
"""A turn away from the stated answer: "I would answer A, but the picture shows that it is D"."""
VERDICT = words(
    r"(?:^|[.;,:]\s|(?<=[✓✔✅✗✘❌×])\s|\n)[\s*\-_(\[]{0,6}(?:option "
    r")?(?P<letter>[A-Z])[*_)\]]{0,3}(?:\s?[:.]\s[^\n\u2013\u2014:]{1,40}?\s(?=[\-\u2013\u2014]))?"
    r"\s?[:.\-\u2013\u2014]?\s{0,3}(?:(?P<yes>✓|✔|✅|☑|(?:yes|correct|matches|fits|right|true)\b)"
    r"|(?:✗|✘|❌|×|☒|(?:no|wrong|incorrect|false|does not|doesn't|not)\b))"
)
_LETTERS = (
    r"(?P<letters>(?-i:\(?(?<![A-Za-z])[A-Z](?![A-Za-z'])\)?)(?:(?:\s?[,/、]\s?|\s)(?:(?:and|or|nor"
    r"|not|und|noch|nicht|et|ni|y|o|e|né|и|和)\s){0,2}(?-i:\(?[A-Z](?![A-Za-z'])\)?)){0,8})"
)
DENIED = re.compile(
    r"(?:(?:\b(?:not|neither|nor|nicht|weder|ni|pas|n['\u2019]est|no es|non è|não é|не|rul\w+ out"
    r"|exclud\w+|eliminat\w+|discard\w*|descart\w+|ausgeschlossen(?: sind)?)|n['\u2019]t(?: be)?)\s"
    r"|不是|排除)(?:(?:options?|auch|la)\s)?" + _LETTERS,
    re.IGNORECASE,
)
DENIED_BEHIND = re.compile(
    _LETTERS
    + r"\)?(?:\s(?:also|auch|is|are|can|ist|sind|est|sont|es|son|è|sono|é|são|scheide[nt]|тоже)"
    r"|\s?(?:也|都)){0,2}(?:\s?(?:not\b|n['\u2019]t\b)|['\u2019]t\b|\s(?:wrong|incorrect|false"
    r"|impossible|out\b|(?:ruled|falls) out|excluded|eliminated|cannot|do(?:es)?n['\u2019]t|falsch"
    r"|(?:auch )?aus\b|imposs?ible|impossibile|faux|falsas?|sbagliat[ae]|errad[ao]s?|не\b)|不)",
    re.IGNORECASE,
)
"""Letters that a reply turns down, by a word before or behind them."""
JSON = words(
    r"[\"'](?:final[_ ]?)?(?:answer|choice|option|selected_option|order|ordering|letter)[\"']"
    r"\s{0,4}:\s{0,4}(?P<value>\[[^\[\]]{1,120}\]|\"[^\"\n]{0,200}\"|'[^'\n]{0,200}'|\d{1,4}\b)"
)
BRANDED = re.compile(
    r"\((?P<a>[A-Z])\)|\*\*\(?(?P<b>[A-Z])[).:]?\*\*|\b(?:[Oo]ption|[Cc]hoice|[Pp]icture|[Ii]mage"
    r"|[Ll]etter|[Pp]osition|[Ss]pot|[Ll]ocation)s?[ *_`(\"']{1,4}(?P<c>[A-Z])(?![A-Za-z0-9'\-])"
)
LABEL = re.compile(r"(?:^|\n|\s)[*_(\[]{0,3}(?P<letter>[A-Z])[)\].:]")
LEADING = re.compile(
    r"[\s*_`(\[\"']{0,6}(?P<letter>[A-Za-z])(?:[)\]*_`\"']{1,4}|(?=[\s.,:;\u2013\u2014!-])|[.,:;])"
)
IS_REJECTED = re.compile(
    r"[)\]}*_`\"']{0,3}(?:\s{1,2}(?:is|was|seems|looks|would be|can be|does|can|could)\b"
    r"(?:\s(?:also|clearly|definitely|certainly|thus|therefore))?\s{0,2}"
    r"|\s{0,2}[:.)\u2013\u2014-]\s{0,3})"
    r"(?:(?i:incorrect|wrong|false\b|impossible|unlikely|excluded|eliminated|ruled out|out\b)"
    r"|(?i:not)\b(?!\s(?:option\s)?\(?[A-Z]\b)|(?i:no)\b(?!\s[a-z]))"
    r"|[)\]}*_`\"']{0,3}\s{1,2}(?:isn['\u2019]t|doesn['\u2019]t|can['\u2019]t|cannot|differs|fails)\b",
)
"""What stands behind a letter that a reply begins with to turn it down."""
REJECTS = words(
    r"\b(?:not|no|neither|nor|never|none|cannot|wrong|incorrect|impossible|except|differs?|lacks?"
    r"|unlike|exclud\w+|eliminat\w+|rul(?:e|es|ed|ing) out|mismatch\w*)\b|n['\u2019]t\b"
)
DANGLES = words(
    r"(?:[,;:\-]|\b(?:which|that|the|an?|and|or|is|are|of|to|with|because|so|but|in|on|as|has))\Z"
)
"""What no sentence ends with: the reply was cut off."""
