"""PhyBlock as a Gymnasium environment: importing this package registers `PhyBlock-v0`."""

from __future__ import annotations

import gymnasium

from phyblock.env.environment import DONE, PhyBlockEnv

__all__ = ["DONE", "ENV_ID", "PhyBlockEnv"]

ENV_ID = "PhyBlock-v0"

gymnasium.register(ENV_ID, entry_point="phyblock.env.environment:PhyBlockEnv")
