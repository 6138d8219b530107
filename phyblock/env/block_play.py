"""Playing with blocks that find their places: an action is the number of a candidate."""

from __future__ import annotations

from typing import Any

from gymnasium import spaces
from PIL import Image

from phyblock.data import AssemblyTask
from phyblock.domain import MAX_CANDIDATES, Block
from phyblock.env.play import DONE, Acted, Play, picture_of
from phyblock.scoring.steps import Assembly
from phyblock.sim import PictureStyle, candidates_png
from phyblock.sim.site import ONE_SETTING, Lookout, Settled, Site
from phyblock.sim.stability import DEFAULT_TRIAL
from phyblock.types import Gating, Physics, Setting

__all__ = ["BlockPlay"]


class BlockPlay(Play):
    """A right move puts its block at its goal pose; a wrong one changes nothing."""

    def __init__(
        self,
        task: AssemblyTask,
        setting: Setting,
        gating: Gating,
        physics: Physics,
        style: PictureStyle,
    ) -> None:
        self.action_space = spaces.Discrete(MAX_CANDIDATES + 1)
        self._setting, self._gating, self._physics = setting, gating, physics
        self._style = style
        self._site = Site(DEFAULT_TRIAL if physics == "strict" else ONE_SETTING)
        self._task = task
        self._lookout: Lookout | None = None

    def begin(self, task: AssemblyTask) -> None:
        """Begin a scene."""
        if self._task is not task:
            self._task, self._lookout = task, None
        self._assembly = Assembly(task.scene, task.candidates, self._setting, self._gating)
        self._swapped: tuple[tuple[int, int], ...] = ()
        self._settled = Settled((), ())

    def act(self, action: Any) -> Acted | None:
        """Try a candidate; None for Done. ValueError for an action outside the space."""
        if not 0 <= int(action) <= MAX_CANDIDATES:
            raise ValueError(f"action {action} is outside 0..{MAX_CANDIDATES}")
        self._swapped = ()
        if action == DONE:
            return None
        move = self._assembly.move(int(action))
        self._swapped = move.swapped
        is_placed = move.outcome == "placed"
        if is_placed:
            self._settle()
        return Acted(move.outcome, float(is_placed), is_placed)

    @property
    def has_ended(self) -> bool:
        """Whether the goal is complete, or what stood has collapsed."""
        has_collapsed = self._physics == "strict" and not self._settled.stands
        return self._assembly.is_complete or has_collapsed

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks in the world."""
        return self._settled.blocks

    @property
    def chosen(self) -> tuple[int, ...]:
        """The candidates that were placed, in order."""
        return tuple(self._assembly.chosen)

    def right_moves(self) -> tuple[int, ...]:
        """The actions that would place a block now."""
        return self._assembly.right_moves()

    def image(self, blocks: tuple[Block, ...]) -> Image.Image:
        """Blocks, seen as the goal is."""
        if self._lookout is None:
            self._lookout = Lookout(self._task.scene, self._style)
        return self._lookout.image(blocks)

    def candidates_image(self) -> Image.Image:
        """The numbered candidates."""
        return picture_of(candidates_png(self._task.candidates, self._style))

    def info(self) -> dict[str, Any]:
        """The state in structure."""
        blocks = self._task.scene.blocks
        return {
            "placed": tuple(blocks[vertex].order for vertex in self._assembly.vertices),
            "swapped": tuple((blocks[a].order, blocks[b].order) for a, b in self._swapped),
            "fallen": self._settled.fallen,
            "is_complete": self._assembly.is_complete,
        }

    def close(self) -> None:
        """Release the simulator."""
        self._site.close()

    def _settle(self) -> None:
        """Let the assembly go: what falls is held at its goal pose, or under `strict` lies."""
        blocks = self._task.scene.blocks
        state = tuple(blocks[vertex] for vertex in self._assembly.vertices)
        self._settled = Settled((), state)
        if self._physics != "off":
            settled = self._site.settle(state)
            is_held = self._physics == "settle"
            self._settled = Settled(settled.fallen, state if is_held else settled.blocks)
