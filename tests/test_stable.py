"""Sums of floats: one after another, whatever this Python's own `sum` does with what is lost."""

from __future__ import annotations

import builtins
import functools
import math
import operator
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data import read_builtin, read_questions
from phyblock.domain import euler_deg_to_matrix
from phyblock.resources import bundled
from phyblock.scoring.pose import Piece, PoseFit, overlap_volume, placed
from phyblock.sim.geometry import collision_pieces
from phyblock.stable import plain_sum
from phyblock.tracks.baselines import text_features
from phyblock.tracks.pose_planning import FITS

DATA = read_builtin(bundled("benchmarks", "data", "phyblock-400"))
ASKED = read_questions(bundled("benchmarks", "data", "phyblock-vqa"), DATA)


def rounding(values: Iterable[Any], /, start: Any = 0) -> Any:
    """`sum` as it is before Python 3.12."""
    return functools.reduce(operator.add, values, start)


def compensating(values: Iterable[Any], /, start: Any = 0) -> Any:
    """`sum` as it is from Python 3.12 on: nothing is lost of floats."""
    listed = list(values)
    if any(type(value) is float for value in listed):
        return math.fsum([start, *listed])
    return rounding(listed, start)


@given(st.lists(st.floats(-1e6, 1e6) | st.integers(-9, 9)))
def test_values_are_added_one_after_another(values: list[float]) -> None:
    total: float = 0
    for value in values:
        total += value
    assert (plain_sum(values), type(plain_sum(values))) == (total, type(total))


def texts() -> list[Any]:
    """Features of options' texts, by which drafts are kept and the text-only probe answers."""
    return [text_features(task.question.text, task.question.options) for task in ASKED.tasks[::5]]


def solids() -> list[Any]:
    """The overlap of two arches, which are three pieces each or more."""
    arch = [Piece(p.vertices_m, p.face_normals) for p in collision_pieces("arch")]
    turns = (euler_deg_to_matrix((7.0 * n, 11.0 * n, 13.0 * n)) for n in range(5))
    return [overlap_volume(arch, placed(arch, turn, np.full(3, 0.003))) for turn in turns]


def fits() -> list[Any]:
    """Counts of how steps lie to goal blocks, as records hold them."""
    off = [PoseFit(n, 0.1 * n, 0.0, 0.0, 0.7 * n, 1 / (n + 1)) for n in range(30)]
    records: list[Any] = [SimpleNamespace(pose=SimpleNamespace(steps=off[:n])) for n in range(30)]
    return [list(FITS.of(record)) for record in records]


@pytest.mark.parametrize("compute", [texts, solids, fits])
def test_results_are_those_of_either_sum(
    compute: Callable[[], list[Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    computed = []
    for either in (rounding, compensating):
        with monkeypatch.context() as patched:
            patched.setattr(builtins, "sum", either)
            computed.append(compute())
    assert computed[0] == computed[1]
