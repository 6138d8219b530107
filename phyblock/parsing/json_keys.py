"""What the keys of JSON say of their values: a plan, its steps, a block, or what is no plan."""

from __future__ import annotations

import re

__all__ = [
    "ACTION_KEY",
    "ARGUMENTS_KEY",
    "BLOCK_KEY",
    "CHOICE_KEY",
    "INDEX_KEY",
    "LOOKS_KEY",
    "MANY_KEY",
    "OPPOSITE_KEY",
    "PLACE_KEY",
    "PLAN_KEY",
    "STEP_KEY",
    "STEP_TEXT",
    "TIMES_KEY",
]

PLAN_KEY = re.compile(
    r"(?:(?:final|assembly|build(?:ing)?|placement|block|construction|my|the|ordered|move|proposed"
    r"|correct)[ _-]?){0,3}"
    r"(?:plan|steps?|sequence|order(?:ing)?|answer|solution|actions?|moves|instructions|result"
    r"|output|layers"
    r"|assembly|reihenfolge|schritte|antwort|orden|pasos|respuesta|ordre|étapes|顺序|步骤|答案|计划|搭建顺序)",
    re.IGNORECASE,
)
STEP_KEY = re.compile(
    r"(?:.{0,40}[ _:-])?(?:step|layer|level|schritt|paso|étape|phase|stage|ebene|move|第|步骤"
    r"|层)[ _#-]{0,2}(?P<n>\d{1,3})\D{0,3}"
    r"|(?P<bare>\d{1,3})",
    re.IGNORECASE,
)
OPPOSITE_KEY = re.compile(
    r"(?:un|not[ _-]?|non[ _-]?)(?:used|needed|required|necessary|selected|placed)|distract|exclud"
    r"|reject|discard"
    r"|remain|left[ _-]?over|spare|available|candidate(?:s|_list)|ignor|skip|avoid|wrong|draft"
    r"|example|attempt"
    r"|alternativ|initial|previous|old|count|total|number_of|num_|confidence|layers?_count|reason"
    r"|thought|analysis|^(?:to|onto?|target|under|location|destination|next[ _]to)$"
    r"|explanation|descri|comment|note|supports?$|depend|on[ _]?top|below|position|coord"
    r"|bbox|bounding|pixel|rotation|orient|size"
    r"|color|colour|shape|type|blocks?[ _](?:needed|required|used)|required|needed|selected"
    r"|inventory|dictionary"
    r"|unbenutzt|übrig|未使用|多余|干扰|剩余",
    re.IGNORECASE,
)
INDEX_KEY = re.compile(
    r"(?:(?:block|candidate|piece)[ _-]?)?(?:index|idx|id|number|no)|block|candidate|piece|move"
    r"|place|baustein|积木|编号",
    re.IGNORECASE,
)
BLOCK_KEY = re.compile(
    r"(?:block|candidate|piece)(?:[ _-]?(?:index|idx|id|number|no))?|积木", re.IGNORECASE
)
"""Keys that outweigh an `id` or `number`, which may be that of the step."""
ACTION_KEY = re.compile(
    r"action|instruction|operation|description|move|text|do|command", re.IGNORECASE
)
TIMES_KEY = re.compile(r"count|times|quantity|qty|repeat|copies|anzahl|数量", re.IGNORECASE)
PLACE_KEY = re.compile(
    r"step|order|sequence|layer|level|position_in_order|schritt|步骤", re.IGNORECASE
)
MANY_KEY = re.compile(
    r"blocks|indices|indexes|ids|candidates|pieces|block_ids|block_indices|积木", re.IGNORECASE
)
STEP_TEXT = re.compile(r"\W{0,4}(?:step|schritt|paso|étape|步骤)\s?\d{1,2}\b", re.IGNORECASE)
ARGUMENTS_KEY = re.compile(r"arguments|args|param(?:eter)?s|input|function|tool_input", re.I)
LOOKS_KEY = re.compile(r"shape|color|colour|orientation|type|形状|颜色", re.IGNORECASE)
CHOICE_KEY = re.compile(
    r"(?:plan|option|alternative|variant)[ _-]?(?P<which>[a-d1-4])", re.IGNORECASE
)
