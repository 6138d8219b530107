"""The words that suites, records, rules and the command line share, each spelled once.

Words that one track alone knows stand in its folder, those of blocks and questions in the domain.
"""

from __future__ import annotations

from typing import Literal, get_args

Setting = Literal["A", "B"]
"""What blocks are compared by: A with orientation, B without."""
SETTINGS: tuple[Setting, ...] = get_args(Setting)

Matcher = Literal["optimal", "paper"]
"""How steps and interchangeable goal blocks are matched."""
MATCHERS: tuple[Matcher, ...] = get_args(Matcher)

Level1Criterion = Literal["selection", "membership"]
"""How Level 1 is counted where order plays no part."""
LEVEL1_CRITERIA: tuple[Level1Criterion, ...] = get_args(Level1Criterion)
Criterion = Literal["selection", "membership", "aov"]
"""What is counted as a right step."""

MissingPolicy = Literal["count", "skip"]
"""What becomes of samples without a reply."""

PlanParser = Literal["steps", "official"]
"""How plans are read out of replies."""
PLAN_PARSERS: tuple[PlanParser, ...] = get_args(PlanParser)

AnswerFormat = Literal["text", "json_schema"]
"""In which form answers are asked for: in lines of text, or as JSON that follows a schema."""
AskedAs = Literal["prompt", "response_format"]
"""How JSON was asked for: in the prompt alone, or in the request's `response_format` as well."""

Gating = Literal["aov", "layer"]
"""When a block can be placed: when all it rests on is, or when all lower layers are complete."""
GATINGS: tuple[Gating, ...] = get_args(Gating)
Physics = Literal["off", "settle", "strict"]
"""What is simulated of every new state, and whether a collapse ends the episode."""

PoseRotation = Literal["candidate", "free"]
"""The source of a block's orientation: its candidate as it is shown, or the step."""
StepEnd = Literal["stands", "falls", "knocks_over", "overlaps", "under_floor", "no_block"]
"""How a step that is carried out ends. `stands`: the block is where it was put, and so are the
others. `falls`: it is not. `knocks_over`: others are not where they were. `overlaps`,
`under_floor`: it was refused. `no_block`: there is no candidate of its number.
"""
STEP_ENDS: tuple[StepEnd, ...] = get_args(StepEnd)
REFUSED_ENDS: tuple[StepEnd, ...] = ("overlaps", "under_floor", "no_block")
"""Steps after which their block is not there."""

DataFormat = Literal["builtin", "official"]
"""Layouts of data sets and question sets."""

Background = Literal["checkerboard", "white", "light-wood", "dark-wood", "concrete", "lawn"]
"""The six backgrounds of the paper; the checkerboard is dark, and where nothing else is said."""
BACKGROUNDS: list[Background] = [*get_args(Background)]
"""Those of the paper, then those that plugins add."""
PictureName = Literal["goal", "candidates"]
PictureSource = Literal["render", "dataset"]
PictureLayout = Literal["composite", "separate"]
CandidateOrder = Literal["file", "shuffled"]
"""In which order candidates are numbered and shown."""
CandidateScale = Literal["common", "fit"]

View = Literal["oblique", "front", "side", "top"]
"""Where a scene is seen from: from a corner, along an axis, or from above."""

Role = Literal["system", "user", "assistant"]
"""Who speaks in a chat message."""
Finish = Literal["stop", "length", "refusal", "unknown"]
"""Why a reply ended: by itself, at the token limit, by a content filter, or not said."""
Outcome = Literal["ok", "parse_failure", "refusal", "truncated", "api_error", "missing"]
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
"""Every outcome, in the order of columns."""
FAILURES: tuple[Outcome, ...] = tuple(outcome for outcome in OUTCOMES if outcome != "ok")
"""Every outcome but `ok`."""
WITHOUT_REPLY: tuple[Outcome, ...] = ("api_error", "missing")
"""Outcomes of samples that the model said nothing about; a refusal is an answer."""
TransportName = Literal["auto", "litellm", "direct"]
BATCH_PROVIDERS = ("openai", "hosted_vllm", "anthropic", "gemini")
"""Prefixes of model ids whose servers may take batches in a protocol that is spoken here."""
SendMode = Literal["auto", "always", "never"]
"""When a field is sent that not every provider takes."""
ImageDetail = Literal["auto", "low", "medium", "high", "ultra_high", "original"]
"""How closely a provider looks at pictures; each knows some of these."""

QUOTE_HINT = "quote values with spaces, or write none: --set 'seeds=[0, 1]', --models a,b"
"""What helps where a shell took a value apart."""
