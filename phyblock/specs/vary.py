"""The section `vary` of a suite: ways of asking that are crossed, so that each one's part shows.

A *factor* is a field of the suite with several values, its *levels*; the first level is the
reference. A *variant* is one choice of levels: the suite with these values in its fields.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from pathlib import PurePath
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, Field, model_validator
from typing_extensions import Self

from phyblock.specs.fields import Section, check_unique, refuse
from phyblock.specs.prompt import Prompt
from phyblock.types import Background, CandidateOrder, PictureLayout, View
from phyblock.variants import REPEAT, Variant

__all__ = ["FACTORS", "ExampleCount", "VarySpec", "with_values"]

FACTORS: Mapping[str, tuple[str, ...] | None] = {
    "prompt": None,
    "background": ("images", "background"),
    "view": ("images", "view"),
    "candidate_order": ("candidates", "order"),
    "layout": ("images", "layout"),
    "examples": ("examples",),
    REPEAT: None,
}
"""Factors with the path of the field that each gives values to; every track names its prompt in a
field of its own."""
_MOST_VARIANTS = 1000

LevelT = TypeVar("LevelT")
SpecT = TypeVar("SpecT", bound=BaseModel)


def _check_levels(levels: tuple[LevelT, ...]) -> tuple[LevelT, ...]:
    if len(levels) < 2:
        raise refuse("needs levels to compare", allowed="two or more, the reference first")
    return levels


Levels = Annotated[
    tuple[LevelT, ...],
    AfterValidator(check_unique),
    AfterValidator(_check_levels),
    Field(json_schema_extra={"uniqueItems": True, "minItems": 2}),
]


ExampleCount = Annotated[int, Field(strict=True, ge=0, le=16)]


class VarySpec(Section):
    """Ways of asking that are crossed; the first level of each is the reference."""

    later: ClassVar[tuple[str, ...]] = (*FACTORS, "design")

    prompt: Levels[Prompt] = Field(
        default=(), description="Prompts, as in the track's own field; for suites of one track."
    )
    background: Levels[Background] = Field(
        default=(), description="Grounds of rendered pictures, as images.background."
    )
    view: Levels[View] = Field(
        default=(), description="Where rendered scenes are seen from, as images.view."
    )
    candidate_order: Levels[CandidateOrder] = Field(
        default=(), description="Orders of the candidates, as candidates.order."
    )
    layout: Levels[PictureLayout] = Field(
        default=(), description="Layouts of pictures, as images.layout."
    )
    examples: Levels[ExampleCount] = Field(
        default=(), description="Numbers of worked examples, as examples."
    )
    repeats: Annotated[int, Field(strict=True, ge=1, le=100)] = Field(
        default=1,
        description="How often the same is asked, each time anew: the cache answers none but the "
        "first, and the provider is sent another seed.",
    )
    design: Literal["crossed", "one_at_a_time"] = Field(
        default="crossed",
        description="crossed: every level with every level of the others. one_at_a_time: each "
        "factor alone, the others at their reference; both ask each repeatedly.",
    )

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        names = list(self.names("prompt"))
        if twice := sorted({name for name in names if names.count(name) > 1}):
            allowed = "templates of different names"
            raise refuse(f"has two templates called {twice[0]}", at=("prompt",), allowed=allowed)
        if (n := self.n_variants) > _MOST_VARIANTS:
            allowed = f"{_MOST_VARIANTS:,} ways of asking at most"
            hint = "take levels out, or set vary.design to one_at_a_time"
            raise refuse(f"crosses to {n:,} ways of asking", allowed=allowed, hint=hint)
        return self

    @property
    def factors(self) -> tuple[str, ...]:
        """The factors that have several levels."""
        return tuple(name for name in FACTORS if len(self.values(name)) > 1)

    def values(self, factor: str) -> tuple[Any, ...]:
        """The levels of a factor as fields of the suite take them."""
        levels = getattr(self, factor)
        return tuple(range(1, levels + 1)) if factor == REPEAT else tuple(levels)

    def names(self, factor: str) -> tuple[str, ...]:
        """The levels of a factor as records and tables name them: of a template, its file's."""
        return tuple(_name(value) for value in self.values(factor))

    @property
    def n_variants(self) -> int:
        """How many ways of asking there are."""
        sizes = [len(self.values(name)) for name in self.factors if name != REPEAT]
        n = 1 + sum(size - 1 for size in sizes)
        if self.design == "crossed":
            n = 1
            for size in sizes:
                n *= size
        return n * self.repeats

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All ways of asking, the reference first, repeats of one behind one another."""
        shown = [name for name in self.factors if name != REPEAT]
        levels = [[(name, level) for level in self.names(name)] for name in shown]
        first = tuple(of_factor[0] for of_factor in levels)
        if self.design == "crossed":
            chosen = list(product(*levels))
        else:
            others = [
                (*first[:place], pair, *first[place + 1 :])
                for place, of_factor in enumerate(levels)
                for pair in of_factor[1:]
            ]
            chosen = [first, *others]
        again = [((REPEAT, name),) if n else () for n, name in enumerate(self.names(REPEAT))]
        return tuple(
            Variant((*(pair for pair in one if pair not in first), *repeat))
            for one in chosen
            for repeat in again
        )

    def value(self, factor: str, level: str) -> Any:
        """The value of a level; ValueError for one that there is not."""
        return self.values(factor)[self.names(factor).index(level)]


def _name(value: object) -> str:
    text = str(value)
    return PurePath(text).stem if text.endswith(".j2") else text


def with_values(spec: SpecT, values: Mapping[tuple[str, ...], Any]) -> SpecT:
    """A validated suite or section with other values at these paths of fields."""
    for path, value in values.items():
        name, below = path[0], path[1:]
        inner = with_values(getattr(spec, name), {below: value}) if below else value
        spec = spec.model_copy(update={name: inner})
    return spec
