"""Goal-blind plans are learned once: they are kept in the cache folder, by all that decides them.

Learning them from the 400 built-in scenes takes seconds, and each run of the same data needs the
same plans.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from phyblock.domain import CandidateSet, Plan, Scene
from phyblock.files import atomic_write, load_json, read_bytes
from phyblock.resources import learned_dir
from phyblock.tracks.goal_blind.learning import goal_blind_plans
from phyblock.types import Setting

__all__ = ["kept_plans"]

_PACKAGE = Path(__file__).parents[2]
_DECIDE = ("domain", "scoring", "tracks/goal_blind")
"""Packages whose code decides the plans."""


def kept_plans(
    scenes: Sequence[Scene], candidates: Mapping[str, CandidateSet], setting: Setting
) -> dict[str, Plan]:
    """What `goal_blind_plans` gives, from the cache folder where the same was learned before.

    A folder that cannot be read or written, or a file that is not whole, costs only the time; so
    does code that is not there as files, by which kept plans would be known.
    """
    key = _key(scenes, candidates, setting)
    if key is None:
        return goal_blind_plans(scenes, candidates, setting)
    path = learned_dir() / f"{key}.json"
    if (kept := _read(path, candidates)) is not None:
        return kept
    plans = goal_blind_plans(scenes, candidates, setting)
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        atomic_write(path, json.dumps({name: plan.steps for name, plan in plans.items()}))
    return plans


def _key(
    scenes: Sequence[Scene], candidates: Mapping[str, CandidateSet], setting: Setting
) -> str | None:
    """Digest of the code, the scenes with their candidates, and the setting; None without code."""
    digest = hashlib.sha256(f"{np.__version__} {setting}".encode())
    for name in _DECIDE:
        sources = sorted((_PACKAGE / name).glob("*.py"))
        if not sources:
            return None
        try:
            for path in sources:
                digest.update(path.read_bytes())
        except OSError:
            return None
    for scene in scenes:
        digest.update(repr((scene, candidates[scene.id])).encode("utf-8", "surrogatepass"))
    return digest.hexdigest()


def _read(path: Path, candidates: Mapping[str, CandidateSet]) -> dict[str, Plan] | None:
    """The plans in a file; None where there is none, or it holds no plan for each set."""
    try:
        kept = load_json(read_bytes(path))
        plans = {name: Plan(tuple(steps)) for name, steps in kept.items()}
        is_whole = plans.keys() == candidates.keys() and all(
            type(step) is int and 1 <= step <= len(candidates[name])
            for name, plan in plans.items()
            for step in plan.steps
        )
    except (OSError, ValueError, TypeError, AttributeError):
        return None
    return plans if is_whole else None
