"""Right plans for worked examples."""

from __future__ import annotations

from phyblock.data import AssemblyTask
from phyblock.domain import Scene
from phyblock.parsing.structured import AnswerForm
from phyblock.stable import drawn_bytes
from phyblock.tracks.full_planning.baselines import plan_text

__all__ = ["can_be_worked", "worked_plan"]


def can_be_worked(task: AssemblyTask) -> bool:
    """Whether every block of the goal is among the candidates."""
    return all(task.candidates.index_of(block.look) is not None for block in task.scene.blocks)


def worked_plan(task: AssemblyTask, form: AnswerForm[list[int]] | None) -> str:
    """A right answer in the form that is asked for, None for text.

    Blocks are placed in a valid order that does not follow that of the file.
    """
    looks = [task.scene.blocks[vertex].look for vertex in _drawn_order(task.scene)]
    numbers = [task.candidates.index_of(look) for look in looks]
    steps = [number for number in numbers if number is not None]
    if form is None:
        return plan_text(steps)
    reasoning = f"The goal has {len(steps)} blocks. Each is placed once all it rests on is there."
    return form.write(steps, reasoning)


def _drawn_order(scene: Scene) -> list[int]:
    """Vertices in a valid order: the next is the ready one whose digest is the least."""

    def place(vertex: int) -> bytes:
        return drawn_bytes("example plan", scene.id, vertex)

    order: list[int] = []
    while ready := scene.graph.ready(sum(1 << vertex for vertex in order)):
        order.append(min(ready, key=place))
    return order
