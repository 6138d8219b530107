"""Words by which replies announce plans, parts, choices, refusals and what is no plan."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

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

PLAN_WORD = words(
    r"order|sequence|plan\b|assembl|build|\bsteps?\b|instruction|answer|solution|\bmoves?\b"
    r"|placement|construct|result|final list|reihenfolge|anleitung|antwort|schritt|aufbau|ordre"
    r"|étapes|réponse|orden|pasos|respuesta|secuencia|ordine|ordem|bottom[- ](?:to|up|first)"
    r"|from the (?:bottom|ground)|von unten|从下到上|порядок|план|ответ|顺序|步骤|答案|计划|方案"
    r"|顺|序列|手順|順序|순서"
)
CATALOGUE_WORD = words(
    r"dictionary|catalog|required|needed|\bselect|candidate|available|inventory|\bused\b|indices"
    r"|identif|distractor|unused|legend|analysis|possible|not needed|leftover|remaining|options"
    r"|extra|benötigt|verfügbar|übrig|nécessaires|necesarios|需要|可用|候选|清单|未使用|多余|剩余"
)
FINAL_LABEL = words(
    r"(?:final|answer|plan|order|sequence|antwort|reihenfolge|respuesta|réponse|ответ|答案|顺序"
    r"|步骤|\b(?:so|thus|hence|therefore))\W*\Z"
)
EXAMPLE = words(
    r"(?:\bexample\b|\be\.g\.|for instance|\bsample (?:output|answer|plan)|beispiel|\bejemplo"
    r"|\bexemple|例如|示例|例)[^.!?。]{0,40}\Z"
)
NOT_MEANT = words(
    r"(?:\b(?:wrong|incorrect|invalid|bad|mistaken|rejected|discarded|old|previous|earlier"
    r"|falsch\w{0,2}|alte[rn]?|bisherige|ancien\w{0,2}|anterior|vecchi[oa])\b[^.!?]{0,40}"
    r"|^\W*(?:if|unless|falls|wenn)\b[^.!?]{0,80}|\b(?:orders|sequences"
    r"|plans)\b(?: \w{1,12}){0,3})[:：]\W*\Z"
)
EXPLANATION = words(
    r"expla(?:in|nation)|rationale|reasoning|justif|verif|\bcheck|validat|\bwhy\b|\bnotes?\b"
    r"|remark|stability|überprüf|验证|检查|erklärung|begründung|解释|说明"
)
_KIND = (
    r"(?:plan|option|alternative|variante?|solution|approach|version|possibility|reading"
    r"|interpretation|scenario|hypothesis|lösung|lesart|opción|opção|opzione|вариант|方案)"
)
_NAME = r"(?:[A-D]|[1-4]|one|two|three|I{1,3})\b"
OPTION = words(rf"\b(?P<kind>{_KIND})\s{{0,2}}#?(?P<name>{_NAME})")
OR_ELSE = words(
    r"^\W*(?:or|oder|ou|或者?|alternativ\w*|another (?:valid |possible )?\w+|or (?:else"
    r"|alternatively).{0,40})\b\W*"
)
CHOICE = words(
    r"(?:\b|(?=[选采]))(?:choose|chose|pick|select|prefer|recommend|go(?:ing)? with|went with|use"
    r"|best|better|final|submit|take|answer is|wähle|nehme|entscheide|choisis|prends|elijo|escojo"
    r"|scelgo|escolho|выбираю|(?<=我)选择?|选择"
    rf"|采用)[^.\n]{{0,40}}?{_KIND}\s{{0,2}}#?(?P<a>{_NAME})"
    rf"|\b{_KIND}\s{{0,2}}#?(?P<b>{_NAME})\s(?:is|seems|looks|ist|wins)\s?(?:the |my |more "
    r"|clearly |a )?(?:better|best|final|correct|right|stable|preferred|chosen|answer|one|besser"
    rf"|richtig)|\b{_KIND}\s?#?(?P<c>[A-D]|[1-4])\s?[(,:\-\u2013]{{1,2}}\s?(?:better|best|chosen"
    r"|final|recommended|preferred)\b|\b(?:decision|choice|winner|entscheidung"
    r"|wahl)\W{1,4}(?:is\s)?(?P<d>[A-D])\b(?!\w)|\b(?:choose|pick|select|prefer|recommend"
    r"|go(?:ing)? with|submit|take)\s(?:the\s)(?P<e>first|former|second|latter)\b|\b(?:so|hence"
    rf"|thus|therefore|daher)[,:]?\s{_KIND}\s#?(?P<f>{_NAME})(?=\W{{0,3}}\Z)|\bthe (?P<g>first"
    rf"|former|second|latter)(?: (?:one|{_KIND}))? (?:is|seems|looks|fits|matches)\b(?! (?:not"
    r"|less)\b)[^.,;\n]{0,40}?\b(?:better|best|right|correct|picture|goal)\b"
    rf"|\b{_KIND}\s(?P<h>{_NAME}) it is\b"
    r"|\b(?:choose|pick|prefer|take|submit|wähle|nehme)\s(?P<i>[A-D])(?=\W{0,3}\Z)"
)
ORDINALS = {"first": 0, "former": 0, "second": 1, "latter": 1}
"""Which of two options a choice by place takes."""
REVISION = words(
    TAKES_BACK,
    r"final|correct|revis|updat|actual|summar|complete|overall|optimi|improv|attempt|error|\btry\b"
    r"|new plan|\bfull\b|reconsider|\b(?:instead|answer|again|better|so|thus|therefore|output)\b",
)
CORRECTS = words(
    TAKES_BACK,
    r"\b(?:(?:should|must|has to|needs to) be|should (?:have been|read)|swap(?:ped)?|sondern"
    r"|muss)\b|(?:^|[.;:!,]\s)(?:replace|insert|change)\s|应该是|改为|正しくは",
)
"""That something else is to stand where something stands, in a line that says what by number."""
PART = words(
    r"structure|layer|level|\b(?:left|right|cent(?:er|re)|middle|upper|lower|bottom|top|base|part"
    r"|section|component|side|tower|building|house|second|third|next|then|phase|stage|step)\b"
    r"|\bstep\s?\d|schicht|ebene|teil|turm|层|部分"
)
HEADING_CHARS = 80
OFFER = words(
    r"\b(?:would you like|do you want|shall i|should i|may i|let me know (?:if|whether) (?:i"
    r"|you want me)|soll ich|möchten sie)\b[^?.\n]{0,80}\b(?:order|plan|steps?|sequence|list"
    r"|reihenfolge|schritte)\b"
)
"""That the plan itself would come only if it is asked for."""
SUPPOSED = words(
    r"would|could|generic|hypothetical|in general|typical|illustrat|placeholder|candidates"
)
AGAIN = words(
    r"\brepeat (?:the |this |these )?(?:above |same |whole )?(?:assembly |building )?(?:order|steps"
    r"|sequence|plan|instructions)\b"
    r"[^.\n]{0,30}\b(?:for|to build) (?:the )?(?:second|other)\b"
)
NOT_REVERSED = words(
    r"\b(?:not|never|don't|do not|isn't|no need|take (?:it|them) apart|dis\w+|undo"
    r"|remov\w+)\b[^.\n]{0,40}revers|\breverse of (?:it|this|that|the above)\b"
)
DOWNWARD = words(
    r"top[- ](?:to|down)[- ]?(?:bottom)?\b|\b(?:from|at) the top\W*\Z|von oben nach unten|从上到下"
    r"|de haut en bas|de arriba (?:a|hacia) abajo|\b(?:from (?:the )?(?:top|roof|tip)|vom dach)"
    r"(?: \w+){0,4}? (?:to|zum) (?:the )?(?:very )?(?:base|bottom|ground|floor|boden)\b"
)
LABEL_CHARS = 20
BLOCK_WORD = words("block|index|indices")
LAYERS = words(
    r"\W*(?:(?:the )?(?:bottom|ground|base|first)\b|(?:layer|level|ebene|schicht|层) ?1)"
)
