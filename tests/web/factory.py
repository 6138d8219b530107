"""Manifests and records for the tests of tables."""

from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import yaml
from hypothesis import settings
from hypothesis import strategies as st

from phyblock.records.files import Manifest, known_records
from phyblock.records.record import Reply
from phyblock.results.load import Run, design_of, frames_of
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES
from phyblock.types import OUTCOMES
from tests.workspace import write_lines

laws = settings(max_examples=8)
"""Tables take some 50 ms each, so that few examples must do."""

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)
LEVELS = {"000": (1, 2), "001": (2,), "002": (3,), "003": (4,), "004": (1,)}


def manifest(
    *,
    models: Iterable[str | tuple[str, str]] = ("alpha", "beta"),
    levels: Iterable[int] = (1, 2, 3, 4),
    seeds: Iterable[int] = (0, 1),
    settings: Iterable[str] = ("A", "B"),
    matchers: Iterable[str] = ("optimal", "paper"),
    level1: str = "selection",
    missing: str = "skip",
    suite: Mapping[str, Any] = {},
    **more: Any,
) -> dict[str, Any]:
    named = [(model, None) if isinstance(model, str) else model for model in models]
    return {
        "identity": "0" * 64,
        "suite": {
            "name": "test",
            "models": [name for name, _ in named],
            "levels": list(levels),
            "settings": list(settings),
            "seeds": list(seeds),
            "scoring": {"matchers": list(matchers), "level1": level1, "missing": missing},
            **suite,
        },
        "models": [{"name": name, "published": published} for name, published in named],
        "scenes_by_level": {n: sum(n in held for held in LEVELS.values()) for n in levels},
        "items": {"full_planning": len(LEVELS)},
        "scenes": len(LEVELS),
        **more,
    }


def score(
    tp: int,
    fp: int,
    fn: int,
    *,
    criterion: str = "aov",
    matcher: str | None = "optimal",
    setting: str = "A",
    errors: tuple[int, int, int, int] | None = None,
) -> dict[str, Any]:
    counted = {"criterion": criterion, "setting": setting, "tp": tp, "fp": fp, "fn": fn}
    if criterion != "aov":
        return {**counted, "matcher": None, "errors": None, "blocks": None, "kept": None}
    by_type = dict(zip(ERROR_TYPES, errors or (fp, 0, 0, 0), strict=True))
    blocks = {**dict.fromkeys(BLOCK_OUTCOMES, 0), "placed": tp, "left_out": fn}
    return {**counted, "matcher": matcher, "errors": by_type, "blocks": blocks, "kept": tp}


def record(
    model: str = "alpha",
    scene: str = "000",
    seed: int = 0,
    scores: Iterable[Mapping[str, Any]] = (),
    outcome: str = "ok",
    **reply: Any,
) -> dict[str, Any]:
    answered = outcome not in ("api_error", "missing")
    usage = {name: reply.pop(name, None) for name in ("prompt_tokens", "completion_tokens")}
    told = {"text": "Move block with index 1", "latency_s": 0.5, "usage": usage, **reply}
    busy = {"kind": "retryable", "status": 429, "message": "busy"}
    return {
        "sample": f"full_planning/{model}/{scene}/s{seed}",
        "track": "full_planning",
        "model": model,
        "key": scene,
        "scene": scene,
        "levels": list(LEVELS.get(scene, (2,))),
        "parents": [scene],
        "n_blocks": 4,
        "seed": seed,
        "outcome": outcome,
        "reply": Reply.model_validate(told).model_dump() if answered else None,
        "error": busy if outcome == "api_error" else None,
        "prompt": None,
        "parse": {"parser": "steps", "rule": "last_step_list", "plan": [1], "dropped": [99]},
        "scores": [dict(one) for one in scores],
        "time": "2026-11-20T10:00:00Z",
    }


def asked(number: int, subtask: str, given: str, seed: int = 0) -> dict[str, Any]:
    """A question whose right answer is A, and what was answered."""
    name = f"{subtask.lower()}-{number}"
    return record("alpha", "000", seed) | {
        "sample": f"vqa/alpha/{name}/s{seed}",
        "track": "vqa",
        "key": name,
        "question": {"id": name, "subtask": subtask, "category": "", "rotation": 0},
        "parse": {"rule": "letter", "letters": given},
        "answer": {"right": "A", "given": given, "correct": given == "A"},
    }


def run_of(records: Iterable[Mapping[str, Any]], facts: Mapping[str, Any]) -> Run:
    read = ((known_records().validate_python(one), 0) for one in records)
    told = Manifest.model_validate(dict(facts))
    design = design_of(told)
    return Run(Path("run"), told, design, *frames_of(read, design))


def write_run(folder: Path, records: Iterable[Mapping[str, Any]], facts: Mapping[str, Any]) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "run.yaml").write_text(yaml.safe_dump(dict(facts)), encoding="utf-8")
    write_lines(folder / "records.jsonl", records)
    return folder


@st.composite
def record_lists(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Records of some samples of `manifest()`, with every score that a run stores."""
    small = st.integers(0, 5)
    records = []
    for model, scene, seed in product(("alpha", "beta"), LEVELS, (0, 1)):
        if not draw(st.integers(0, 4)):
            continue
        scores = []
        for setting in "AB":
            for matcher in ("optimal", "paper"):
                errors = draw(st.tuples(small, small, small, small))
                counts = (draw(small), sum(errors), draw(small))
                scores.append(score(*counts, matcher=matcher, setting=setting, errors=errors))
            if 1 in LEVELS[scene]:
                counts = (draw(small), draw(small), draw(small))
                scores.append(score(*counts, criterion="selection", setting=setting))
        records.append(record(model, scene, seed, scores, draw(st.sampled_from(OUTCOMES))))
    return records
