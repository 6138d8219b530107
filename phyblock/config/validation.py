"""Validation against pydantic models, with every error in plain words and at its place."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    ValidationError,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError, PydanticKnownError

from phyblock.config.yaml import FieldPath, YamlSource, dotted, looks_secret, show
from phyblock.domain.blocks import BLOCK_TYPES, BlockType
from phyblock.domain.question import SUBTASKS, Subtask
from phyblock.errors import Problem
from phyblock.text import did_you_mean
from phyblock.types import BACKGROUNDS, Background

ModelT = TypeVar("ModelT", bound=BaseModel)
ItemT = TypeVar("ItemT", bound=Hashable)

_MOST = 100
"""Problems of one mapping that are told."""
_SECRET_KEYS = frozenset(
    {"api_key", "apikey", "api-key", "token", "secret", "password", "authorization",
     "x-api-key"}
)  # fmt: skip
"""Keys under which only a secret would be written."""
_KEY_HINT = "name an environment variable with api_key_env, and keep the key in it"
_WANTED = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list, such as [a, b]",
    "dict_type": "a mapping (key: value)",
    "model_type": "a mapping (key: value)",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "above"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "below"),
    "less_than_equal": ("le", "at most"),
}
_PATTERNS = {
    "name": "1 to 64 small letters, digits and hyphens",
    "groups": "1 to 40 small letters, digits and hyphens",
    "models": "up to 80 letters, digits and . _ : + -, starting with a letter or digit",
    "api_key_env": "the name of an environment variable, such as MY_KEY",
}


class Section(BaseModel):
    """Base of all that is written in YAML: no unknown keys, no changes after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


def refuse(message: str, **context: Any) -> PydanticCustomError:
    """Make a validation error in plain words.

    `context` may hold `allowed`, `hint` and `words` (close ones are proposed), `at`, the path below
    the validated value where the fault stands, `key`, that its key is meant, `reads`, other fields
    that it may stand at, and `hides`: that the value must not be shown.
    """
    return PydanticCustomError("refused", "{message}", {"message": message, **context})


def check_unique(items: tuple[ItemT, ...]) -> tuple[ItemT, ...]:
    """Return the items as they are; a refusal when one stands twice."""
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
Flag = Annotated[bool, Field(strict=True)]
Temperature = Annotated[float, Field(strict=True, ge=0, le=2, allow_inf_nan=False)]
TopP = Annotated[float, Field(strict=True, gt=0, le=1, allow_inf_nan=False)]
TimeoutS = Annotated[float, Field(strict=True, gt=0, le=1e9, allow_inf_nan=False)]
ModelName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._:+-]{0,79}$")]
"""Names of models become names of folders and rows of tables, hence the narrow alphabet."""


def one_of(words: Sequence[str], built_in: Any) -> PlainValidator:
    """Return the check of a word that is in a list when it is read: plugins add words to it.

    JSON Schemas name the built-in ones.
    """

    def checked(word: object) -> object:
        if word in words:
            return word
        expected = " or ".join(f"'{each}'" for each in words)
        raise PydanticKnownError("literal_error", {"expected": expected})

    return PlainValidator(checked, json_schema_input_type=built_in)


if TYPE_CHECKING:
    ShapeName = BlockType
    BackgroundName = Background
    SubtaskName = Subtask
else:
    ShapeName = Annotated[str, one_of(BLOCK_TYPES, BlockType)]
    BackgroundName = Annotated[str, one_of(BACKGROUNDS, Background)]
    SubtaskName = Annotated[str, one_of(SUBTASKS, Subtask)]


def prompt_check(*words: str) -> Callable[[str], str]:
    """Return the check of a prompt: one of these words, or the path of a template."""
    allowed = f"{', '.join(words)}, or the path of a .j2 file"

    def checked(prompt: str) -> str:
        if prompt in words or prompt.endswith(".j2"):
            return prompt
        message = "is neither a known prompt nor a template"
        raise refuse(message, allowed=allowed, words=words)

    return checked


TemplateName = Annotated[
    str,
    AfterValidator(prompt_check("default")),
    Field(json_schema_extra={"pattern": r"^(default|.*\.j2)$"}),
]


class PictureControls(Section):
    """Controls of a track's section that find out what answers owe to the picture."""

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


def check(
    model: type[ModelT], data: object, source: YamlSource, base: FieldPath = ()
) -> tuple[ModelT | None, list[Problem]]:
    """Validate `data`, which stands at `base` in the source; return the instance, or all problems.

    A value that looks like a key is a problem too, and is not shown, so that none reaches a run
    folder.
    """
    secrets = list(_secrets(data, source, base))
    try:
        instance = model.model_validate(data)
        details: list[ErrorDetails] = []
    except ValidationError as error:
        instance, details = None, error.errors(include_url=False)
    hidden = {problem.field for problem in secrets}
    faults = []
    for detail in details:
        path, found = _locate(detail, data)
        least = detail.get("ctx", {}).get("min_length", 0)
        is_echo = detail["type"] == "too_short" and isinstance(found, list) and len(found) >= least
        # A list is called too short for items that are faulty and have errors of their own.
        if not is_echo and dotted((*base, *path)) not in hidden:
            faults.append((detail, path, found))
    problems = [
        _problem(model, detail, path, found, source, base) for detail, path, found in faults[:_MOST]
    ]
    if len(faults) > _MOST:
        message = f"and {len(faults) - _MOST:,} more problems"
        problems.append(Problem(problems[-1].where, message))
    return (None if secrets else instance), [*secrets, *problems]


def joined(source: YamlSource, problems: list[Problem]) -> list[Problem]:
    """Return problems of the YAML and others in order, but others of what YAML could not read."""
    places = {problem.where for problem in source.problems if not problem.where.startswith("--")}
    rest = [problem for problem in problems if problem.where not in places]
    return source.in_order([*source.problems, *rest])


def _secrets(data: object, source: YamlSource, path: FieldPath) -> Iterator[Problem]:
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _secrets(value, source, (*path, key))
            is_named = isinstance(value, str) and path and key.lower() in _SECRET_KEYS
            if is_named and not looks_secret(value):
                yield _secret(source, (*path, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from _secrets(value, source, (*path, index))
    elif isinstance(data, str) and looks_secret(data):
        yield _secret(source, path)


def _secret(source: YamlSource, path: FieldPath) -> Problem:
    message = "looks like a key, which must not stand in a file"
    return Problem(source.where(path), message, dotted(path), hint=_KEY_HINT)


def _locate(detail: ErrorDetails, data: object) -> tuple[FieldPath, Any]:
    """Return the path of an error in the data, without pydantic's names of union members."""
    path: list[str | int] = []
    here: Any = data
    for part in detail["loc"]:
        absent = detail["type"] == "missing" and part == detail["loc"][-1]
        if isinstance(here, Mapping) and (part in here or absent):
            here = here.get(part)
        elif isinstance(here, list) and isinstance(part, int):
            here = here[part]
        else:
            continue
        path.append(part)
    for part in detail.get("ctx", {}).get("at", ()):
        if isinstance(here, Mapping):
            here = here.get(part)
        else:
            here = here[part] if isinstance(here, list) else None
        path.append(part)
    return tuple(path), here


def _problem(
    root: type[BaseModel],
    detail: ErrorDetails,
    path: FieldPath,
    found: Any,
    source: YamlSource,
    base: FieldPath,
) -> Problem:
    """Word one error of pydantic's."""
    kind, context = detail["type"], detail.get("ctx", {})
    whole = (*base, *path)
    name = next((str(part) for part in reversed(path) if isinstance(part, str)), "")
    message, allowed, hint = detail["msg"].lower(), "", ""
    if kind == "missing":
        where = source.where(whole[:-1], key=True)
        return Problem(where, "is missing", dotted(whole), hint=f"add {name}: ...")
    if kind == "extra_forbidden":
        return _unknown_key(root, path, source, whole)
    if kind == "refused":
        message, allowed = context["message"], context.get("allowed", "")
        hint = context.get("hint") or did_you_mean(str(found), context.get("words", ()))
        written = next((at for at in context.get("reads", ()) if at in source.values), whole)
        where = source.where(written, key=bool(context.get("key")))
        seen = "" if context.get("hides") or found is None else show(found)
        return Problem(where, message, dotted(whole), seen, allowed, hint)
    if kind == "literal_error":
        choices = re.findall(r"[^\s',]+", context["expected"].replace(" or ", " "))
        message, allowed = "is not one of the choices", ", ".join(choices)
        hint = did_you_mean(found, choices) if isinstance(found, str) else ""
        if path == ("models",):
            message, allowed = "is one name where a list belongs", "a list of models, or recorded"
            hint = hint or f"write a list: [{found}]"
        if isinstance(found, list) and len(found) == 1:
            hint = f"take the brackets off: {found[0]}"
    elif kind in _WANTED:
        message, allowed = "has the wrong type", _WANTED[kind]
        hint = _type_hint(kind, name, found, root, path)
    elif kind in _BOUNDS:
        bound, word = _BOUNDS[kind]
        message, allowed = "is out of range", f"{word} {context[bound]}"
    elif kind in ("too_short", "string_too_short"):
        least = context.get("min_length", 1)
        message = "is empty" if least == 1 else "is too short"
        allowed = "at least one" if least == 1 else f"{least} items"
    elif kind == "too_long":
        message, allowed = "has too many items", f"{context['max_length']} items at most"
    elif kind == "string_pattern_mismatch":
        message, allowed = "has characters that are not allowed", _PATTERNS.get(name, "")
    return Problem(source.where(whole), message, dotted(whole), show(found), allowed, hint)


def _type_hint(kind: str, name: str, value: object, root: type[BaseModel], path: FieldPath) -> str:
    """Return how a value of the wrong type was probably meant."""
    if not isinstance(value, str | int | float):
        return ""
    text = str(value)
    if kind in ("int_type", "float_type") and re.fullmatch(r"[-+\d.eE]+", text):
        return "take the quotes off" if isinstance(value, str) else ""
    if kind == "string_type":
        return f'put it in quotes: "{text}"'
    if kind == "model_type" and "path" in _section(root, path).model_fields:
        return f"write {name}: {{path: {text}}}"
    if kind != "tuple_type":
        return ""
    if span := re.fullmatch(r"(\d{1,3})\s*(?:-|\.\.|:|to)\s*(\d{1,3})", text):
        several = list(range(int(span[1]), int(span[2]) + 1))
        return f"write a list: {several}" if several else ""
    if name == "seeds" and isinstance(value, int) and 0 < value <= 20:
        return f"write a list: {list(range(value))}"
    return f"write a list: [{text}]"


def _unknown_key(
    root: type[BaseModel], path: FieldPath, source: YamlSource, whole: FieldPath
) -> Problem:
    name = str(path[-1])
    known = _fields(_section(root, path[:-1]))
    hint = did_you_mean(name, known)
    homes = [home for home, section in _sections(root).items() if name in _fields(section)]
    if name.lower() in _SECRET_KEYS and "api_key_env" in known:
        hint = _KEY_HINT
    elif homes:
        hint = f"it belongs at {'.'.join((*homes[0], name))}"
    where = source.where(whole, key=True)
    return Problem(where, "is not a known key", dotted(whole), "", ", ".join(known), hint)


def _sections(
    root: type[BaseModel], above: tuple[str, ...] = ()
) -> dict[tuple[str, ...], type[BaseModel]]:
    """Return the models that describe a document, by the path of the fields that hold them."""
    sections = {above: root}
    for name, field in root.model_fields.items():
        parts: list[Any] = [field.annotation]
        for part in parts:
            parts.extend(get_args(part))
            if isinstance(part, type) and issubclass(part, BaseModel):
                sections |= _sections(part, (*above, field.alias or name))
                break
    return sections


def _section(root: type[BaseModel], path: FieldPath) -> type[BaseModel]:
    """Return the model that describes what stands at `path`, or the nearest around it."""
    sections = _sections(root)
    names = tuple(part for part in path if isinstance(part, str))
    return next(sections[names[:n]] for n in range(len(names), -1, -1) if names[:n] in sections)


def _fields(section: type[BaseModel]) -> list[str]:
    return [field.alias or key for key, field in section.model_fields.items() if not field.exclude]
