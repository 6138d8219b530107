"""How a text names blocks by number, and how many: ranges and multiplicities are counted out.

"blocks 1-3" names 1, 2, 3, "block 6 (x2)" 6, 6, and "block 5 or 6" 5: of alternatives the first one
counts.
"""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

from phyblock.parsing.speech import words
from phyblock.parsing.text_forms import number_of_word

__all__ = [
    "GROUP",
    "MENTION",
    "MOST_AT_ONCE",
    "SAYS_NUMBER",
    "STATEMENT_CHARS",
    "TIMES",
    "VERB",
    "counted",
    "named_blocks",
]

MOST_AT_ONCE = 22
"""Blocks that one statement moves at most: longer ranges and multiplicities are none."""
STATEMENT_CHARS = 600

VERB = (
    r"(?:\b(?:mov(?:e[sd]?|ing)|plac(?:e[sd]?|ing)|put(?:s|ting)?|add(?:s|ed|ing)?|stack(?:s|ed"
    r"|ing)?|position(?:s|ed|ing)?(?=\s(?:the|a|block|index|#))|set(?:s|ting)?|us(?:e[sd]?|ing)"
    r"|lay(?:s|ing)?|insert(?:s|ed|ing)?|attach(?:es|ed|ing)?|install(?:s|ed|ing)?|drop(?:s|ped)?"
    r"|pick(?:s|ed)?(?: up)?|take|grab|(?:start|begin|continue|finish|end)(?:e?s|ing)? with|stand"
    r"|beweg(?:e|en|t)|verschieb(?:e|en|t)|platzier(?:e|en|t)|leg(?:e|en|t)|setz(?:e|en|t)"
    r"|stell(?:e|en|t)|nimm|nehme|stapel[en]|stapl\w{1,3}|füge|déplace[rz]?|place[rz]|pose[rz]?"
    r"|met(?:s|tre|tez)|ajoute[rz]?|empile[rz]?|m(?:ue|o)v(?:e|o|er|a)|coloc(?:a(?:r|mos)?|o)"
    r"|coloque|pon(?:er|go|ho)?|añad(?:e|ir|o)|apil(?:ar?|o)|spost(?:are?|o)|posizion(?:are?|o)"
    r"|mett[io]|aggiung[io]|перемест\w{1,5}|(?:по)?став\w{1,5}|полож\w{1,5}|возьм\w{1,5}|кладу)\b"
    r"|移动|移動|放置|摆放|放入|放|搬|(?<!未)使用|取出|将|把|置く|置|積む|옮|놓)"
)
_NOUN = (
    r"(?:(?:ind(?:ex(?:es)?|ices|izes)|idx|índices?|indices?|blocks?|bloques?|blocs?|blocco|blocchi"
    r"|blöcken?|blocos?|candidates?|kandidat(?:en)?|pieces?|bricks?|cubes?|arch(?:es)?|cylinders?"
    r"|bausteine?n?|steine?|klotz|klötze|piezas?|peças?|pièces?|numbers?|número|numéro|numero"
    r"|nummern?|no\.?|nr\.?|n°|ids?|блоки?|блока|кубик|индекс(?:ом)?|номер)(?![a-zа-я])"
    r"|积木|方块|木块|块|编号|索引|序号|ブロック|インデックス|番号|블록|번호)"
)
_PLURAL = words(
    r"\b(?:ind(?:ices|exes|izes)|blocks|cubes|arches|cylinders|pieces|bricks|candidates|numbers|ids"
    r"|blöcken?|bausteinen?|steinen?"
    r"|klötze|bloques|blocs|blocos|blocchi|piezas|peças|pièces|блоки)\b|积木|方块|木块|块"
)
_WORD_NUMBER = (
    r"(?:one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|thirteen|fourteen|fifteen"
    r"|sixteen|eins|zwei|drei|vier|fünf|sechs|sieben|acht|neun|zehn|elf|zwölf|un|deux|trois|quatre"
    r"|cinq|sept|huit|neuf|dix|uno|dos|tres|cuatro|cinco|seis|siete|ocho|nueve|diez|десять|один|два"
    r"|три|четыре|пять|шесть|семь|восемь|девять)(?!\w"
    r"|\s(?!(?:on|onto|to|at|and|then|next|in|beside|above|over|across|between|as|is|goes|comes|or|first|auf|und|et"
    r"|y)\b)[^\W\d])|[一二三四五六七八九十]{1,2}(?![号號番\w])"
)
_EACH = (
    r"(?:(?:on|at|for|in)\s)?(?:each|either|both|every|auf jeder|an jeder)\s(?:of\s)?(?:the\s)?"
    r"(?:sides?|ends?|seite|corners?|ecke)\b"
)
_MULTIPLIED = r"[x×]\s(?!\d{1,2}\b(?!\s?(?:[x×]|[cm]?m\b)))"
"""A sign behind a number that says how many; "block 6 × 2" says so behind it."""
_UNIT = (
    rf"(?!\s?(?:{_MULTIPLIED}|times?\b|mal\b|fois|veces|cm|mm|m\b|°|degrees?\b|%|次|个|块|more\b))"
)
_SHARED_OUT = rf"\s?(?:per\b|{_EACH})"
"""What stands behind a number that says how many; a number that is called a block's is none."""
_SO_MANY_EACH = re.compile(_SHARED_OUT, re.IGNORECASE)
_NAMED = rf"[0-9]{{1,6}}(?![0-9]|\.[0-9]|[a-wyz]){_UNIT}"
_DIGITS = rf"{_NAMED}(?!{_SHARED_OUT})"
_TO = r"\s{0,2}(?:-|\u2013|\u2014|~|\bto\b|\bthrough\b|\bthru\b|\bbis\b|至|到)\s{0,2}"
_OR = r"\s{0,3},?\s{0,3}(?:\bor\b|\boder\b|\bou\b|/|或者?)\s{0,3}"
_AND = (
    r"\s{0,3}(?:, ?(?:and|then|und)\b|,|、|&|\+|\band then\b|\band\b|\bund\b|\bet\b|\by\b|\bthen\b"
    r"|和|与|及)\s{0,3}"
)
_LINK = rf"(?:{_OR}|{_TO}|{_AND})#?"
GROUP = (
    rf"(?P<first>{_NAMED}|{_WORD_NUMBER})"
    rf"(?P<more>(?:{_LINK}{_DIGITS}|\s(?:and|und|et|y|和)\s{_NAMED}){{0,40}})"
)
_NEXT = (
    r"(?:\b(?:then|finally|lastly|afterwards|followed by|dann|danach|zuletzt|puis|ensuite|enfin"
    r"|luego|después)\b|然后|接着|最后)"
)
"""Words behind which a number alone goes on with what is moved."""
_GOES_ON = (
    r"(?:on|onto|to|at|next|and|then|in|into|beside|over|above|across|along|alongside|atop|upon"
    r"|against|between|behind|under|around|down(?! from)|as|last|again|once|twice|also|too|now"
    r"|directly|first(?!-|\s(?:layer|level|row))|auf|und|noch|quer|darauf|darüber|daneben|zuerst"
    r"|hin|sur|et|sobre|y|encima|su|e|accanto|sopra|em)\b"
)
"""Words behind a number alone that is a block's; one that says how many has a noun behind it."""
_BETWEEN = r"[\s:=#(\[{<.\-→]{0,5}"
MENTION = words(
    rf"(?<![a-zа-я])(?P<noun>{_NOUN}(?:{_BETWEEN}(?:with|mit|the|of|is|ist|est|es|con|avec|com|dem"
    rf"|der|el|le|为|是|{_NOUN})){{0,4}}{_BETWEEN}){GROUP}"
    rf"|(?P<call>{VERB}(?:[ ]?block)?\s?[(\[]\s{{0,3}}(?:(?:block|id|index"
    rf"|n)\s?[=:]\s?)?#?)(?P<called>[0-9]{{1,6}})(?=\s{{0,3}}[,)\]])|(?P<verb>{VERB}\s(?:(?:the"
    rf"|first|then|now|zuerst|dann|jetzt"
    rf"|nun)\s){{0,2}}#?)(?P<moved>{_DIGITS}(?:{_AND}{_DIGITS}){{0,40}})(?=\s{{0,3}}(?:\Z"
    rf"|[.,;:()\u2014\u2013]|{_GOES_ON}))"
    rf"|(?P<then>{_NEXT}\s?#?)(?P<next>{_DIGITS}(?:{_AND}{_DIGITS}){{0,40}})(?=\s{{0,3}}(?:\Z"
    rf"|[.,;:()，。；\u2014\u2013]|{_GOES_ON}|goes\b))"
    r"|(?:(?<=\()#?(?=[0-9][^()]{0,40}\))|(?<!\w)#)(?P<bare>[0-9]{1,6}(?:(?:, ?|\s?&\s?|/| or "
    r"|,? and | und |、)[0-9]{1,6}){0,8})(?=\s?(?:[,;:)/\]×→]|\Z)|\sx\s?\d|(?<=#\d)(?!\w)"
    r"|(?<=#\d\d)(?!\w))(?!\.[0-9])"
    r"|(?P<cjk>[0-9]{1,6}(?:(?:、|,|和|-|至|到)[0-9]{1,6}){0,20})(?=\s?(?:号|號|番|번))"
)
_GOES = (
    r"(?:(?:goes|comes|is|are|must|be|placed|put|used|needed|on|in|at|onto|it|them|there)\s){0,6}"
)
TIMES = words(
    r"[\s)\]}]{0,3}(?:\s?\([^()\d\n]{0,60}\))?[\s,]{0,2}[(\[]?\s?(?:[x×]\s?(?P<a>\d{1,2}"
    r")(?!\d)|(?P<b>\d{1,2})\s?(?:[x×](?!\w)|of (?:them|these)\b|copies\b|pieces\b|times\b"
    rf"|mal\b|fois\b|veces\b|次)|{_GOES}(?P<twice>twice|zweimal|deux fois|dos veces|两次|二次)"
    r"|(?P<thrice>thrice|dreimal|三次)|[号號番]?(?P<cjk>[两二三四五六])[个块個塊]"
    r"|(?P<word>[^\W\d_]{2,8})\s(?:times|mal|fois|veces)\b|(?:(?P<each>\d{1,2})"
    rf"|(?P<each_word>one|two|eine[rn]?|zwei))\s(?:\w{{2,8}}\s)?{_EACH})"
)
_SO_MANY = words(
    r"(?:(?P<twice>\b(?:twice|zweimal|deux fois|dos veces)\s|两次)|(?P<n>\d{1,2})\s?(?:[x×]|times"
    r"|mal|个|块)\s{0,2}|(?P<cjk_word>[二两三四五六])(?:个|块)|\b(?P<word>two|three|four|five|six"
    r"|zwei|drei|vier|deux|trois|quatre|dos|tres|cuatro|due|tre|quattro|dois|duas|três|quatro|два"
    r"|две|три|четыре)\s(?:\w{2,12}\s){0,3}?)\(?\Z"
)
_OF_KIND = words(r"\b(?:of|with|mit|index)\b")
_SO_MANY_OF = words(
    r"(?<!step )(?<!layer )(?<!level )(?<!row )(?<!stage )(?<!phase )(?<!height )(?<!position )"
    r"(?<![\d.,])(?<![x×] )\b(?P<n>\d{1,2})(?!\s?(?:[cdm]?m|in(?:ch(?:es)?)?|ft|feet|foot|units?"
    r"|deg(?:rees?)?|percent|layers?|levels?|rows?|steps?)\b)"
    rf"\s(?:(?!{VERB})[^\W\d]{{2,12}}\s){{0,2}}\Z"
)
"""How many, before several blocks of one number: "2 blocks of index 6"; a length is no count."""
_CORNER = words(r"corner|ecke")
SAYS_NUMBER = words(rf"\d|{_WORD_NUMBER}")


def named_blocks(text: str) -> set[int]:
    """The blocks that a text calls blocks, whatever it says of them."""
    mentions = MENTION.finditer(text[:STATEMENT_CHARS])
    return {
        number
        for mention in mentions
        if mention["noun"] or mention["cjk"] or mention["call"]
        for number in counted(mention, text)
    }


def counted(mention: re.Match[str], text: str) -> list[int]:
    """The numbers of a mention, ranges and multiplicities counted out."""
    groups = mention.groupdict()
    noun = groups.get("noun") or ""
    plain = next(filter(None, (groups.get(name) for name in _PLAIN)), "")
    first = groups.get("first") or ""
    word = number_of_word(first)
    more = groups.get("more") or ""
    given = plain or (first if word is None else str(word)) + more
    is_plural = bool(_PLURAL.search(noun))
    if is_plural and not more and _SO_MANY_EACH.match(text, mention.end()):
        return []
    numbers = _group(given, is_plural=is_plural or bool(groups.get("cjk")))
    times = _times(text, mention)
    if times == 1 and is_plural and _OF_KIND.search(noun):
        many = _SO_MANY_OF.search(text[: mention.start()])
        times = min(int(many["n"]), MOST_AT_ONCE) if many else 1
    return numbers * times if len(numbers) == 1 else numbers


_PLAIN = ("moved", "next", "bare", "cjk", "called")
"""Groups of a mention that hold its numbers alone."""
_SIGNED = re.compile(r"(?P<sign>[^\d]*)(?P<number>\d{1,6})")


def _group(given: str, *, is_plural: bool) -> list[int]:
    """The numbers of "1, 2 and 5", "1-4" or "5 or 6"; of one block "5/6" are alternatives, too."""
    numbers: list[int] = []
    parts = list(_SIGNED.finditer(given))
    signs = [part["sign"].strip(" #,").lower() for part in parts]
    if any(sign in _OR_SIGNS or (sign == "/" and not is_plural) for sign in signs[1:]):
        return [int(parts[0]["number"])]
    for part, sign in zip(parts, signs, strict=True):
        number = int(part["number"])
        if numbers and sign in _TO_SIGNS:
            if not is_plural or not 0 < number - numbers[-1] < MOST_AT_ONCE:
                return numbers
            numbers += range(numbers[-1] + 1, number + 1)
        else:
            numbers.append(number)
    return numbers


_OR_SIGNS = {"or", "oder", "ou", "或", "或者"}
_TO_SIGNS = {"-", "\u2013", "\u2014", "~", "to", "through", "thru", "bis", "至", "到"}


def _times(text: str, mention: re.Match[str]) -> int:
    after = TIMES.match(text, mention.end())
    if after:
        if after["twice"] or after["thrice"]:
            return 2 if after["twice"] else 3
        if after["each"] or after["each_word"]:
            n = int(after["each"] or number_of_word(after["each_word"]) or 1)
            places = 4 if _CORNER.search(after[0]) else 2
            return min(n * places, MOST_AT_ONCE)
        word = number_of_word(after["word"] or after["cjk"] or "")
        return min(word or int(after["a"] or after["b"] or 1), MOST_AT_ONCE)
    before = _SO_MANY.search(text[max(0, mention.start() - 60) : mention.start()])
    if before is None:
        return 1
    if before["twice"]:
        return 2
    spelled = number_of_word(before["word"] or before["cjk_word"] or "")
    return min(int(before["n"] or 0) or spelled or 1, MOST_AT_ONCE)
