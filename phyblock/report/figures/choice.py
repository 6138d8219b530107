"""A run with some of its models alone, so that figures show these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phyblock.report.compare import checked_models
from phyblock.tables.load import Run

__all__ = ["of_models"]


def of_models(run: Run, models: Sequence[str]) -> Run:
    """The run as if it had these models alone, in its own order; all where none are named.

    Values and intervals of a model stay what they are. Raises SpecError for a model that the run
    has not, or that is named twice.
    """
    if not models:
        return run
    chosen = checked_models(run, models)
    design = run.design
    kept = tuple(model for model in design.models if model.name in chosen)
    return replace(
        run,
        design=design.model_copy(update={"models": kept}),
        records=run.records[run.records["model"].isin(chosen)],
        scores=run.scores[run.scores["model"].isin(chosen)],
    )
