"""The styles in which a run showed its pictures."""

from __future__ import annotations

from phyblock.config.suite import FACTORS, ImagesSpec, with_values
from phyblock.results.load import Run

__all__ = ["images_of"]

_SECTION = "images"


def images_of(run: Run) -> tuple[ImagesSpec, ...]:
    """What a run's suite says of pictures, in every way of asking that has other ones."""
    vary, images = run.design.suite.vary, run.section(_SECTION, ImagesSpec)
    found = {images: None}
    for variant in vary.variants:
        paths = [(FACTORS[factor] or (), factor, level) for factor, level in variant.levels]
        values = {
            path[1:]: vary.value(factor, level)
            for path, factor, level in paths
            if path[:1] == (_SECTION,)
        }
        found[with_values(images, values)] = None
    return tuple(found)
