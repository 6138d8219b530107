"""The environment's speed: steps a second with and without pictures, alone and as a vector.

    python benchmarks/perf/environment.py [--seconds 5] [--size 512]

A random agent tries any candidate, so most of its moves fail and change nothing; a knowing one
places a block with every step. Episodes begin again on another scene of the built-in 400, so most
states are new to the simulator, and what a new scene costs is part of the rates. In `seen before`
every state of the knowing agent was tried in an earlier episode, as most are in training. The last
column says how many times as long a step of the knowing agent takes as one that neither draws nor
simulates.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np

from phyblock.env import DONE, PhyBlockEnv, read_tasks

TASKS = read_tasks("phyblock-400")
VECTOR = 64
FEW = 20

Agent = Callable[[PhyBlockEnv], int]


def random_agent(env: PhyBlockEnv) -> int:
    return 1 + int(env.action_space.sample()) % 16


def knowing_agent(env: PhyBlockEnv) -> int:
    return env.right_moves()[0]


def rate(agent: Agent, seconds: float, **options: Any) -> float:
    env = PhyBlockEnv(TASKS, **options)
    measured = play(env, agent, seconds)
    env.close()
    return measured


def play(env: PhyBlockEnv, agent: Agent, seconds: float) -> float:
    env.reset(seed=0)
    env.action_space.seed(0)
    start, steps = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        _, _, ended, cut, _ = env.step(agent(env))
        steps += 1
        if ended or cut:
            env.reset()
    return steps / (time.perf_counter() - start)


def seen_rate(seconds: float, **options: Any) -> float:
    """Of a knowing agent on scenes that it has built before in the same way."""
    env = PhyBlockEnv(TASKS[:: len(TASKS) // FEW], **options)
    for task in TASKS[:: len(TASKS) // FEW]:
        _, info = env.reset(options={"scene": task.scene.id})
        while not info["is_complete"]:
            *_, info = env.step(knowing_agent(env))
    measured = play(env, knowing_agent, seconds)
    env.close()
    return measured


def vector_rate(seconds: float, kind: str, **options: Any) -> float:
    """Steps of all scenes together; the actions are right moves."""
    makers = [partial(PhyBlockEnv, [task], **options) for task in TASKS[:: len(TASKS) // VECTOR]]
    makers = makers[:VECTOR]
    envs = getattr(gymnasium.vector, kind)(makers)
    _, infos = envs.reset(seed=0)
    # The first right move opens a simulator for each scene.
    *_, infos = envs.step(known_actions(infos))
    start, steps = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        *_, infos = envs.step(known_actions(infos))
        steps += len(makers)
    taken_s = time.perf_counter() - start
    envs.close()
    return steps / taken_s


def known_actions(infos: dict[str, Any]) -> np.ndarray:
    return np.array([moves[0] if moves else DONE for moves in infos["right_moves"]])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--size", type=int, default=512)
    options = parser.parse_args()
    state: dict[str, Any] = {"observe": "state"}
    pictures: dict[str, Any] = {"observe": "pictures", "size_px": options.size}
    bare = 0.0
    print(f"{'steps a second':<44}{'random':>10}{'knowing':>10}{'ratio':>10}")
    for name, kind in (("no pictures", state), (f"pictures of {options.size} px", pictures)):
        for physics in ("off", "settle", "strict"):
            rates = [
                rate(agent, options.seconds, physics=physics, **kind)
                for agent in (random_agent, knowing_agent)
            ]
            bare = bare or rates[1]
            row = "".join(f"{one:>10,.1f}" for one in rates)
            print(f"{f'{name}, physics {physics}':<44}{row}{bare / rates[1]:>10,.1f}", flush=True)
    for physics in ("settle", "strict"):
        one = seen_rate(options.seconds, physics=physics, **state)
        name = f"no pictures, physics {physics}, seen before"
        print(f"{name:<54}{one:>10,.1f}{bare / one:>10,.1f}", flush=True)
    for kind_name in ("SyncVectorEnv", "AsyncVectorEnv"):
        one = vector_rate(options.seconds, kind_name, physics="settle", **state)
        name = f"{kind_name} of {VECTOR}, no pictures, physics settle"
        print(f"{name:<54}{one:>10,.1f}{bare / one:>10,.1f}", flush=True)


if __name__ == "__main__":
    main()
