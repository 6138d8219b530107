"""How replies state an answer, correct themselves, turn an option down, or say that they cannot."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

__all__ = [
    "BRANDED",
    "CHOSEN",
    "CONCLUDED",
    "CONFIRMED",
    "CORRECTED",
    "COUNTED",
    "DANGLES",
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
SENTENCE = re.compile(
    rf"(?<![a-z])(?P<lead>(?:final\s)?(?:{_WORDS}))"
    rf"(?:\s(?:choice|option|key|correcta|correcte|correta|corretta))?"
    rf"(?:\sto\s(?:the|this|your)\squestion)?[ \t*_`]{{0,4}}"
    rf"(?:{_IS}|\b(?:would|should|must|has to) be\b)[ \t*_`:]{{0,6}}{_VALUE}",
    re.IGNORECASE,
)
CHOSEN = re.compile(
    r"(?:\bI(?:['\u2019]ll|['\u2019]d| will| would| am going to)?"
    r" (?:choose|pick|select|prefer|go with|answer|say|lean (?:more )?(?:to|towards?))"
    r"|\bmy (?:choice|pick|guess|selection) (?:is|would be)"
    r"|\b(?:correct|right|best) (?:option|choice|one|picture|image|letter|place|match)"
    r"(?: is| would be| must be| should be|:)"
    r"|\b(?:nehme|wähle)(?: aber| daher| also)?|^(?:it )?looks like|\bje choisis|\b(?:elijo"
    r"|escolho|scelgo)"
    r"|我认为(?:答案)?是?|应?(?:该)?选(?:择|项)?(?:是"
    r"|为)?)[ \t*_`:]{0,6}(?=(?P<value>[^\n]{1,80}))",
    re.IGNORECASE,
)
CONFIRMED = re.compile(
    r"(?<![A-Za-z0-9])(?P<value>[A-Z])\)?\?\s{1,2}(?:yes|yep|correct"
    r"|right)\b",
    re.I,
)
"""A question that the reply itself says yes to."""
IS_RIGHT = re.compile(
    r"(?<![A-Za-z0-9'\-])(?P<value>[A-Z])[)\]*_`\"]{0,4}(?:\s?[(:][^()\n]{1,60}\))?"
    r"\s{1,2}(?:is|must be|seems|appears to be) (?:therefore |clearly |definitely |likely )?"
    r"(?:the )?(?:most )?"
    r"(?:correct|right|best|likely|plausible|answer|only (?:one|option|correct))\b"
)
ORDER = re.compile(
    rf"\b(?:order|ordering|sequence|arrangement)(?:\s(?:of|in)\s[^\n.:]{{1,60}}?)?[ \t*_`]{{0,4}}"
    rf"(?::|=|\bis\b|\bwould be\b|\bshould be\b|\bmust be\b)[ \t*_`:]{{0,6}}{_VALUE}",
    re.IGNORECASE,
)
SO = re.compile(
    r"(?:(?:^|[.;,:]\s|\s[\u2013\u2014]\s)(?:and )?(?:so|therefore|thus|hence|but then|also|daher"
    r"|donc)\b,?"
    r"|\bnot\b[^.;,\n]{1,60}\bbut\b)\s(?=(?P<value>[^\n.;]{1,120}))",
    re.IGNORECASE,
)
"""Behind this stands what follows from the rest of a sentence."""
MAKES = re.compile(
    r"[,;]\s(?:(?:but|yet|so)\b[^,;\n]{0,80}?\b(?:is|are|be|makes it|it['\u2019]s)|it is"
    r"|it['\u2019]s)\s"
    r"(?:\w+ly\s){0,2}(?P<value>[^,;\n]{1,80})\Z",
    re.IGNORECASE,
)
"""The clause that a reply ends with, that says what the thing asked for is."""
COUNTED = re.compile(
    r"(?:\b(?:I count|(?:in|a) total(?: of|:| is)|total(?: number)?(?: of \w{1,12})?(?::| is)"
    r"|which (?:gives|makes)|gives|makes?))"
    r"\s{1,2}(?P<a>\d{1,3})\b(?!\s?[+*x×/.\-]\s?\d)"
    r"|(?<![+*/.\d] )\b(?P<b>\d{1,3})(?:\s\w{1,12}){0,2}\s(?:in total|altogether|overall)\b",
    re.IGNORECASE,
)
"""How many there are in all."""
CONCLUDED = re.compile(
    r"(?:\b|(?<=[\s.;]))(?i:(?:\u2192|=>)\s?|(?:it|this|that|which|what(?: is)? left"
    r"|what remains|answer|option|choice|picture"
    r"|image|place)"
    r"(?: must be| has to be| should be| is|['\u2019]s| leaves| matches| corresponds to)"
    r"(?: (?:the |with )?(?:option|picture|image|choice|place))?"
    r"|(?:so|therefore|thus|hence|also|daher|donc|alors|entonces)[:,]?|leaves(?: only)?|only"
    r"|(?:verdict|remaining|conclusion)\s?(?:is|:|=|->|\u2192)|(?:choose|pick|select)|[;,] then"
    r")[ *_`]{0,4}"
    r"(?P<value>\(?[A-Z]\)?)[*_`]{0,3}(?: it is| is left| remains)?"
    r"(?=[\s.!,;]{0,3}(?:\Z|\n|[.!;]))",
)
CORRECTED = re.compile(
    rf"\b(?P<lead>correction|edit|korrektur|final(?: decision| choice)?|更正)\s?[:：]{_VALUE}",
    re.IGNORECASE,
)
"""An answer that takes the place of what was said before."""
NOT_BUT = re.compile(
    r"(?:\b(?:not|nicht|no es|n't)\s|不是)(?:option )?\(?[A-Z]\)?(?:,|，)?\s?"
    r"(?:(?:but|sondern|es|it's|it is)\s|而是)(?:option )?(?P<value>\(?[A-Z]\)?(?![A-Za-z]))"
)
"""Not this but that: what is meant is that."""
QUOTED = re.compile(
    rf"(?<=[\w:] )[\"'\u201c\u00ab](?:[^\"'\u201d\u00bb\n]{{0,40}}?(?:{_WORDS})\s?[:：]"
    r"[^\"'\u201d\u00bb\n]{0,40})[\"'\u201d\u00bb]",
    re.IGNORECASE,
)
"""An answer in quotation marks within a sentence: somebody else's words."""
TURNED = re.compile(
    r"(?:\b(?:but|however|actually|yet|aber|doch)\b|但是?|不过)[^\n]{0,100}?(?:\b(?:is|be|ist)\s"
    r"|是)(?:option )?"
    r"\(?(?P<value>[A-Z])\)?\s{0,2}(?=[.!;。]|\Z)",
    re.IGNORECASE,
)
"""A turn away from the stated answer: "I would answer A, but the picture shows that it is D"."""
VERDICT = re.compile(
    r"(?:^|[.;,:]\s|(?<=[✓✔✅✗✘❌×])\s"
    r"|\n)[\s*\-_(\[]{0,6}(?:option )?(?P<letter>[A-Z])[*_)\]]{0,3}"
    r"(?:\s?[:.]\s[^\n\u2013\u2014:]{1,40}?\s(?=[\-\u2013\u2014]))?"
    r"\s?[:.\-\u2013\u2014]?\s{0,3}"
    r"(?:(?P<yes>✓|✔|✅|☑|(?:yes|correct|matches|fits|right|true)\b)|(?:✗|✘|❌|×|☒|(?:no|wrong"
    r"|incorrect|false|does not|doesn't|not)\b))",
    re.IGNORECASE,
)
JSON = re.compile(
    r"[\"'](?:final[_ ]?)?(?:answer|choice|option|selected_option|order|ordering|letter)[\"']"
    r"\s{0,4}:\s{0,4}(?P<value>\[[^\[\]]{1,120}\]|\"[^\"\n]{0,200}\"|'[^'\n]{0,200}'|\d{1,4}\b)",
    re.IGNORECASE,
)
BRANDED = re.compile(
    r"\((?P<a>[A-Z])\)|\*\*\(?(?P<b>[A-Z])[).:]?\*\*"
    r"|\b(?:[Oo]ption|[Cc]hoice|[Pp]icture|[Ii]mage|[Ll]etter|[Pp]osition|[Ss]pot|[Ll]ocation)s?"
    r"[ *_`(\"']{1,4}(?P<c>[A-Z])(?![A-Za-z0-9'\-])"
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
REJECTS = re.compile(
    r"\b(?:not|no|neither|nor|never|none|cannot|wrong|incorrect|impossible|except|differs?|lacks?"
    r"|unlike|exclud\w+|eliminat\w+|rul(?:e|es|ed|ing) out|mismatch\w*)\b|n['\u2019]t\b",
    re.IGNORECASE,
)
DANGLES = re.compile(
    r"(?:[,;:\-]|\b(?:which|that|the|an?|and|or|is|are|of|to|with|because|so|but|in|on|as|has))\Z",
    re.IGNORECASE,
)
"""What no sentence ends with: the reply was cut off."""
