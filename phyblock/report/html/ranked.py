"""The place of each model among those of a run, as far as tests can tell."""

from __future__ import annotations

import math
from typing import Literal

from phyblock.results.compare import compare_models
from phyblock.results.estimates import Value, headline_of, main_column
from phyblock.results.load import Run

__all__ = ["kinds_of", "rank_texts"]


def rank_texts(run: Run, track: str) -> dict[str, str]:
    """The place that each model may have by its main value; {} where there are not two."""
    main, values = main_column(run, track).heading, headline_of(run, track)
    known = {model for (model, heading), v in values.items() if heading == main and _is_known(v)}
    models = [name for name, sort in kinds_of(run).items() if sort == "model" and name in known]
    if len(models) < 2:
        return {}
    found = compare_models(run, models, track)
    texts = {}
    for row in found.ranks.to_dict("records"):
        best, worst = row["best"], row["worst"]
        texts[str(row["model"])] = f"{best}" if best == worst else f"{best} to {worst}"
    return texts


def _is_known(value: Value) -> bool:
    return not math.isnan(value.value)


def kinds_of(run: Run) -> dict[str, Literal["model", "baseline"]]:
    """Which models are baselines; these come last."""
    rules = {model.name for model in run.manifest.models if model.is_baseline}
    baselines = [name for name in run.design.model_names if name in rules]
    models = [name for name in run.design.model_names if name not in rules]
    return {
        **dict.fromkeys(models, "model"),
        **dict.fromkeys(baselines, "baseline"),
    }
