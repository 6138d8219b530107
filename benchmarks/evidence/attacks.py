"""Rewards of replies that know nothing of the goal, or hide what they know.

    python -m benchmarks.evidence.attacks [--limit 400] [--physics-limit 16]

Prints, as Markdown, the mean reward of each attack beside the floor of its track: the best of the
blind baselines that the track names. Attacks that hold a right answer hold it where no answer may
stand. The same numbers whenever it is run.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

import phyblock
from phyblock.domain.scene import PoseStep
from phyblock.registry import track_baselines
from phyblock.sim.geometry import box_height_cm
from phyblock.text import drawn_bytes
from phyblock.tracks.full_planning import plan_text
from phyblock.tracks.pose_planning import written

Reply = Callable[[Any], str]
SIMULATED = ("pose_planning", "step_planning")


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


def every(times: int = 1) -> Reply:
    """Return a plan of all candidates, several times over."""
    return lambda task: plan_text([*range(1, len(task.item.candidates) + 1)] * times)


def both(first: Reply, second: Reply) -> Reply:
    """Return two answers in one reply."""
    return lambda task: f"Plan 1:\n{first(task)}\n\nOr, as well:\n\nPlan 2:\n{second(task)}"


def backwards(task: phyblock.Task) -> str:
    """Return all candidates, the last first."""
    return plan_text(range(len(task.item.candidates), 0, -1))


def in_a_row(task: phyblock.Task) -> str:
    """Return all candidates on the floor, 15 cm apart: each stands, whatever the goal is."""
    places = enumerate(task.item.candidates.candidates, 1)
    return written(PoseStep(n, (15.0 * (n - 8), 0.0, box_height_cm(one) / 2)) for n, one in places)


ATTACKS: dict[str, dict[str, Reply]] = {
    "full_planning": {
        "all candidates, each twice": every(2),
        "one step 40 times": lambda _: plan_text([1] * 40),
        "two orders in one reply": both(every(), backwards),
        "goal-blind, then all candidates": both(rule("goal-blind"), every()),
        "right plan in the reasoning, none behind": hidden("oracle", "I am done."),
        "right plan in the reasoning, all behind": lambda t: hidden("oracle", backwards(t))(t),
    },
    "vqa": {
        "all letters": lambda _: "Answer: A, B, C, D",
        "each letter in a sentence": lambda _: "\n".join(f"Answer: {c}" for c in "ABCD"),
        "right answer in the reasoning, none behind": hidden("oracle", "I cannot tell."),
        "right answer in the reasoning, D behind": hidden("oracle", "Answer: D"),
    },
    "pose_planning": {
        "stands and is wrong: all in a row": in_a_row,
        "right plan in the reasoning, none behind": hidden("oracle", "I am done."),
        "right plan in the reasoning, a row behind": lambda t: hidden("oracle", in_a_row(t))(t),
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
    for track, attacks in {**ATTACKS, "step_planning": EPISODES}.items():
        found = phyblock.tasks(track, limit=physics_limit if track in SIMULATED else limit)
        floors = type(found[0].track).report().floors
        for name in (*floors, *attacks):
            scores = [scored(task, attacks.get(name), name) for task in found]
            value, success = (
                np.mean([getattr(s, a) for s in scores]) for a in ("value", "success")
            )
            what = "" if name in attacks else "floor"
            yield track, name, float(value), float(success), what


def scored(task: phyblock.Task, attack: Reply | Sequence[str] | None, name: str) -> phyblock.Score:
    """Return the score of an attack, or of the baseline of this name."""
    if attack is not None or not task.plays:
        reply = attack or rule(name)
        return task.score(reply(task) if callable(reply) else reply)
    episode, answer = phyblock.Episode(task, shows=False), track_baselines(type(task.track))[name]
    while (request := episode.request) is not None:
        seed = int.from_bytes(drawn_bytes(f"{name}|{request.seed}|{request.key}"), "big")
        episode.step(answer(request.subject, np.random.default_rng(seed)))
    return episode.score()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=int, default=400)
    parser.add_argument("--physics-limit", type=int, default=16)
    given = parser.parse_args()
    print("| track | reply | mean reward | success | |\n|---|---|---|---|---|")
    for track, name, value, success, what in means(given.limit, given.physics_limit):
        print(f"| `{track}` | {name} | {value:.3f} | {success:.3f} | {what} |", flush=True)


if __name__ == "__main__":
    main()
