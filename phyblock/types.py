"""Literal types that suites, records, rules and the command line share."""

from __future__ import annotations

from typing import Literal, get_args

Setting = Literal["A", "B"]  # Setting of a comparison of blocks: A with orientation, B without.
SETTINGS: tuple[Setting, ...] = get_args(Setting)

Matcher = Literal["optimal", "paper"]  # Rule that matches steps and interchangeable goal blocks.
MATCHERS: tuple[Matcher, ...] = get_args(Matcher)

Level1Criterion = Literal["selection", "membership"]  # Criteria of Level 1 that ignore the order.
LEVEL1_CRITERIA: tuple[Level1Criterion, ...] = get_args(Level1Criterion)
Criterion = Literal["selection", "membership", "aov"]  # Rule by which a step counts as right.

PlanParser = Literal["steps", "official"]  # Parsers of plans.

AnswerFormat = Literal["text", "json_schema"]
"""Form of answers: lines of text, or JSON that follows a schema."""

Gating = Literal["aov", "layer"]
"""Condition for placing a block: what it rests on is placed, or all lower layers are complete."""
GATINGS: tuple[Gating, ...] = get_args(Gating)
Physics = Literal["off", "settle", "strict"]
"""Simulation of every new state, and the effect of a collapse."""

StepEnd = Literal["stands", "falls", "knocks_over", "overlaps", "under_floor", "no_block"]
"""Ending of a step. `stands`: all blocks stay where they were. `falls`: the block does not.
`knocks_over`: others do not. `overlaps`, `under_floor`: it was refused. `no_block`: no candidate
has this number."""
STEP_ENDS: tuple[StepEnd, ...] = get_args(StepEnd)
REFUSED_ENDS: tuple[StepEnd, ...] = ("overlaps", "under_floor", "no_block")
"""Endings of steps whose block is not there afterwards."""

DataFormat = Literal["builtin", "official"]  # Layouts of data sets and question sets.

Background = Literal["checkerboard", "white", "light-wood", "dark-wood", "concrete", "lawn"]
"""The six backgrounds of the paper; the checkerboard, which is dark, is the default."""
BACKGROUNDS: list[Background] = [*get_args(Background)]
"""Those of the paper, then those that plugins add."""
CandidateOrder = Literal["file", "shuffled"]  # Order in which candidates are numbered and shown.

View = Literal["oblique", "front", "side", "top"]
"""View of a scene: from a corner, along an axis, or from above."""

Role = Literal["system", "user", "assistant"]  # Speaker of a chat message.
Finish = Literal["stop", "length", "refusal", "unknown"]
"""Reason why a reply ended: by itself, at the token limit, by a content filter, or unknown."""
Outcome = Literal["ok", "parse_failure", "refusal", "truncated", "api_error", "missing"]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)  # Every outcome, in the order of columns.
WITHOUT_REPLY: tuple[Outcome, ...] = ("api_error", "missing")
"""Outcomes of samples without a reply; a refusal is a reply."""
BATCH_PROVIDERS = ("openai", "hosted_vllm", "anthropic", "gemini")
"""Prefixes of model ids whose servers may accept batches in a protocol that phyblock speaks."""
ImageDetail = Literal["auto", "low", "medium", "high", "ultra_high", "original"]
"""Detail in which a provider looks at pictures; each knows some of these."""

QUOTE_HINT = "quote values with spaces, or write none: --set 'seeds=[0, 1]', --models a,b"
"""Hint for a value that the shell split."""
