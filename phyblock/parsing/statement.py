"""What one statement of a reply moves: the numbers of the blocks that it names, and how firmly.

"On top of block 3, move blocks 5 and 6 (x2)" moves 5, 6, 6: block 3 is a support. Ranges and
multiplicities are counted out; of alternatives the first one counts; what is said not to be moved
is not.
"""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import functools
import re
from dataclasses import dataclass, field

from phyblock.parsing.text_forms import number_of_word

__all__ = ["MOST_AT_ONCE", "VERB", "Statement", "chain", "named_blocks", "read_statement"]

MOST_AT_ONCE = 22
"""Blocks that one statement moves at most: longer ranges and multiplicities are none."""
_STATEMENT_CHARS = 600

VERB = (
    r"(?:\b(?:mov(?:e[sd]?|ing)|plac(?:e[sd]?|ing)|put(?:s|ting)?|add(?:s|ed|ing)?|stack(?:s|ed"
    r"|ing)?"
    r"|position(?:s|ed|ing)?(?=\s(?:the|a|block|index|#))|set(?:s|ting)?|us(?:e[sd]?|ing)|lay(?:s"
    r"|ing)?|insert(?:s|ed|ing)?"
    r"|attach(?:es|ed|ing)?|install(?:s|ed|ing)?|drop(?:s|ped)?|pick(?:s|ed)?(?: up)?|take|grab"
    r"|(?:start|begin)(?:s|ing)? with|stand"
    r"|beweg(?:e|en|t)|verschieb(?:e|en|t)|platzier(?:e|en|t)|leg(?:e|en|t)|setz(?:e|en|t)"
    r"|stell(?:e|en|t)|nimm|nehme|stapel[en]|stapl\w{1,3}|füge"
    r"|déplace[rz]?|place[rz]|pose[rz]?|met(?:s|tre|tez)|ajoute[rz]?|empile[rz]?"
    r"|mueve|mover|coloca(?:r|mos)?|coloque|pon(?:er)?|añad(?:e|ir)|apila[r]?|mova|sposta(?:re)?"
    r"|posiziona(?:re)?|metti|aggiungi|перемест\w{1,5}|постав\w{1,5}|полож\w{1,5}|возьм\w{1,5})\b"
    r"|移动|移動|放置|摆放|放入|放|搬|(?<!未)使用|取出|将|把|置く|置|積む|옮|놓)"
)
_NOUN = (
    r"(?:(?:ind(?:ex(?:es)?|ices|izes)|idx|índices?|indices?|blocks?|bloques?|blocs?|blocco|blocchi"
    r"|blöcken?|blocos?|candidates?|kandidat(?:en)?|pieces?|bricks?|cubes?|arch(?:es)?|cylinders?"
    r"|bausteine?n?|steine?|klotz|klötze|piezas?|peças?|pièces?|numbers?|número|numéro|numero"
    r"|nummern?|no\.?|nr\.?|n°|ids?|блоки?|блока|кубик|индекс(?:ом)?|номер)(?![a-zа-я])"
    r"|积木|方块|木块|块|编号|索引|序号|ブロック|インデックス|番号|블록|번호)"
)
_PLURAL = re.compile(
    r"\b(?:ind(?:ices|exes|izes)|blocks|cubes|arches|cylinders|pieces|bricks|candidates|numbers|ids"
    r"|blöcken?|bausteinen?|steinen?"
    r"|klötze|bloques|blocs|blocos|blocchi|piezas|peças|pièces|блоки)\b|积木|方块|木块|块",
    re.IGNORECASE,
)
_WORD_NUMBER = (
    r"(?:one|two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|thirteen|fourteen|fifteen"
    r"|sixteen|eins|zwei|drei|vier|fünf|sechs|sieben|acht|neun|zehn|elf|zwölf|un|deux|trois|quatre"
    r"|cinq|sept|huit|neuf|dix|uno|dos|tres|cuatro|cinco|seis|siete|ocho|nueve|diez|десять|один|два"
    r"|три|четыре|пять|шесть|семь|восемь|девять)(?!\w"
    r"|\s(?!(?:on|onto|to|at|and|then|next|in|beside|above|over|as|is|goes|or|first|auf|und|et|y)\b)[^\W\d])|[一二三四五六七八九十]{1,2}(?![号號番\w])"
)
_EACH = (
    r"(?:(?:on|at|for|in)\s)?(?:each|either|both|every|auf jeder|an jeder)\s(?:of\s)?(?:the\s)?"
    r"(?:sides?|ends?|seite|corners?|ecke)\b"
)
_UNIT = r"(?!\s?(?:[x×]\s|times?\b|mal\b|fois|veces|cm|mm|m\b|°|degrees?\b|%|次|个|块|more\b))"
_SHARED_OUT = rf"\s?(?:per\b|{_EACH})"
"""What stands behind a number that says how many; a number that is called a block's is none."""
_SO_MANY_EACH = re.compile(_SHARED_OUT, re.IGNORECASE)
_NAMED = rf"[0-9]{{1,6}}(?![0-9]|\.[0-9]|[a-wyz]){_UNIT}"
_DIGITS = rf"{_NAMED}(?!{_SHARED_OUT})"
_TO = r"\s{0,2}(?:-|\u2013|\u2014|~|\bto\b|\bthrough\b|\bthru\b|\bbis\b|至|到)\s{0,2}"
_OR = r"\s{0,3},?\s{0,3}(?:\bor\b|\boder\b|\bou\b|/|或者?)\s{0,3}"
_AND = (
    r"\s{0,3}(?:, ?(?:and|then|und)\b|,|、|&|\+|\band then\b|\band\b|\bund\b|\bet\b|\by\b|\bthen\b"
    r"|和"
    r"|与|及)"
    r"\s{0,3}"
)
_LINK = rf"(?:{_OR}|{_TO}|{_AND})#?"
_GROUP = (
    rf"(?P<first>{_NAMED}|{_WORD_NUMBER})"
    rf"(?P<more>(?:{_LINK}{_DIGITS}|\s(?:and|und|et|y|和)\s{_NAMED}){{0,40}})"
)
_NEXT = (
    r"(?:\b(?:then|finally|lastly|afterwards|followed by|dann|danach|zuletzt|puis|ensuite|enfin"
    r"|luego|después)\b|然后|接着|最后)"
)
"""Words behind which a number alone goes on with what is moved."""
_BETWEEN = r"[\s:=#(\[{<.\-→]{0,5}"
_MENTION = re.compile(
    rf"(?<![a-zа-я])(?P<noun>{_NOUN}(?:{_BETWEEN}(?:with|mit|the|of|is|con|avec|com|dem|der|为|是"
    rf"|{_NOUN}))"
    rf"{{0,4}}{_BETWEEN}){_GROUP}"
    rf"|(?P<call>{VERB}(?:[ ]?block)?\s?[(\[]\s{{0,3}}(?:(?:block|id|index|n)\s?[=:]\s?)?#?)"
    rf"(?P<called>[0-9]{{1,6}})(?=\s{{0,3}}[,)\]])"
    rf"|(?P<verb>{VERB}\s(?:the\s)?#?)(?P<moved>{_DIGITS}(?:{_AND}{_DIGITS}){{0,40}})"
    rf"(?=\s{{0,3}}(?:\Z|[.,;:()\u2014\u2013]|(?:on|onto|to|at|next|and|then|in|beside|over|above"
    rf"|auf)\b))"
    rf"|(?P<then>{_NEXT}\s?#?)(?P<next>{_DIGITS}(?:{_AND}{_DIGITS}){{0,40}})"
    r"(?=\s{0,3}(?:\Z|[.,;:()，。；\u2014\u2013]|(?:on|onto|at|next|and|then|in|beside|over|above|as|goes)\b))"
    r"|(?:(?<=\()#?(?=[0-9][^()]{0,40}\))|(?<!\w)#)(?P<bare>[0-9]{1,6}(?:(?:, ?|\s?&\s?|/| or "
    r"|,? and | und |、)[0-9]{1,6}){0,8})(?=\s?(?:[,;:)/\]×→]|\Z)|\sx\s?\d|(?<=#\d)(?!\w)"
    r"|(?<=#\d\d)(?!\w))(?!\.[0-9])"
    r"|(?P<cjk>[0-9]{1,6}(?:(?:、|,|和|-|至|到)[0-9]{1,6}){0,20})(?=\s?(?:号|號|番))",
    re.IGNORECASE,
)
_TIMES = re.compile(
    r"[\s)\]}]{0,3}(?:\s?\([^()\d\n]{0,60}\))?[\s,]{0,2}[(\[]?\s?(?:"
    r"[x×]\s?(?P<a>\d{1,2})(?!\d)|(?P<b>\d{1,2})\s?(?:[x×](?!\w)"
    r"|of (?:them|these)\b|copies\b|pieces\b"
    r"|times\b|mal\b|fois\b|veces\b|次)"
    r"|(?P<twice>twice|zweimal|deux fois|dos veces|两次|二次)|(?P<thrice>thrice|dreimal|三次)"
    r"|[号號番]?(?P<cjk>[两二三四五六])[个块個塊]"
    r"|(?P<word>[^\W\d_]{2,8})\s(?:times|mal|fois|veces)\b"
    rf"|(?:(?P<each>\d{{1,2}})|(?P<each_word>one|two|eine[rn]?|zwei))\s(?:\w{{2,8}}\s)?{_EACH})",
    re.IGNORECASE,
)
_SO_MANY = re.compile(
    r"(?:(?P<twice>\b(?:twice|zweimal|deux fois|dos veces)\s|两次)|(?P<n>\d{1,2})\s?(?:[x×]|times"
    r"|mal|个|块)\s{0,2}|(?P<cjk_word>[二两三四五六])(?:个|块)"
    r"|\b(?P<word>two|three|four|five|six|zwei|drei|vier|deux|trois"
    r"|dos|tres)"
    r"\s(?:\w{2,12}\s){0,3}?)\(?\Z",
    re.IGNORECASE,
)
_HERE = re.compile(
    r"\b(?:on top(?! of)|(?:on|in|at|to|from|under) (?:the |its )?(?:left|right|ground|floor|table"
    r"|bottom"
    r"|base|middle|center|centre|top|front|back|rear|side|first|second|third|next)"
    r"(?: (?:side|layer|half|level|row|end|structure|position|corner))?(?! (?:of|block|cube))"
    r"|(?:auf|an) (?:den|dem) (?:boden|tisch|grund|untergrund))\b"
    r"|在[^\d\W]{0,8}?(?:上面?|上方|顶部|旁边|之间|中间|[左右]边|地面)(?=[放移摆搭])",
    re.IGNORECASE,
)
_SUPPORT = re.compile(
    r"(?:\b(?:on top of|on|onto|upon|atop|over|above|under|underneath|below|beneath|beside|besides"
    r"|next to"
    r"|near|between|against|behind|in front of|adjacent to|touch\w{0,3}|support(?:s|ed by|ing)?"
    r"|rest(?:s|ing)? on"
    r"|(?:left|right|top|side|front|edges?|ends?|cent(?:er|re)|middle|back|rear) of|relative to"
    r"|connect\w{0,3}"
    r"|bridg\w{1,3}|span(?:s|ning)?|across|alongside|to|toward|(?:align\w{0,3}|flush|level|contact"
    r"|parallel) with"
    r"|instead of|rather than|not|never|don't|without|except|like|as with|same as|before|after"
    r"|once(?! ?[,;]| and)"
    r"|until|when|if"
    r"|since|because|while|so that|auf|über|unter|neben|zwischen|hinter|vor|statt|nicht|ohne"
    r"|kein\w{0,2}|sobre"
    r"|encima del?|sur|dessus d\w|à côté d\w|entre|debajo de|sopra|accanto|su(?! lado| izq| der)"
    r"|на|над|рядом с|не)\b"
    r"|在|到|于|不要?|上的|の上)"
    rf"(?:[\s(,]{{0,3}}(?!{VERB}|(?:it|them)\b)[^\W\d]{{1,16}}){{0,7}}[\s(#]{{0,3}}\Z",
    re.IGNORECASE,
)
_INSTEAD = re.compile(
    r"(?:instead of|rather than|not|never|don't|without|except|like|as with|same as|if|statt|nicht"
    r"|ohne|kein\w{0,2}|не|不要?)",
    re.IGNORECASE,
)
"""Words of those that tell of a block that it is no part of the plan."""
_ALSO_CALLED = re.compile(r"[\s(\[:=\u2013\u2014-]{0,4}")
"""What stands between two names of one block."""
_ALSO_SUPPORT = re.compile(
    r"[\s)\]号番]{0,3}(?:,|&|\+|and|und|et|y|和|与|、)[\s,(]{0,3}(?:and\s)?(?:the\s|den\s|le\s|el\s)?",
    re.IGNORECASE,
)
_STANDS = re.compile(
    r"[\s)]{0,3}(?:\([^()\n]{0,40}\)\s?)?(?:as (?:a |the |its )?(?:support|reference|anchor)\b"
    r"|(?:below|beneath|underneath)(?=\s?[,;]|\Z)"
    r"|already\b|(?:being |is )?in place\b)",
    re.IGNORECASE,
)
"""What stands behind a block that is there already."""
_NEGATED = re.compile(
    rf"\b(?:after|once|having|before|nachdem|bevor)\s(?:\w{{1,12}}\s){{0,2}}?{VERB}[^,;]{{0,40}}\Z|"
    rf"(?:\b(?:not|never|avoid|without|cannot|nicht|no|ne|не)\b|n't\b|不要?"
    rf"|别)\s{{0,2}}(?:\w{{1,12}}\s){{0,2}}{VERB}"
    r"[^,;]{0,60}\Z|\b(?:remov\w{1,3}|discard|ignor\w{1,3}|skip|exclud\w{1,3}|reject|leave out"
    r"|avoid|omit|entfern\w{1,3}"
    r"|unused|spare)\b[^,;]{0,60}\Z",
    re.IGNORECASE,
)
_PIECES = re.compile(
    r"(?<=[^\d\s])(?<!\b[Nn][or])[.](?=\s|\Z)|(?<=\d)[.](?=\s\D|\Z)|[;!?。；]"
    r"|,(?=\s{0,2}[^\W\d]{0,12}\s?\bit\b)"
)
_PIECE_VERB = re.compile(
    rf"{VERB}|\b(?:then|next(?! to)|finally|lastly|afterwards|dann|danach|zuletzt|darauf"
    r"|daneben|obendrauf|ganz oben|zum schluss|schließlich|puis|ensuite|enfin|luego|por último"
    r"|finalmente|and (?:another|one more))\b|然后|最后",
    re.IGNORECASE,
)
_JOINS = re.compile(
    rf"(?:[\s,()\]\-→>&+、，。]|[号號番](?=[和与及])|\([^()\n]{{0,80}}\)|\b(?:and|then|und|dann|et|puis|y|luego"
    r"|followed by"
    rf"|finally|also|next"
    rf"|another|again|more|the|a|one|an|(?:red|blue|green|yellow|orange|purple|long|small|large"
    rf"|vertical|horizontal"
    r"|cube|arch|cylinder|cuboid|prism|triangle|roof|base|pillar|column|beam|bar|bridge|block|index"
    r"|le|la|der|die|das))\b"
    rf"|\b(?:by|first|last|finish(?:ing)?)\b|然后|接着|最后|和|再|{VERB}){{1,16}}\Z",
    re.IGNORECASE,
)
_AND_THEN = re.compile(
    rf"[,&+→>、，]|\b(?:and|then|und|dann|et|puis|y|luego|by|finally|also|next)\b|然后|和|{VERB}",
    re.I,
)
_IS_WHOLE = re.compile(
    rf"(?:[^\d:：,.;]{{1,40}}[:：→]\s)?[\s#(\[]{{0,4}}{_GROUP}[\s)\]]{{0,3}}(?=\Z|[(:,;.\-\u2013\u2014|x×])",
    re.IGNORECASE,
)
_CHAIN = re.compile(
    r"[\s(\[{<]{0,4}(?:(?:blocks?|index|indices|candidates?|积木|#)[\s:#]{0,3})?(?P<list>\d{1,6}(?:\s{0,3}"
    r"(?P<sign>,|、|;|·|\||->|→|>|=>|-|\u2013|/|then|and|dann|und|puis|luego|\s)(?:\s?(?:and|then|dann|puis|luego|block|index"
    r"|#)){0,2}[\s#]{0,3}\d{1,6}){0,63})"
    r"[\s)\]}>.]{0,4}\Z",
    re.IGNORECASE,
)
_REMARKS = re.compile(
    r"(?<=\d)[号號番]|\b(?:zuerst|first|d'abord|primero)\b|"
    r"\s{0,3}\([^()\d\n]{0,80}\)|\s(?:→|->|=>|\u2014|\u2013)\s[^\d\n]{1,200}\Z",
    re.IGNORECASE,
)
"""What a list says of its blocks, or behind its end, without a number."""
_NUMBER = re.compile(r"\d{1,6}")
_CORNER = re.compile(r"corner|ecke", re.IGNORECASE)
_SAYS_NUMBER = re.compile(rf"\d|{_WORD_NUMBER}", re.IGNORECASE)


@dataclass(frozen=True)
class Statement:
    """The blocks that a statement moves, in order; whether it says so by a verb.

    `leaves` tells that it names others, too, of which it does not say so; `loose` are blocks that
    it names and of which the grammar does not tell whether they are moved, `supports` those on or
    beside which others are put, `denied` those that are not.
    """

    numbers: tuple[int, ...]
    has_verb: bool = False
    leaves: bool = False
    loose: frozenset[int] = frozenset()
    supports: frozenset[int] = frozenset()
    denied: frozenset[int] = frozenset()


@dataclass
class _Rest:
    """Blocks that a statement names beside those that it moves."""

    loose: set[int] = field(default_factory=set)
    supports: set[int] = field(default_factory=set)
    denied: set[int] = field(default_factory=set)


def read_statement(text: str, *, is_item: bool) -> Statement:
    """What a line without markup moves; in an item of a list (`is_item`) a number alone may do."""
    return _read(text[:_STATEMENT_CHARS], is_item)


# A line is read as an item, as what belongs to one and for its verb, and models repeat themselves.
@functools.lru_cache(maxsize=1024)
def _read(text: str, is_item: bool) -> Statement:
    if not _SAYS_NUMBER.search(text):
        return Statement(())
    text = _HERE.sub(" ", text)
    bare: tuple[int, ...] = ()
    moved: list[int] = []
    rest = _Rest()
    for piece in _pieces(text):
        found = _moved(piece, rest)
        if found and _PIECE_VERB.search(piece):
            moved += found
        elif bare:
            rest.loose.update({*found} - {*bare})
        else:
            bare = tuple(found)
    beside = (frozenset(rest.loose), frozenset(rest.supports), frozenset(rest.denied))
    if moved:
        return Statement(tuple(moved), True, not {*bare} <= {*moved}, *beside)
    whole = _IS_WHOLE.match(text) if is_item else None
    named = tuple(_counted(whole, text, "s")) if whole else bare
    return Statement(named, False, False, *beside)


def chain(text: str) -> tuple[tuple[int, ...], bool]:
    """The numbers of a text of numbers alone ("3, 5, 12"), and whether arrows say the order."""
    found = _CHAIN.match(_REMARKS.sub(" ", text))
    if found is None:
        return (), False
    return tuple(map(int, _NUMBER.findall(found["list"]))), (found["sign"] or "") in (
        "->",
        "→",
        ">",
        "=>",
        "then",
    )


def named_blocks(text: str) -> set[int]:
    """The blocks that a text calls blocks, whatever it says of them."""
    mentions = _MENTION.finditer(text[:_STATEMENT_CHARS])
    return {
        number
        for mention in mentions
        if mention["noun"] or mention["cjk"] or mention["call"]
        for number in _counted(mention, text, mention["noun"] or "")
    }


def _pieces(text: str) -> list[str]:
    pieces, start = [], 0
    for end in _PIECES.finditer(text):
        pieces.append(text[start : end.start()])
        start = end.end()
    return [*pieces, text[start:]]


def _moved(piece: str, rest: _Rest) -> list[int]:
    """The first free mention of a piece, and those that are joined to it; the others are left."""
    found: list[int] = []
    last: re.Match[str] | None = None
    support_end = 0
    for mention in _MENTION.finditer(piece):
        start = mention.start() + len(mention["verb"] or mention["call"] or mention["then"] or "")
        is_call = bool(mention["verb"] or mention["call"] or mention["then"])
        if mention["then"] and last is None:
            continue
        if not is_call and _STANDS.match(piece, mention.end()):
            continue
        before = piece[max(0, start - 120) : start]
        if _NEGATED.search(before):
            rest.denied.update(_counted(mention, piece, mention["noun"] or ""))
            continue
        support = None if is_call else _SUPPORT.search(before)
        if support_end and _ALSO_SUPPORT.fullmatch(piece, support_end, start):
            support_end = mention.end()
            rest.supports.update(_counted(mention, piece, mention["noun"] or ""))
            continue
        if support:
            support_end = mention.end()
            kind = rest.denied if _INSTEAD.match(support[0]) else rest.supports
            if mention["noun"] or mention["cjk"]:
                kind.update(_counted(mention, piece, mention["noun"] or ""))
            continue
        goes_on = mention["then"] or (last and mention["call"] and last["call"])
        if last is not None and not goes_on:
            between = piece[last.end() : start]
            times = _TIMES.match(piece, last.end())
            between = piece[times.end() : start] if times and times.end() <= start else between
            if not (_JOINS.match(between) and _AND_THEN.search(between)) and not (
                _PIECE_VERB.search(between) and not is_call
            ):
                if (mention["noun"] or mention["cjk"]) and not _ALSO_CALLED.fullmatch(between):
                    rest.loose.update(_counted(mention, piece, mention["noun"] or ""))
                continue
        found += _counted(mention, piece, mention["noun"] or "")
        last = mention
    return found


def _counted(mention: re.Match[str], text: str, noun: str) -> list[int]:
    """The numbers of a mention, ranges and multiplicities counted out."""
    groups = mention.groupdict()
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
    after = _TIMES.match(text, mention.end())
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
