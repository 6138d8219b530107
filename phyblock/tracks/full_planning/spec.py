"""What a suite says of the full-planning track: the section `full_planning`."""

from __future__ import annotations

from phyblock.config.validation import PictureControls

__all__ = ["PlanningSpec"]


class PlanningSpec(PictureControls):
    """How the scenes of the full_planning track are shown, beside `images` and `candidates`."""
