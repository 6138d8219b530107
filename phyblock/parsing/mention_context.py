"""What stands round the mention of a block and says whether it is moved.

Supports, places, negations, and what joins one mention to the next.
"""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

from phyblock.parsing.mention import VERB
from phyblock.parsing.speech import words

__all__ = [
    "ALSO_CALLED",
    "ALSO_SUPPORT",
    "AND_THEN",
    "HERE",
    "INSTEAD",
    "JOINS",
    "NEGATED",
    "PIECES",
    "PIECE_VERB",
    "STANDS",
    "SUPPORT",
    "WHEN_PLACED",
]

HERE = words(
    r"\b(?:on top(?! of)|(?:on|in|at|to|from|under) (?:the |its )?(?:left|right|ground|floor|table"
    r"|bottom|base|middle|center|centre|top|front|back|rear|side|first|second|third"
    r"|next)(?: (?:side|layer|half|level|row|end|structure|position|corner))?(?! (?:of|block"
    r"|cube))|(?:auf|an) (?:den|dem) (?:boden|tisch|grund|untergrund))\b|在[^\d\W]{0,8}?(?:上面?"
    r"|上方|顶部|旁边|之间|中间|[左右]边|地面)(?=[放移摆搭])"
)
SUPPORT = words(
    r"(?:\b(?:on top of|on|onto|upon|atop|over|above|under|underneath|below|beneath|beside|besides"
    r"|next to|near|between|against|behind|in front of|adjacent to|touch\w{0,3}|support(?:s|ed by"
    r"|ing)?|rest(?:s|ing)? on|(?:left|right|top|side|front|edges?|ends?|cent(?:er|re)|middle|back"
    r"|rear) of|relative to|connect\w{0,3}|bridg\w{1,3}|span(?:s|ning)?|across|alongside|to|toward"
    r"|(?:align\w{0,3}|flush|level|contact|parallel) with|instead of|rather than|not|never|don't"
    r"|without|except|like|as with|same as|before|after|once(?! ?[,;]| and)|until|when|if|since"
    r"|because|while|so that|auf|über|unter|neben|zwischen|hinter|vor|statt|nicht|ohne|kein\w{0,2}"
    r"|sobre|encima del?|sur|dessus d\w|à côté d\w|entre|debajo de|sopra|accanto|su(?! lado| izq"
    r"| der)|на|над|рядом с|не)\b|在|到|于|不要?|上的|の上)"
    rf"(?:[\s(,]{{0,3}}(?!{VERB}|(?:it|them|both(?=[,;])|then|dann|poi|infine|luego|затем|потом"
    rf"|наконец)\b)[^\W\d]{{1,16}}){{0,7}}[\s(#]{{0,3}}\Z"
)
INSTEAD = words(
    r"(?:instead of|rather than|not|never|don't|without|except|like|as with|same as|if|statt|nicht"
    r"|ohne|kein\w{0,2}|не|不要?)"
)
"""Words of those that tell of a block that it is no part of the plan."""
ALSO_CALLED = re.compile(r"[\s(\[:=\u2013\u2014-]{0,4}")
"""What stands between two names of one block."""
ALSO_SUPPORT = words(
    r"[\s)\]号番]{0,3}(?:,|&|\+|and|und|et|y|和|与|、)[\s,(]{0,3}(?:and\s)?(?:the\s|den\s|le\s|el\s)?"
)
STANDS = words(
    r"[\s)]{0,3}(?:\([^()\n]{0,40}\)\s?)?(?:as (?:a |the |its )?(?:support|reference|anchor)\b"
    r"|(?:below|beneath|underneath)(?=\s?[,;]|\Z)"
    r"|(?:is )?already\b|(?:being |is |is now )?in place\b)"
)
"""What stands behind a block that is there already."""
WHEN_PLACED = words(
    rf"\b(?:after|once|having|before|nachdem|bevor)\s(?:\w{{1,12}}\s){{0,2}}?{VERB}[^,;]{{0,40}}\Z"
)
"""What stands before a block that another step places."""
NEGATED = words(
    rf"(?:\b(?:not|never|avoid|without|cannot|nicht|no|ne|не)\b|n't\b|不要?"
    rf"|别)\s{{0,2}}(?:\w{{1,12}}\s){{0,2}}{VERB}"
    r"[^,;]{0,60}\Z|\b(?:remov\w{1,3}|discard|ignor\w{1,3}|skip|exclud\w{1,3}|reject|leave out"
    r"|avoid|omit|entfern\w{1,3}|unused|spare)\b[^,;]{0,60}\Z"
)
PIECES = re.compile(
    r"(?<=[^\d\s])(?<!\b[Nn][or])[.](?=\s|\Z)|(?<=\d)[.](?=\s\D|\Z)|[;!?。；]"
    r"|,(?=\s{0,2}[^\W\d]{0,12}\s?\bit\b)"
)
PIECE_VERB = words(
    rf"{VERB}|\b(?:then|next(?! to)|finally|lastly|afterwards|dann|danach|zuletzt|darauf"
    r"|daneben|obendrauf|ganz oben|zum schluss|schließlich|puis|ensuite|enfin|luego|por último"
    r"|después|otr[oa]|encore|poi|infine|dopo|depois|por fim|затем|потом|наконец"
    r"|finalmente|and (?:another|one more))\b|然后|最后"
)
JOINS = words(
    rf"(?:[\s,()\]\-→>&+、，。]|[号號番](?=[和与及])|\([^()\n]{{0,80}}\)|\b(?:and|then|und|dann|et|puis"
    rf"|y|luego"
    r"|followed by"
    rf"|finally|also|next|another|again|more|the|a|one|an|(?:red|blue|green|yellow|orange|purple"
    rf"|long|small|large|vertical|horizontal"
    r"|cube|arch|cylinder|cuboid|prism|triangle|roof|base|pillar|column|beam|bar|bridge|block|index"
    r"|le|la|der|die|das))\b"
    rf"|\b(?:by|first|last|finish(?:ing)?)\b|然后|接着|最后|和|再|{VERB}){{1,16}}\Z"
)
AND_THEN = words(
    rf"[,&+→>、，]|\b(?:and|then|und|dann|et|puis|y|luego|by|finally|also|next)\b|然后|和|{VERB}"
)
