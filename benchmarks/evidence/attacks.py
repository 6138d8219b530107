"""What a reward gives to replies that know nothing of the goal, or hide what they know.

    python -m benchmarks.evidence.attacks [--limit 400] [--physics-limit 40]

Prints, as Markdown, the mean reward of each attack beside the floor of its track: the best of the
blind baselines that the track names. Attacks that hold a right answer hold it where no answer may
stand. The same numbers whenever it is run.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence

import numpy as np

import phyblock
from phyblock.registry import track_baselines
from phyblock.stable import drawn_bytes
from phyblock.tracks.full_planning import plan_text

Reply = Callable[[phyblock.Task], str]


def rule(name: str) -> Reply:
    """Return what a baseline answers, as in a run."""

    def reply(task: phyblock.Task) -> str:
        seed = int.from_bytes(drawn_bytes(f"{name}|{task.seed}|{task.key}"), "big")
        subject = task.track.subject_of(task.item)
        return track_baselines(type(task.track))[name](subject, np.random.default_rng(seed))

    return reply


def hidden(name: str, after: str) -> Reply:
    """Return the answer of a rule where a model thinks, and another behind it."""
    return lambda task: f"<think>\n{rule(name)(task)}\n</think>\n{after}"


def listed(*numbers: int, times: int = 1) -> Reply:
    """Return a plan of these candidates, of all where none are named, several times over."""
    return lambda task: plan_text((numbers or range(1, len(task.item.candidates) + 1)) * times)  # type: ignore[operator, attr-defined]


def both(first: Reply, second: Reply) -> Reply:
    """Return two answers in one reply."""
    return lambda task: f"Plan 1:\n{first(task)}\n\nOr, as well:\n\nPlan 2:\n{second(task)}"


def backwards(task: phyblock.Task) -> str:
    """Return all candidates, the last first."""
    return plan_text(range(len(task.item.candidates), 0, -1))  # type: ignore[attr-defined]


def of_another(task: phyblock.Task) -> str:
    """Return a structure that stands: that of a pile, moved away from where the goal is."""
    return rule("stack")(task).replace("at (0, 0,", "at (3, 3,")


ALL_TWICE = "all candidates, each twice"
ATTACKS: dict[str, dict[str, Reply]] = {
    "full_planning": {
        "all candidates": rule("all-candidates"),
        ALL_TWICE: lambda task: plan_text([*range(1, len(task.item.candidates) + 1)] * 2),  # type: ignore[attr-defined]
        "one step 40 times": listed(1, times=40),
        "two orders in one reply": both(rule("all-candidates"), backwards),
        "goal-blind, then all candidates": both(rule("goal-blind"), rule("all-candidates")),
        "right plan in the reasoning, none behind": hidden("oracle", "I am done."),
        "right plan in the reasoning, all behind": lambda t: hidden("oracle", backwards(t))(t),
    },
    "vqa": {
        "all letters": lambda _: "Answer: A, B, C, D",
        "each letter in a sentence": lambda _: "\n".join(f"Answer: {c}" for c in "ABCD"),
        "always A": lambda _: "Answer: A",
        "right answer in the reasoning, none behind": hidden("oracle", "I cannot tell."),
        "right answer in the reasoning, D behind": hidden("oracle", "Answer: D"),
    },
    "pose_planning": {
        "stands, and is wrong: all in one pile": rule("stack"),
        "stands, and is wrong: a pile elsewhere": of_another,
        "nothing stands or falls: no step": lambda _: "I place no block.",
        "right plan in the reasoning, none behind": hidden("oracle", "I am done."),
    },
}
EPISODES: dict[str, Sequence[str]] = {
    "Done at once": ["Next plan: Done"],
    "one move for ever": ["Next plan: Move(1)"] * 99,
    "all candidates in turn": [f"Next plan: Move({n})" for n in range(1, 17)] * 4,
    "two moves in one reply": ["Next plan: Move(1)\nNext plan: Move(2)"] * 99,
}


def means(limit: int, physics_limit: int) -> Iterator[tuple[str, str, float, float, str]]:
    """Yield track, attack, mean reward, share of successes, and what it is."""
    for track, attacks in ATTACKS.items():
        found = phyblock.tasks(track, limit=physics_limit if track == "pose_planning" else limit)
        known = track_baselines(type(found[0].track))
        floors = [name for name in type(found[0].track).report().floors if name in known]
        replies = {f"baseline {name}": rule(name) for name in floors if name != "text-only"}
        for name, reply in {**replies, **attacks}.items():
            scores = [task.score(reply(task)) for task in found]
            value, success = (
                np.mean([getattr(s, a) for s in scores]) for a in ("value", "success")
            )
            yield track, name, float(value), float(success), "floor" if name in replies else ""
    found = phyblock.tasks("step_planning", limit=physics_limit)
    for name, said in EPISODES.items():
        scores = [task.score(said) for task in found]
        value, success = (np.mean([getattr(s, a) for s in scores]) for a in ("value", "success"))
        yield "step_planning", name, float(value), float(success), ""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=int, default=400)
    parser.add_argument("--physics-limit", type=int, default=40)
    given = parser.parse_args()
    print("| track | reply | mean reward | success | |\n|---|---|---|---|---|")
    for track, name, value, success, what in means(given.limit, given.physics_limit):
        print(f"| `{track}` | {name} | {value:.3f} | {success:.3f} | {what} |", flush=True)


if __name__ == "__main__":
    main()
