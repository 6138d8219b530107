"""The wordings of the subtasks with simulation and several pictures: id -> template."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["DYNAMIC_TEMPLATES"]

DYNAMIC_TEMPLATES: Mapping[str, str] = {}
"""Named as those of the static subtasks: `cf-2`, `pd-push-1`."""
