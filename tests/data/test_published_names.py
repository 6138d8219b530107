from __future__ import annotations

from datetime import date

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data.published_names import PUBLISHED_NAMES, TABLE2_NAMES, match_published
from phyblock.results.paper import published_table

SPELLINGS = {
    "claude-3-5-haiku": "Claude-3.5 Haiku",
    "claude-3-5-haiku-20241022": "Claude-3.5 Haiku",
    "anthropic/claude-3-5-haiku@20241022": "Claude-3.5 Haiku",
    "claude-3-5-sonnet": "Claude-3.5 Sonnet",
    "claude-3-5-sonnet-latest": "Claude-3.5 Sonnet",
    "claude-3-7": "Claude-3.7 Sonnet",
    "claude-3-7-sonnet": "Claude-3.7 Sonnet",
    "claude-3-7-thinking": "Claude-3.7 Sonnet-Thinking",
    "claude-3-7-sonnet-20250219-thinking": "Claude-3.7 Sonnet-Thinking",
    "gpt-4o": "GPT-4o",
    "gpt4o": "GPT-4o",
    "openai/gpt-4o-2024-08-06": "GPT-4o",
    "gpt-4o-mini": "GPT-4o-mini",
    "gpt-4o-mini-2024-07-18": "GPT-4o-mini",
    "o1": "GPT-o1",
    "gpt-o1": "GPT-o1",
    "o1-2024-12-17": "GPT-o1",
    "gemini-1.5-flash": "Gemini-1.5-flash",
    "gemini-1.5-flash-002": "Gemini-1.5-flash",
    "gemini-1.5-flash-8b": "Gemini-1.5-flash-8b",
    "gemini-1.5-flash-8b-001": "Gemini-1.5-flash-8b",
    "gemini-2.0-flash": "Gemini-2.0-flash",
    "gemini-2.0-flash-001": "Gemini-2.0-flash",
    "gemini-2.0-flash-lite": "Gemini-2.0-flash-lite",
    "gemini-2.0-flash-lite-preview-02-05": "Gemini-2.0-flash-lite",
    "gemini-2.0-flash-thinking-exp-01-21": "Gemini-2.0-flash-thinking-exp",
    "gemini-2.0-flash-thinking-exp-1219": "Gemini-2.0-flash-thinking-exp",
    "Qwen-VL-max": "Qwen-VL-Max",
    "qwen-vl-max-2025-01-25": "Qwen-VL-Max",
    "InternVL2.5-1B": "InternVL2.5-1B",
    "InternVL2_5-8B": "InternVL2.5-8B",
    "OpenGVLab/InternVL2_5-78B": "InternVL2.5-78B",
    "Qwen2.5-VL-7B-Instruct": "Qwen2.5-VL-7B-Instruct",
    "Qwen2_5-VL-3B": "Qwen2.5-VL-3B-Instruct",
    "llava-onevision-qwen2-7b-ov": "LLaVa-OneVision-7B",
    "lmms-lab/llava-onevision-qwen2-0.5b-ov": "LLaVa-OneVision-0.5B",
    "LLaVa-OneVision-0.5B": "LLaVa-OneVision-0.5B",
    "random": "Random",
}

OTHERS = [
    "",
    "/",
    "日本",
    "claude-3-5",
    "claude-3-5-thinking",
    "claude-3-opus",
    "claude-4-sonnet",
    "gpt-4",
    "gpt-4o-audio-preview",
    "chatgpt-4o-latest",
    "o1-mini",
    "o1-preview",
    "o1-pro",
    "gemini-2.0",
    "gemini-2.0-flash-exp",
    "gemini-1.5-pro",
    "gemini-2.5-flash",
    "gemini-2.5-flash-lite",
    "gemini-1.5-flash-lite",
    "gemini-2.0-flash-8b",
    "qwen-vl-plus",
    "qwen2-vl-max",
    "Qwen2-VL-7B-Instruct",
    "Qwen2.5-7B-Instruct",
    "Qwen2.5-VL-7B-Instruct-AWQ",
    "InternVL2-8B",
    "InternVL2-51B",
    "InternVL2.5-4B",
    "InternVL2_5-78B-MPO",
    "InternVL3-8B",
    "llava-onevision-qwen2-7b-ov-chat",
    "llava-onevision-qwen2-7b-si",
    "llava-onevision-qwen2-72b-ov",
    "llava-v1.6-7b",
    "random-4",
]


@pytest.mark.parametrize(("name", "published"), SPELLINGS.items())
def test_known_spellings(name: str, published: str) -> None:
    assert match_published(name) == published


@pytest.mark.parametrize("name", OTHERS)
def test_other_models_are_not_taken_for_published_ones(name: str) -> None:
    assert match_published(name) is None


def test_every_published_name_means_itself() -> None:
    assert len(PUBLISHED_NAMES) == 21
    assert set(TABLE2_NAMES).isdisjoint(PUBLISHED_NAMES)
    names = (*PUBLISHED_NAMES, *TABLE2_NAMES)
    assert {name: match_published(name) for name in names} == {name: name for name in names}


def test_the_names_cover_the_rows_of_table_2() -> None:
    rows = set(published_table(2)["model"])
    assert set(TABLE2_NAMES) <= rows <= {*PUBLISHED_NAMES, *TABLE2_NAMES}
    spelled = {"gpt-4.1": "GPT-4.1", "o3": "GPT-o3", "qwen2.5-vl-72b": "Qwen2.5-VL-72B-Instruct"}
    assert {name: match_published(name) for name in spelled} == spelled


names = st.sampled_from([*PUBLISHED_NAMES, *SPELLINGS])
dates = st.dates(date(2020, 1, 1), date(2030, 12, 31))


@given(
    st.sampled_from(PUBLISHED_NAMES),
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
    assert match_published(name) in {None, *PUBLISHED_NAMES, *TABLE2_NAMES}
