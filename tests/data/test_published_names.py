"""Names of models and the rows of the paper's tables that they stand for."""

from __future__ import annotations

from datetime import date

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data.official import match_published
from phyblock.results.paper import published_table

SPELLINGS = {
    "claude-3-5-haiku-20241022": "Claude-3.5 Haiku",
    "anthropic/claude-3-5-haiku@20241022": "Claude-3.5 Haiku",
    "claude-3-5-sonnet-latest": "Claude-3.5 Sonnet",
    "claude-3-7": "Claude-3.7 Sonnet",
    "claude-3-7-sonnet-20250219-thinking": "Claude-3.7 Sonnet-Thinking",
    "gpt4o": "GPT-4o",
    "openai/gpt-4o-2024-08-06": "GPT-4o",
    "gpt-4o-mini-2024-07-18": "GPT-4o-mini",
    "o1-2024-12-17": "GPT-o1",
    "o3": "GPT-o3",
    "gemini-1.5-flash-002": "Gemini-1.5-flash",
    "gemini-1.5-flash-8b-001": "Gemini-1.5-flash-8b",
    "gemini-2.0-flash-lite-preview-02-05": "Gemini-2.0-flash-lite",
    "gemini-2.0-flash-thinking-exp-1219": "Gemini-2.0-flash-thinking-exp",
    "qwen-vl-max-2025-01-25": "Qwen-VL-Max",
    "OpenGVLab/InternVL2_5-78B": "InternVL2.5-78B",
    "Qwen2_5-VL-3B": "Qwen2.5-VL-3B-Instruct",
    "llava-onevision-qwen2-7b-ov": "LLaVa-OneVision-7B",
    "lmms-lab/llava-onevision-qwen2-0.5b-ov": "LLaVa-OneVision-0.5B",
    "random": "Random",
}
OTHERS = [
    *("", "/", "日本", "claude-3-5", "claude-3-5-thinking", "claude-4-sonnet", "gpt-4", "o1-mini"),
    *("gpt-4o-audio-preview", "chatgpt-4o-latest", "gemini-2.0", "gemini-2.0-flash-exp"),
    *("gemini-1.5-pro", "gemini-2.5-flash-lite", "gemini-2.0-flash-8b", "qwen2-vl-max"),
    *("Qwen2.5-7B-Instruct", "Qwen2.5-VL-7B-Instruct-AWQ", "InternVL2-8B", "InternVL2_5-78B-MPO"),
    *("llava-onevision-qwen2-7b-ov-chat", "llava-onevision-qwen2-72b-ov", "random-4"),
]
ROWS = [*dict.fromkeys([*published_table(1)["model"], *published_table(2)["model"]])]


@pytest.mark.parametrize(("name", "published"), [*SPELLINGS.items(), *zip(ROWS, ROWS, strict=True)])
def test_known_spellings(name: str, published: str) -> None:
    assert match_published(name) == published


@pytest.mark.parametrize("name", OTHERS)
def test_other_models_are_not_taken_for_published_ones(name: str) -> None:
    assert match_published(name) is None


names = st.sampled_from([*ROWS, *SPELLINGS])
dates = st.dates(date(2020, 1, 1), date(2030, 12, 31))


@given(
    st.sampled_from(ROWS),
    dates,
    st.sampled_from(["%Y-%m-%d", "%Y%m%d", "%Y_%m_%d", "%m-%d", "%m%d"]),
)
def test_a_release_date_changes_nothing(name: str, day: date, form: str) -> None:
    assert match_published(f"{name}-{day:{form}}") == name


@given(names, st.data())
def test_case_and_separators_change_nothing(name: str, data: st.DataObject) -> None:
    bare = name.rpartition("/")[2]
    other = "".join(
        data.draw(st.sampled_from("-_. ")) if char in "-_. " else data.draw(_cases(char))
        for char in bare
    )
    assert match_published(other) == match_published(name)


def _cases(char: str) -> st.SearchStrategy[str]:
    return st.sampled_from([char.lower(), char.upper()])


@given(names, st.from_regex(r"[a-z]{2,9}", fullmatch=True))
def test_an_unknown_word_makes_it_another_model(name: str, word: str) -> None:
    known = {"mini", "thinking", "lite", "latest", "preview", "exp", "instruct", "ov", "hf"}
    if word not in known:
        assert match_published(f"{name}-{word}") is None


@given(st.text(max_size=40))
def test_any_text_is_a_published_name_or_unknown(name: str) -> None:
    assert match_published(name) in {None, *ROWS}
