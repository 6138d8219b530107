"""Words by which replies announce plans, parts, choices, refusals and what is no plan."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

from phyblock.parsing.speech import TAKES_BACK, words

__all__ = [
    "AGAIN",
    "BLOCK_WORD",
    "CATALOGUE_WORD",
    "CHOICE",
    "CORRECTS",
    "DOWNWARD",
    "EXAMPLE",
    "EXPLANATION",
    "FINAL_LABEL",
    "HEADING_CHARS",
    "LABEL_CHARS",
    "LAYERS",
    "NOT_MEANT",
    "NOT_REVERSED",
    "OFFER",
    "OPTION",
    "ORDINALS",
    "OR_ELSE",
    "PART",
    "PLAN_WORD",
    "REVISION",
    "SUPPOSED",
]

PLAN_WORD = re.compile(
    r"order|sequence|plan\b|assembl|build|\bsteps?\b|instruction|answer|solution|\bmoves?\b"
    r"|placement|construct|result|final list"
    r"|reihenfolge|anleitung|antwort|schritt|aufbau|ordre|étapes|réponse|orden|pasos|respuesta"
    r"|secuencia|ordine"
    r"|bottom[- ](?:to|up)|from the (?:bottom|ground)|von unten|从下到上|порядок|план|ответ"
    r"|顺序|步骤|答案"
    r"|计划|方案|顺|序列|手順|順序|순서",
    re.IGNORECASE,
)
CATALOGUE_WORD = re.compile(
    r"dictionary|catalog|required|needed|\bselect|candidate|available|inventory|\bused\b|indices"
    r"|identif|distractor"
    r"|unused|legend|analysis|possible|not needed|leftover|remaining|options|extra|benötigt"
    r"|verfügbar|übrig|nécessaires"
    r"|necesarios|需要|可用|候选|清单|未使用|多余|剩余",
    re.IGNORECASE,
)
FINAL_LABEL = re.compile(
    r"(?:final|answer|plan|order|sequence|antwort|reihenfolge|respuesta|réponse|ответ|答案|顺序"
    r"|步骤|\b(?:so|thus|hence|therefore))\W*\Z",
    re.IGNORECASE,
)
EXAMPLE = re.compile(
    r"(?:\bexample\b|\be\.g\.|for instance|\bsample (?:output|answer|plan)|beispiel|\bejemplo"
    r"|\bexemple|例如|示例|例)[^.!?。]{0,40}\Z",
    re.IGNORECASE,
)
NOT_MEANT = re.compile(
    r"(?:\b(?:wrong|incorrect|invalid|bad|mistaken|rejected|falsch\w{0,2})\b[^.!?]{0,40}|^\W*(?:if"
    r"|unless|falls|wenn)\b[^.!?]{0,80}|\b(?:orders|sequences|plans)\b(?: \w{1,12}){0,3})"
    r"[:：]\W*\Z",
    re.IGNORECASE,
)
EXPLANATION = re.compile(
    r"expla(?:in|nation)|rationale|reasoning|justif|verif|\bcheck|validat|\bwhy\b|\bnotes?\b"
    r"|remark|stability|überprüf|验证|检查|erklärung|begründung|解释|说明",
    re.IGNORECASE,
)
_KIND = (
    r"(?:plan|option|alternative|variante?|solution|approach|version|possibility|reading"
    r"|interpretation|scenario|hypothesis|lösung|lesart|方案)"
)
_NAME = r"(?:[A-D]|[1-4]|one|two|three|I{1,3})\b"
OPTION = re.compile(rf"\b(?P<kind>{_KIND})\s{{0,2}}#?(?P<name>{_NAME})", re.IGNORECASE)
OR_ELSE = re.compile(
    r"^\W*(?:or|oder|ou|或者?|alternativ\w*|another (?:valid |possible )?\w+|or (?:else"
    r"|alternatively).{0,40})\b\W*",
    re.IGNORECASE,
)
CHOICE = re.compile(
    r"\b(?:choose|chose|pick|select|prefer|recommend|go(?:ing)? with|went with|use|best|better"
    r"|final|submit|take|answer is|wähle|nehme|entscheide|选择?|采用)"
    rf"[^.\n]{{0,40}}?{_KIND}\s{{0,2}}#?(?P<a>{_NAME})"
    rf"|\b{_KIND}\s{{0,2}}#?(?P<b>{_NAME})"
    r"\s(?:is|seems|looks|ist|wins)\s?(?:the |my |more |clearly |a )?(?:better|best|final|correct"
    r"|right|stable|preferred|chosen|answer|one|besser|richtig)"
    rf"|\b{_KIND}\s?#?(?P<c>[A-D]|[1-4])\s?[(,:\-\u2013]{{1,2}}\s?"
    r"(?:better|best|chosen|final|recommended|preferred)\b"
    r"|\b(?:decision|choice|winner|entscheidung|wahl)\W{1,4}(?:is\s)?(?P<d>[A-D])\b(?!\w)"
    r"|\b(?:choose|pick|select|prefer|recommend|go(?:ing)? with|submit|take)\s(?:the\s)"
    r"(?P<e>first|former|second|latter)\b",
    re.IGNORECASE,
)
ORDINALS = {"first": 0, "former": 0, "second": 1, "latter": 1}
"""Which of two options a choice by place takes."""
REVISION = words(
    TAKES_BACK,
    r"final|correct|revis|updat|actual|summar|complete|overall|optimi|improv|attempt|error"
    r"|\btry\b|new plan|reconsider|\b(?:instead|answer|again|better|so|thus|therefore|output)\b",
)
CORRECTS = words(
    TAKES_BACK,
    r"\b(?:(?:should|must|has to|needs to) be|should (?:have been|read)|swap(?:ped)?|sondern"
    r"|muss)\b"
    r"|(?:^|[.;:!,]\s)(?:replace|insert|change)\s|应该是|改为|正しくは",
)
"""That something else is to stand where something stands, in a line that says what by number."""
PART = re.compile(
    r"structure|layer|level|\b(?:left|right|cent(?:er|re)|middle|upper|lower|bottom|top|base|part"
    r"|section|component|side"
    r"|tower|building|house|second|third|next|then|phase|stage|step)\b|\bstep\s?\d|schicht|ebene"
    r"|teil|turm|层|部分",
    re.IGNORECASE,
)
HEADING_CHARS = 80
OFFER = re.compile(
    r"\b(?:would you like|do you want|shall i|should i|may i|let me know (?:if|whether) (?:i"
    r"|you want me)"
    r"|soll ich|möchten sie)\b[^?.\n]{0,80}\b(?:order|plan|steps?|sequence|list|reihenfolge"
    r"|schritte)\b",
    re.IGNORECASE,
)
"""That the plan itself would come only if it is asked for."""
SUPPOSED = re.compile(
    r"would|could|generic|hypothetical|in general|typical|illustrat|placeholder|candidates",
    re.IGNORECASE,
)
AGAIN = re.compile(
    r"\brepeat (?:the |this |these )?(?:above |same |whole )?(?:assembly |building )?(?:order|steps"
    r"|sequence|plan|instructions)\b"
    r"[^.\n]{0,30}\b(?:for|to build) (?:the )?(?:second|other)\b",
    re.IGNORECASE,
)
NOT_REVERSED = re.compile(
    r"\b(?:not|never|don't|do not|isn't|no need|take (?:it|them) apart|dis\w+|undo"
    r"|remov\w+)\b[^.\n]{0,40}revers|\breverse of (?:it|this|that|the above)\b",
    re.IGNORECASE,
)
DOWNWARD = re.compile(
    r"top[- ](?:to|down)[- ]?(?:bottom)?\b|\b(?:from|at) the top\W*\Z|von oben nach unten"
    r"|从上到下|de haut en bas"
    r"|de arriba (?:a"
    r"|hacia) abajo",
    re.IGNORECASE,
)
LABEL_CHARS = 20
BLOCK_WORD = re.compile("block|index|indices", re.IGNORECASE)
LAYERS = re.compile(
    r"\W*(?:(?:the )?(?:bottom|ground|base|first)\b|(?:layer|level|ebene|schicht|层) ?1)",
    re.IGNORECASE,
)
