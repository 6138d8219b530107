"""Validation against pydantic models: every error in plain words and at its place.

Types describe single values; rules between values yield `Fault`s. `problems_of` puts all in words.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError, core_schema

from phyblock.config.yaml import FieldPath, YamlSource, dotted, shown
from phyblock.domain.blocks import BLOCK_TYPES, BlockType
from phyblock.domain.question import SUBTASKS, Subtask
from phyblock.errors import Problem, SpecError
from phyblock.text import did_you_mean
from phyblock.types import BACKGROUNDS, Background

ModelT = TypeVar("ModelT", bound=BaseModel)
ItemT = TypeVar("ItemT", bound=Hashable)

_MOST = 100
"""Maximum number of reported problems per value."""
_FAULT = "fault"
_TYPE, _RANGE = "has the wrong type", "is out of range"
_CHOICE = "is not one of the choices"
_MESSAGES: dict[str, tuple[str, str]] = {
    "missing": ("is missing", ""),
    "extra_forbidden": ("is not a known key", ""),
    "literal_error": (_CHOICE, "{expected}"),
    "union_tag_invalid": (_CHOICE, "{expected_tags}"),
    "union_tag_not_found": ("is missing", ""),
    "int_type": (_TYPE, "a whole number"),
    "int_from_float": (_TYPE, "a whole number"),
    "float_type": (_TYPE, "a number"),
    "sequence_str": (_TYPE, "a list, such as [a, b]"),
    "string_type": (_TYPE, "a text"),
    "bool_type": (_TYPE, "true or false"),
    "tuple_type": (_TYPE, "a list, such as [a, b]"),
    "list_type": (_TYPE, "a list, such as [a, b]"),
    "dict_type": (_TYPE, "a mapping (key: value)"),
    "model_type": (_TYPE, "a mapping (key: value)"),
    "is_instance_of": (_TYPE, "a {class}"),
    "finite_number": (_RANGE, "a finite number"),
    "greater_than": (_RANGE, "above {gt}"),
    "greater_than_equal": (_RANGE, "at least {ge}"),
    "less_than": (_RANGE, "below {lt}"),
    "less_than_equal": (_RANGE, "at most {le}"),
    "too_short": ("has too few items", "at least {min_length}"),
    "too_long": ("has too many items", "at most {max_length}"),
    "string_too_short": ("is too short", "at least {min_length}"),
    "string_too_long": ("is too long", "at most {max_length}"),
    "string_pattern_mismatch": ("has the wrong form", "{pattern}"),
}
"""Message and allowed values, by pydantic's error types."""
_FORMS: dict[str, str] = {}
"""Descriptions of regular expressions."""


class Fault(NamedTuple):
    """One problem; `at` is its place inside the checked value.

    `found` is shown as it is; None shows the value at the place. `key` means that the key is wrong.
    """

    message: str
    allowed: str = ""
    found: str | None = None
    at: FieldPath = ()
    hint: str = ""
    key: bool = False


def fault(*faults: Fault) -> ValidationError:
    """Return the exception that a validator raises to report these faults."""
    lines = [
        InitErrorDetails(
            type=PydanticCustomError(_FAULT, "{message}", one._asdict()), loc=one.at, input=None
        )
        for one in faults
    ]
    return ValidationError.from_exception_data(_FAULT, lines)


def form(pattern: str, words: str) -> Any:
    """Return the constraint of a text to a regular expression, which errors describe in words."""
    _FORMS[pattern] = words
    return Field(pattern=pattern)


def checked(find: Callable[[Any], Iterable[Fault]]) -> AfterValidator:
    """Return a validator that `find` yields no faults for a value with valid parts."""

    def check(value: Any) -> Any:
        if faults := tuple(find(value)):
            raise fault(*faults)
        return value

    return AfterValidator(check)


class Section(BaseModel):
    """Base of all YAML models: no unknown keys, frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    def faults(self) -> Iterator[Fault]:
        """Yield faults between fields, each of which is valid."""
        yield from ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if faults := tuple(self.faults()):
            raise fault(*faults)
        return self


@dataclass(frozen=True)
class OneOf:
    """A check that a value is in a list at validation time, to which plugins may add.

    `kind` is the type of values where the annotation names only the built-in ones.
    """

    choices: Callable[[], Iterable[Any]]
    kind: type | None = None

    def __get_pydantic_core_schema__(
        self, source: Any, handler: Callable[[Any], core_schema.CoreSchema]
    ) -> core_schema.CoreSchema:
        inner = handler(self.kind or source)
        return core_schema.no_info_after_validator_function(self._check, inner)

    def __get_pydantic_json_schema__(self, *_: object) -> dict[str, Any]:
        return {"enum": [*self.choices()]}

    def _check(self, value: object) -> object:
        known = tuple(self.choices())
        if value in known:
            return value
        words = [one if isinstance(one, str) else shown(one) for one in known]
        raise fault(Fault(_CHOICE, ", ".join(words), hint=did_you_mean(str(value), words)))


ShapeName = Annotated[BlockType, OneOf(lambda: BLOCK_TYPES, str)]
BackgroundName = Annotated[Background, OneOf(lambda: BACKGROUNDS, str)]
SubtaskName = Annotated[Subtask, OneOf(lambda: SUBTASKS, str)]


def _repeated(items: tuple[Hashable, ...]) -> Iterator[Fault]:
    seen: set[Hashable] = set()
    for index, item in enumerate(items):
        if item in seen:
            yield Fault("is listed twice", at=(index,), hint="remove one of them")
        seen.add(item)


_DISTINCT = Field(json_schema_extra={"uniqueItems": True})
Unique = Annotated[tuple[ItemT, ...], checked(_repeated), _DISTINCT]
"""A list whose items all differ."""
UniqueSome = Annotated[tuple[ItemT, ...], Field(min_length=1), checked(_repeated), _DISTINCT]
"""A list with at least one item, whose items all differ."""
Count = Annotated[int, Field(strict=True, ge=1, le=10**9)]
Flag = Annotated[bool, Field(strict=True)]
TimeoutS = Annotated[float, Field(strict=True, gt=0, le=1e9)]
Cost = Annotated[float, Field(strict=True, ge=0, le=1e9)]
Text = Annotated[str, Field(min_length=1)]
HYPHENATED = "small letters, digits and hyphens"
_NAMED = "up to 80 letters, digits and . _ : + -, a letter or digit first"
ModelName = Annotated[str, form(r"^[A-Za-z0-9][A-Za-z0-9._:+-]{0,79}$", _NAMED)]
"""Names of models become names of folders and rows of tables, hence the narrow alphabet."""
Template = Annotated[str, form(r"\.j2$", "the path of a .j2 file")]
TemplateName = Literal["default"] | Template


class PictureControls(Section):
    """Controls of a track's section that measure how much answers depend on pictures."""

    blind: Flag = False
    """Do not send the picture of the goal; for questions, any picture."""


def read_section(model: type[ModelT], source: YamlSource) -> ModelT:
    """Return a YAML document as its model. Raises SpecError with all problems, as in the file."""
    try:
        return model.model_validate(source.data)
    except ValidationError as error:
        problems = problems_of(error, model, source.data, source)
        raise SpecError(source.in_order(problems)) from None


def problems_of(
    error: ValidationError,
    model: type[BaseModel],
    data: object,
    source: YamlSource | str,
    base: FieldPath = (),
) -> list[Problem]:
    """Return pydantic's errors about `data` as problems, in words.

    The data is at `base` of a YAML source, or all at one place. Errors of several union members
    about the same value are one problem, and none if a part of the value has a problem.
    """
    problems: dict[tuple[FieldPath, str], Problem] = {}
    above: set[FieldPath] = set()
    for detail in islice(error.errors(include_url=False), _MOST):
        # The path in the data lacks pydantic's names of union members.
        path: FieldPath = ()
        kind, value, loc = detail["type"], data, detail["loc"]
        if kind.startswith("union_tag"):
            loc += (detail.get("ctx", {}).get("discriminator", "").strip("'"),)
        for n, part in enumerate(loc, 1):
            is_last = n == len(loc) and kind in ("missing", "union_tag_not_found")
            may_lack = part != "[key]" and (kind == _FAULT or is_last)
            if isinstance(value, Mapping) and (part in value or may_lack):
                value = value.get(part)
            elif isinstance(value, list) and isinstance(part, int) and part < len(value):
                value = value[part]
            else:
                continue
            path += (part,)
        is_ours = kind == _FAULT
        one = Fault(**detail["ctx"]) if is_ours else _fault(detail, path, value, model)
        key = (path, one.message if is_ours else "")
        if first := problems.get(key):
            both = dict.fromkeys(filter(None, (first.allowed, one.allowed)))
            problems[key] = replace(first, allowed=" or ".join(both), hint=first.hint or one.hint)
            continue
        at = (*base, *(path[:-1] if one.message == "is missing" else path))
        where = source if isinstance(source, str) else source.where(at, key=one.key)
        found = shown(value) if one.found is None else one.found
        problems[key] = Problem(where, one.message, dotted(path), found, one.allowed, one.hint)
        above.update(path[:end] for end in range(len(path)))
    return [one for (path, kind), one in problems.items() if kind or path not in above]


def _fault(detail: ErrorDetails, path: FieldPath, value: Any, model: type[BaseModel]) -> Fault:
    """Return a pydantic error in plain words."""
    kind, context = detail["type"], detail.get("ctx", {})
    message, allowed = _MESSAGES.get(kind, (detail["msg"].lower(), ""))
    name = str(path[-1]) if path else ""
    if kind == "missing" and isinstance(detail["loc"][-1], int):
        return Fault("has too few items")
    if kind == "missing":
        return Fault(message, found="", hint=f"add {name}: ...", key=True)
    if kind == "extra_forbidden":
        known = _parts(_section(model, path[:-1]))
        homes = (at for at, below in known.items() if any(name in _parts(one) for one in below))
        home = next(homes, "")
        hint = f"it belongs at {home}.{name}" if home else did_you_mean(name, known)
        return Fault(message, ", ".join(known), "", hint=hint, key=True)
    hint = ""
    if kind == "literal_error":
        words = re.findall(r"[^\s',]+", context["expected"].replace(" or ", " "))
        allowed = ", ".join(words)
        hint = did_you_mean(value, words) if isinstance(value, str) else ""
    elif kind == "string_pattern_mismatch":
        allowed = _FORMS.get(context["pattern"], context["pattern"])
    elif kind in ("int_type", "float_type") and shown(value).strip('"').isdecimal():
        hint = "remove the quotes"
    elif kind == "string_type" and isinstance(value, int | float):
        hint = f'put it in quotes: "{value}"'
    elif kind == "tuple_type" and (listed := _listed(name, value)):
        hint = f"write a list: {listed}"
    elif kind == "model_type" and type(value) is str and "path" in _parts(_section(model, path)):
        hint = f"write {name}: {{path: {value}}}"
    else:
        allowed = allowed.format_map(context)
    if "[key]" in detail["loc"]:
        return Fault(message, allowed, shown(name), key=True)
    return Fault(message, allowed, hint=hint)


def _listed(name: str, value: Any) -> str:
    """Return the list that a value without brackets probably means, or "" if unclear."""
    if type(value) is int and name == "seeds":
        return str([*range(value)]) if 0 < value <= 10 else ""
    if type(value) is int:
        return str([value])
    if not isinstance(value, str):
        return ""
    if ends := re.fullmatch(r"(\d{1,2}) *- *(\d{1,2})", value):
        return str([*range(int(ends[1]), int(ends[2]) + 1)])
    return f"[{value}]" if re.search("[A-Za-z,]", value) else ""


def _section(model: type[BaseModel], path: FieldPath) -> type[BaseModel]:
    """Return the model of the value at `path`, or the nearest one around it."""
    for part in path:
        parts = _parts(model)
        model = next(iter(parts.get(str(part), parts.get("root", ()))), model)
    return model


def _parts(model: type[BaseModel]) -> dict[str, list[type[BaseModel]]]:
    """Return the models in the types of a model's fields, by the names used in files."""
    fields = {field.alias or name: field for name, field in model.model_fields.items()}
    return {name: _models_in(one.annotation) for name, one in fields.items() if not one.exclude}


def _models_in(hint: Any) -> list[type[BaseModel]]:
    """Return the models in a type."""
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return [hint]
    return [part for argument in get_args(hint) for part in _models_in(argument)]
