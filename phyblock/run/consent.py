"""When a run must not spend money before somebody agreed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from phyblock.errors import Problem, SpecError
from phyblock.models import is_billed
from phyblock.run.estimate import Estimate, estimate
from phyblock.run.plan import RunPlan

__all__ = ["spending_refused", "unlimited_spending"]


def unlimited_spending(
    plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool = False
) -> Sequence[Estimate]:
    """What every model would take, where one that is billed may cost something and no limit of the
    suite holds it; nothing where there is nothing to agree to.
    """
    billed = _billed(plan)
    if plan.suite.limits.max_cost_usd is not None or not billed:
        return ()
    estimated = estimate(plan, folder, use_cache=use_cache, retry_failed=retry_failed)
    return estimated if any(row.may_cost and row.model in billed for row in estimated) else ()


def spending_refused(
    plan: RunPlan, estimated: Sequence[Estimate], message: str, hint: str
) -> SpecError:
    """The error that names the models that may cost money."""
    billed = _billed(plan)
    found = ", ".join(row.model for row in estimated if row.may_cost and row.model in billed)
    return SpecError(Problem(f"suite {plan.suite.name}", message, found=found, hint=hint))


def _billed(plan: RunPlan) -> set[str]:
    """The models whose calls somebody may be billed for."""
    return {model.name for model in plan.models if is_billed(model.config)}
