"""The wordings of the static subtasks: id -> template with named slots."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["TEMPLATES"]

TEMPLATES: Mapping[str, str] = {}
"""An id is the subtask, a kind where there are several, and a number: `rp-side-2`."""
