"""Tables of what candidate sets give away."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console

from phyblock.cli.console import plain_table
from phyblock.making.auditing.given_away import percent
from phyblock.making.auditing.tells import Blind, Part, Tells

__all__ = ["print_blind", "print_tells"]


def print_tells(console: Console, tells: Tells) -> None:
    """Needed candidates by place and kinds by poses offered, and the pose that is listed first."""
    console.print("Candidates: are they needed")
    rows = [
        (f"place {place}", *_shown(part), percent(part.chance))
        for place, part in tells.places.items()
    ]
    first = tells.first_pose
    rows.append(("first pose listed of a needed kind", *_shown(first), percent(first.chance)))
    rows += [
        (f"kind offered in {poses} pose{'s' * (poses > 1)}", *_shown(part), "")
        for poses, part in tells.kinds.items()
    ]
    console.print(plain_table(("what", "needed", "of", "%", "by chance %"), rows, numbers=4))


def print_blind(console: Console, scores: Sequence[Blind], with_boosting: bool) -> None:
    """F1 of plans that never see the goal, in percent."""
    if all(one.every is None for one in scores):
        return
    rows = [
        (one.setting, *map(percent, (one.every, one.once, one.evenly, one.learned)))
        for one in scores
    ]
    console.print("F1 without seeing the goal, %")
    names = ("every candidate once", "learned, each once", "all equally often", "learned")
    console.print(plain_table(("setting", *names), rows, numbers=4))
    how = "tables of frequencies" + (" and gradient boosting" if with_boosting else "")
    hint = "" if with_boosting else "; pip install 'phyblock[audit]' for gradient boosting"
    about = f"Learned by {how} from scenes that share no base scene; optimal matcher{hint}."
    console.print(about, markup=False, soft_wrap=True)


def _shown(part: Part) -> tuple[str, str, str]:
    return str(part.part), str(part.whole), percent(part.share)
