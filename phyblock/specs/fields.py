"""Field types that suites and models files share, and the errors they raise."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError
from typing_extensions import Self

__all__ = [
    "Count",
    "Flag",
    "MaxTokens",
    "ModelName",
    "PictureControls",
    "Section",
    "Temperature",
    "TemplateName",
    "TimeoutS",
    "TopP",
    "Unique",
    "UniqueSome",
    "check_unique",
    "refuse",
]

ItemT = TypeVar("ItemT", bound=Hashable)


class Section(BaseModel):
    """Base of all that is written in YAML: no unknown keys, no changes after reading.

    Fields in `later` came after runs were made without them: they are written out only where they
    say something, so that these runs stay the same.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    later: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _without_later(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        fields = type(self).model_fields
        silent = {
            name
            for name in self.later
            if getattr(self, name) == fields[name].get_default(call_default_factory=True)
        }
        return {name: value for name, value in write(self).items() if name not in silent}


def refuse(message: str, **context: Any) -> PydanticCustomError:
    """A validation error in plain words.

    `context` may hold `allowed`, `hint` and `words` (close ones are proposed), `at`, the path below
    the validated value where the fault stands, and `hides`: that the value must not be shown.
    """
    return PydanticCustomError("refused", "{message}", {"message": message, **context})


def check_unique(items: tuple[ItemT, ...]) -> tuple[ItemT, ...]:
    """The items as they are; a refusal when one stands twice."""
    seen: set[ItemT] = set()
    for index, item in enumerate(items):
        if item in seen:
            raise refuse("stands twice in this list", at=(index,), hint="keep one of them")
        seen.add(item)
    return items


Unique = Annotated[
    tuple[ItemT, ...], AfterValidator(check_unique), Field(json_schema_extra={"uniqueItems": True})
]
"""A list whose items all differ."""

UniqueSome = Annotated[
    tuple[ItemT, ...],
    Field(min_length=1, json_schema_extra={"uniqueItems": True}),
    AfterValidator(check_unique),
]
"""A list with at least one item, whose items all differ."""

Count = Annotated[int, Field(strict=True, ge=1, le=10**9)]
Temperature = Annotated[float, Field(strict=True, ge=0, le=2, allow_inf_nan=False)]
TopP = Annotated[float, Field(strict=True, gt=0, le=1, allow_inf_nan=False)]
MaxTokens = Count
TimeoutS = Annotated[float, Field(strict=True, gt=0, le=1e9, allow_inf_nan=False)]

ModelName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._:+-]{0,79}$")]
"""Names of models become names of folders and rows of tables, hence the narrow alphabet."""

Flag = Annotated[bool, Field(strict=True)]


class PictureControls(Section):
    """What a section of a track says to find out what answers owe to the picture."""

    blind: Flag = Field(
        default=False,
        description="Send no picture of what is asked about: of a question none at all, of a "
        "scene its candidates alone.",
    )
    wrong_image: Flag = Field(
        default=False,
        description="Show another scene, which the seed draws; candidates stay the right ones.",
    )

    @model_validator(mode="after")
    def _check_controls(self) -> Self:
        if self.blind and self.wrong_image:
            message = "shows another scene, where blind shows none"
            raise refuse(message, at=("wrong_image",), hint="set one of them")
        return self


def _check_template(prompt: str) -> str:
    if prompt == "default" or prompt.endswith(".j2"):
        return prompt
    raise refuse(
        "is neither a known prompt nor a template",
        allowed="default, or the path of a .j2 file",
        words=("default",),
    )


TemplateName = Annotated[
    str,
    AfterValidator(_check_template),
    Field(json_schema_extra={"pattern": r"^(default|.*\.j2)$"}),
]
