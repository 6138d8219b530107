"""Sums of floats that are the same on every Python.

From Python 3.12 on `sum` makes up for what rounding loses, so that its last digits may be others.
What enters data, records or tables, or decides what does, is summed up here.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable
from typing import TypeVar

__all__ = ["plain_sum"]

_N = TypeVar("_N", int, float)


def plain_sum(values: Iterable[_N]) -> _N:
    """Add one after another to 0, each sum rounded."""
    return functools.reduce(operator.add, values, 0)
