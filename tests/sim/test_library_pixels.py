"""Pictures are known by what the library draws, not by its version."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import PIL
import pytest
from PIL import ImageDraw

from phyblock.sim.library_pixels import library_pixels
from phyblock.sim.pictures import pixel_versions


@pytest.fixture(autouse=True)
def _asked_anew() -> Iterator[None]:
    library_pixels.cache_clear()
    yield
    library_pixels.cache_clear()


def test_a_version_that_draws_alike_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    before = pixel_versions()
    library_pixels.cache_clear()
    monkeypatch.setattr(PIL, "__version__", "99.0.0")
    assert pixel_versions() == before


@pytest.mark.parametrize("method", ["text", "ellipse", "polygon", "line", "rectangle"])
def test_a_version_that_draws_otherwise_is_another(
    monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    before = library_pixels()
    library_pixels.cache_clear()
    monkeypatch.setattr(ImageDraw.ImageDraw, method, _nothing)
    assert library_pixels() != before


def _nothing(*_: Any, **__: Any) -> None:
    """Draw nothing."""
