"""Valid suites, drawn as the mappings that a file would hold."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from phyblock.types import BACKGROUNDS

NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._:+-]{0,20}", fullmatch=True)
LINES = st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufeff"))


def _some(items: list[Any]) -> st.SearchStrategy[list[Any]]:
    return st.lists(st.sampled_from(items), min_size=1, unique=True)


def _numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_subnormal=False)


SECTIONS: dict[str, dict[str, st.SearchStrategy[Any]]] = {
    "images": {
        "source": st.just("render"),
        "layout": st.sampled_from(["composite", "separate"]),
        "order": st.permutations(["goal", "candidates"]),
        "size_px": st.integers(128, 2048),
        "background": st.sampled_from(BACKGROUNDS),
    },
    "scoring": {
        "matchers": _some(["optimal", "paper"]),
        "level1": st.sampled_from(["selection", "membership", "aov"]),
        "missing": st.sampled_from(["count", "skip"]),
    },
    "sampling": {
        "temperature": st.none() | _numbers(0, 2) | st.integers(0, 2),
        "top_p": st.none() | _numbers(1e-9, 1),
        "max_tokens": st.none() | st.integers(1, 10**6),
    },
    "limits": {
        "max_concurrency": st.integers(1, 1000),
        "max_attempts": st.integers(1, 100),
        "retry_for_s": _numbers(0, 1e9),
        "timeout_s": _numbers(1e-3, 1e9),
        "max_cost_usd": st.none() | _numbers(0, 1e9),
    },
}
FIELDS: dict[str, st.SearchStrategy[Any]] = {
    "description": LINES,
    "tracks": st.just(["full_planning"]),
    "dataset": st.fixed_dictionaries(
        {}, optional={"format": st.just("builtin"), "path": st.sampled_from([None, "."])}
    ),
    "levels": _some([1, 2, 3, 4]),
    "settings": _some(["A", "B"]),
    "seeds": st.lists(st.integers(0, 2**31 - 1), min_size=1, max_size=4, unique=True),
    "prompt": st.just("default"),
    "parser": st.sampled_from(["steps", "official"]),
    "answer_format": st.sampled_from(["text", "json_schema"]),
    **{name: st.fixed_dictionaries({}, optional=fields) for name, fields in SECTIONS.items()},
}
REQUIRED: dict[str, st.SearchStrategy[Any]] = {
    "name": st.from_regex(r"[a-z0-9][a-z0-9-]{0,20}", fullmatch=True),
    "models": st.lists(NAMES, min_size=1, max_size=4, unique=True),
}

SUITES = st.fixed_dictionaries(REQUIRED, optional=FIELDS).map(
    lambda raw: raw if raw.get("answer_format") != "json_schema" else {**raw, "parser": "steps"}
)
"""Mappings that are valid suites with the built-in format."""
