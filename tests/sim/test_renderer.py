from __future__ import annotations

import io
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from phyblock.errors import InputError, SimulationError
from phyblock.sim import PictureStyle, goal_key, goal_png
from phyblock.sim.bullet.egl import draw_with_egl, succeeds_in_child
from phyblock.sim.registry import renderer
from tests.designs.scenes import designed_scenes

SCENE = designed_scenes()[0]
STYLE = PictureStyle(size_px=128)
DRAW = """
import sys
from pathlib import Path
from tests.designs.scenes import designed_scenes
from phyblock.sim import PictureStyle, goal_key, goal_png
from phyblock.sim.registry import renderer
if __name__ == "__main__":
    scene, style = designed_scenes()[0], PictureStyle(size_px=128)
    Path(sys.argv[1]).write_bytes(goal_png(scene, style))
    print(f"\\nANSWER {renderer().name} {goal_key(scene, style)}", flush=True)
"""


def crash() -> None:
    os.abort()


def fail() -> None:
    raise SystemExit(3)


def hang() -> None:
    time.sleep(600)


def work() -> None:
    print("a driver's chatter")


@pytest.mark.parametrize(("probe", "answer"), [(work, True), (crash, False), (fail, False)])
def test_a_probe_answers_whatever_becomes_of_it(probe, answer, capfd) -> None:
    assert succeeds_in_child(probe) is answer
    assert capfd.readouterr().out == ""


def test_a_probe_that_hangs_is_given_up() -> None:
    assert succeeds_in_child(hang, patience_s=0.5) is False


def test_tinyrenderer_is_the_default_and_words_are_checked(monkeypatch) -> None:
    monkeypatch.delenv("PHYBLOCK_RENDERER", raising=False)
    assert renderer().name == "tinyrenderer"
    monkeypatch.setenv("PHYBLOCK_RENDERER", "vulkan")
    with pytest.raises(InputError, match="tinyrenderer, egl, auto"):
        renderer()


def refuses() -> None:
    raise SimulationError("no such device")


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("json:loads", "cannot be made: TypeError: loads"),
        ("json:nothing", "cannot be imported: AttributeError"),
        ("nowhere_at_all:make", "cannot be imported: ModuleNotFoundError"),
        ("fails:make", "cannot be imported: ZeroDivisionError"),
        ("json:__name__", "names nothing that can be called"),
        ("json:JSONEncoder", "names no renderer"),
    ],
)
def test_what_makes_no_renderer_is_refused_in_words(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, word: str, said: str
) -> None:
    (tmp_path / "fails.py").write_text("1 / 0", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PHYBLOCK_RENDERER", word)
    with pytest.raises(InputError, match=said):
        renderer()


def test_what_a_renderer_says_of_itself_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PHYBLOCK_RENDERER", f"{__name__}:refuses")
    with pytest.raises(SimulationError, match="no such device"):
        renderer()


def test_the_probe_decides_and_the_key_names_the_renderer(tmp_path) -> None:
    """Where EGL works, its picture is much the same, under another key; elsewhere it is ours."""
    works = succeeds_in_child(draw_with_egl)
    script, picture = tmp_path / "draw.py", tmp_path / "picture.png"
    script.write_text(DRAW)
    paths = os.pathsep.join(path for path in sys.path if path)
    env = {**os.environ, "PHYBLOCK_RENDERER": "auto", "PYTHONPATH": paths}
    command = [sys.executable, str(script), str(picture)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    chosen, key = done.stdout.split("ANSWER ")[1].split()[:2]
    assert chosen == ("egl" if works else "tinyrenderer")
    assert (key == goal_key(SCENE, STYLE)) == (not works)
    ours, theirs = (
        np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)
        for data in (goal_png(SCENE, STYLE), picture.read_bytes())
    )
    assert np.abs(ours - theirs).mean() < (6 if works else 1e-9)


def test_asking_for_egl_fails_plainly_where_it_does_not_work(tmp_path) -> None:
    script = tmp_path / "draw.py"
    script.write_text(DRAW)
    paths = os.pathsep.join(path for path in sys.path if path)
    env = {**os.environ, "PHYBLOCK_RENDERER": "egl", "PYTHONPATH": paths}
    env |= {"LIBGL_DRIVERS_PATH": str(tmp_path), "__EGL_VENDOR_LIBRARY_DIRS": str(tmp_path)}
    command = [sys.executable, str(script), str(tmp_path / "picture.png")]
    done = subprocess.run(command, env=env, capture_output=True, text=True)
    assert done.returncode == 1
    assert "a trial in a child process failed" in done.stderr
