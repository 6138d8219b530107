"""The Gymnasium environment: its interface, its rules, its pictures."""

import io
import re
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from PIL import Image

import phyblock
import phyblock.env
from phyblock.domain.blocks import BLOCK_TYPES, COLORS
from phyblock.domain.scene import CandidateSet, PoseStep
from phyblock.env import DONE, PhyBlockEnv
from phyblock.scoring.pose import blocks_reached
from phyblock.sim.dynamics import execute
from phyblock.sim.geometry import put
from phyblock.types import SETTINGS
from tests.shipped import TASKS
from tests.tracks.conftest import seesaw

SOME = TASKS[::20]


def solve(env, info):
    total, ended = 0.0, False
    while not ended:
        _, reward, ended, cut, info = env.step(info["right_moves"][0])
        assert reward == 1
        assert not cut
        total += reward
    return total, info


def wrong_move(info):
    return next(n for n in range(1, 17) if n not in info["right_moves"])


OPTIONS = {
    "pictures": {"size_px": 32},
    "text": {"observe": "text", "size_px": 32},
    "strict": {"observe": "state", "physics": "strict"},
    "poses": {"action": "pose", "size_px": 32},
    "strict poses": {"action": "pose", "observe": "state", "physics": "strict"},
}


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_gymnasium_finds_nothing_wrong(options):
    env = gymnasium.make(phyblock.env.ENV_ID, render_mode="rgb_array", **options)
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize(
    ("tasks", "options"),
    [
        *((SOME, {"setting": setting, "physics": "off"}) for setting in SETTINGS),
        ([one for one in SOME if len(one.scene) < 9][:3], {"action": "pose", "physics": "strict"}),
    ],
)
def test_an_agent_that_knows_finishes_every_scene_in_as_many_steps_as_blocks(tasks, options):
    env = PhyBlockEnv(tasks, observe="state", **options)
    for task in tasks:
        _, info = env.reset(options={"scene": task.scene.id})
        total, info = solve(env, info)
        assert info["is_complete"]
        assert total == info["step"] == info.get("reached", total) == len(task.scene)
    env.close()


def test_a_state_holds_the_goal_and_the_candidates():
    env = PhyBlockEnv(SOME, observe="state")
    for task in SOME:
        observation, _ = env.reset(options={"scene": task.scene.id})
        goal, candidates = observation["goal"], observation["candidates"]
        assert goal[:, 0].sum() == len(task.scene)
        assert candidates[:, 0].sum() == len(task.candidates)
        for row, block in zip(goal, task.scene.blocks, strict=False):
            assert (BLOCK_TYPES[int(row[1])], COLORS[int(row[2])]) == (block.type, block.color)
            assert row[3:6] == pytest.approx(block.euler_deg, abs=1e-3)
            assert row[6:] == pytest.approx(block.position_m, abs=1e-5)
        assert env.action_masks().sum() == 1 + len(task.candidates)


def test_a_text_is_the_prompt_of_step_planning_after_the_same_steps():
    suite = ("candidates.order=file", "images.size_px=128", "steps.max_steps=12")
    task = next(iter(phyblock.tasks("step_planning", *suite, data=SOME[:1])))
    env = PhyBlockEnv(SOME[:1], observe="text", size_px=128, max_steps=12)
    episode, (observation, info) = task.episode(), env.reset()
    for action in (wrong_move(info), info["right_moves"][0], 99):
        sent = [part for message in episode.request.messages for part in message.parts]
        shown = [p if isinstance(p, str) else f"[picture: {p.label}]" for p in sent]
        assert observation["text"] == "\n\n".join(shown)
        for picture in (part for part in sent if not isinstance(part, str)):
            pixels = np.asarray(Image.open(io.BytesIO(picture.data)).convert("RGB"))
            assert np.array_equal(pixels, observation[picture.label])
        if action < 17:
            episode.step(f"Next plan: Move({action})")
            observation = env.step(action)[0]


@pytest.mark.parametrize("options", [{}, {"action": "pose"}], ids=["blocks", "poses"])
def test_masked_samples_name_candidates_of_the_scene(options):
    short = replace(SOME[0], candidates=CandidateSet(SOME[0].candidates.candidates[:5]))
    env = PhyBlockEnv([short], observe="state", **options)
    _, info = env.reset()
    mask = info["action_mask"]
    assert mask.tolist() == env.action_masks().tolist() == [1] * 6 + [0] * 11
    if options:
        actions = [env.action_space.sample({"block": mask, "center_m": None}) for _ in range(60)]
        numbers = {int(action["block"]) for action in actions}
    else:
        numbers = {int(env.action_space.sample(mask)) for _ in range(60)}
    assert numbers == set(range(6))
    env.close()


def test_a_wrong_move_changes_nothing_and_a_finished_assembly_looks_like_the_goal():
    env = PhyBlockEnv(SOME[:1], size_px=64, physics="off", render_mode="rgb_array")
    observation, info = env.reset()
    assert {picture.shape for picture in observation.values()} == {(64, 64, 3)}
    assert not np.array_equal(observation["current"], observation["goal"])
    after, reward, ended, cut, told = env.step(wrong_move(info))
    assert (reward, ended, cut, told["placed"]) == (0, False, False, ())
    assert told["outcome"] not in ("placed", "begun", "done")
    assert np.array_equal(after["current"], observation["current"])
    solve(env, told)
    assert np.array_equal(env.render(), observation["goal"])


@pytest.mark.parametrize(
    ("physics", "fallen", "ended"),
    [("off", (), False), ("settle", (3,), False), ("strict", (3,), True)],
)
def test_what_physics_does_with_what_cannot_stand(physics, fallen, ended):
    def played(physics):
        env = PhyBlockEnv([seesaw()], physics=physics, size_px=128)
        env.reset()
        env.step(1)
        return env.step(3)

    observation, reward, has_ended, _, info = played(physics)
    assert (reward, info["fallen"], has_ended) == (1, fallen, ended)
    expected = played("off")[0]["current"]
    assert np.array_equal(observation["current"], expected) == (physics != "strict")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"setting": "C"}, "setting is 'C'; allowed: A, B"),
        ({"physics": "strct"}, "allowed: off, settle, strict"),
        ({"size_px": 15}, "size_px is 15, allowed 16..2048"),
        ({"render_mode": "human"}, "render_mode is 'human'; allowed: rgb_array, None"),
        ({"max_steps": 0}, "max_steps is 0"),
        ({"data": ()}, "no tasks"),
        ({"action": "pose", "physics": "off"}, "allowed: settle, strict"),
        ({"action": "pose", "setting": "B"}, "remove them"),
        ({"action": "pose", "observe": "text"}, "of action='block' alone"),
        ({"levels": (2, 9)}, r"levels is \(2, 9\); allowed: several of \(1, 2, 3, 4, 5\)"),
    ],
)
def test_an_option_that_is_not_allowed_is_said(options, message):
    with pytest.raises(ValueError, match=message):
        PhyBlockEnv(**{"data": SOME, **options})


@pytest.mark.parametrize("limit", [{}, {"max_steps": 1}, {"max_failures": 1}])
def test_nothing_is_carried_out_after_the_end(limit):
    env = PhyBlockEnv(SOME[:1], observe="state", physics="off", **limit)
    _, info = env.reset()
    _, reward, ended, cut, info = env.step(wrong_move(info) if limit else DONE)
    assert (reward, ended, cut) == (0, not limit, bool(limit))
    assert limit or info["outcome"] == "done"
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        env.step(DONE)
    _, info = env.reset()
    *_, info = env.step(info["right_moves"][0])
    assert len(info["chosen"]) == 1


def test_poses_are_carried_out_as_a_plan_is():
    """Blocks that fall or are refused, too; the return is how many are reached."""
    env = PhyBlockEnv([seesaw()], action="pose", observe="state", max_steps=20)
    kit = seesaw().candidates
    plan = [
        PoseStep(1, (0.0, 0.0, 2.5)), PoseStep(3, (5.5, 0.0, 6.25)), PoseStep(2, (11.0, 0.0, 2.5)),
        PoseStep(16, (0.0, 0.0, 2.5)), PoseStep(2, (0.0, 0.3, 2.5)), PoseStep(2, (0.0, 0.0, 30.0)),
    ]  # fmt: skip
    done = execute([put(step, kit) for step in plan])
    env.reset()
    total = 0.0
    for step, ended in zip(plan, done.steps, strict=True):
        action = {"block": step.candidate, "center_m": np.array(step.center_cm) / 100}
        observation, reward, _, _, info = env.step(action)
        assert info["outcome"] == ended.end
        assert (info["moved_cm"], info["knocked"]) == (ended.moved_cm, ended.knocked)
        assert observation in env.observation_space
        total += reward
    assert {"stands", "falls", "no_block", "overlaps"} <= {step.end for step in done.steps}
    assert total == blocks_reached(seesaw().scene.blocks, done.blocks, 1.0, 10.0)
    assert int(observation["world"][:, 0].sum()) == len(done.blocks)
    env.close()


def test_an_action_that_is_no_pose_is_said():
    env = PhyBlockEnv([seesaw()], action="pose", observe="state")
    env.reset()
    for wrong, message in (
        (1, "a mapping of block, center_m"),
        ({"block": 17, "center_m": (0, 0, 0)}, "outside 0..16"),
        ({"block": 1, "center_m": (0, 0, float("nan"))}, "action center_m is"),
        ({"block": 1, "center_m": (0, 0, 1.01)}, "allowed: 3 numbers"),
        ({"block": 1, "center_m": (0, 0)}, "allowed: 3 numbers"),
        ({"block": 1}, "a mapping of"),
    ):
        with pytest.raises(ValueError, match=message):
            env.step(wrong)
    assert env.step({"block": DONE, "center_m": (0, 0, 0)})[2]
    env.close()


PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "agent.md"
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("code", EXAMPLES, ids=range(len(EXAMPLES)))
def test_what_the_docs_show_runs(code, capsys):
    exec(compile(code, "agent.md", "exec"), {})
    if "right_moves" in code:
        complete, total, blocks = capsys.readouterr().out.split()
        assert (complete, float(total)) == ("True", float(blocks))
