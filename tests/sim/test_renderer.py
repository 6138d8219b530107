from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.errors import InputError, SimulationError
from phyblock.sim.registry import RENDERERS, renderer


def test_ours_is_the_default_and_words_are_checked(monkeypatch) -> None:
    monkeypatch.delenv("PHYBLOCK_RENDERER", raising=False)
    assert renderer().name == "raster"
    monkeypatch.setenv("PHYBLOCK_RENDERER", "vulkan")
    with pytest.raises(InputError, match=f"allowed: {', '.join(RENDERERS)}, or module:factory"):
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
