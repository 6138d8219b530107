"""Validation against a pydantic model, with every error in plain words and at its place."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from phyblock.config.yaml import SECRET_KEYS, FieldPath, YamlSource, dotted, looks_secret, show
from phyblock.errors import Problem
from phyblock.text import did_you_mean

ModelT = TypeVar("ModelT", bound=BaseModel)

KEY_HINT = "name an environment variable with api_key_env, and keep the key in it"

MOST_HINTS = 100
"""Problems of a file for which similar words are searched, which takes time."""

_WANTED = {
    "int_type": "a whole number",
    "float_type": "a number",
    "string_type": "text",
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
    "models": "letters, digits and . _ : + -, starting with a letter or digit",
    "api_key_env": "the name of an environment variable: letters, digits, underscores",
}


@dataclass(frozen=True)
class _Fault:
    """One pydantic error with what is needed to word it."""

    detail: ErrorDetails
    path: FieldPath
    found: Any
    root: type[BaseModel]
    base: FieldPath

    @property
    def context(self) -> dict[str, Any]:
        return dict(self.detail.get("ctx", {}))

    @property
    def key(self) -> str:
        """The last named part of the path."""
        return next((str(part) for part in reversed(self.path) if isinstance(part, str)), "")


def check(
    model: type[ModelT],
    data: object,
    source: YamlSource,
    base: FieldPath = (),
    hints: int = MOST_HINTS,
) -> tuple[ModelT | None, list[Problem]]:
    """Validate `data`, which stands at `base` in the source.

    Returns the instance, or None and all problems found, of which the first `hints` are said in
    full. Errors that a model raised for rules across its fields (context `rules`) are left to the
    caller, who can judge them one by one.
    """
    try:
        return model.model_validate(data), []
    except ValidationError as error:
        details = error.errors(include_url=False)
    faults = [_locate(detail, data, model, base) for detail in details]
    own = [fault for fault in faults if not _is_echo(fault)]
    return None, [
        *(_word(fault, source) for fault in own[:hints]),
        *(_word_briefly(fault, source) for fault in own[hints:]),
    ]


def find_secrets(data: object, source: YamlSource, base: FieldPath = ()) -> Iterator[Problem]:
    """A problem for each value that looks like a key, so that none reaches a run folder."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from find_secrets(value, source, (*base, key))
            nested = isinstance(value, str) and base and str(key).lower() in SECRET_KEYS
            if nested and not looks_secret(value):
                yield _secret(source, (*base, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from find_secrets(value, source, (*base, index))
    elif isinstance(data, str) and looks_secret(data):
        yield _secret(source, base)


def merge_problems(
    syntax: list[Problem], secrets: list[Problem], problems: list[Problem]
) -> list[Problem]:
    """All problems, but those of a value that YAML could not read or that is a secret."""
    fields = {problem.field for problem in secrets}
    places = {problem.where for problem in syntax if not problem.where.startswith("--")}
    rest = (p for p in problems if p.field not in fields and p.where not in places)
    return [*syntax, *secrets, *rest]


def _secret(source: YamlSource, path: FieldPath) -> Problem:
    return Problem(
        source.where(path), "looks like a key, which must not stand in a file", dotted(path),
        hint=KEY_HINT,
    )  # fmt: skip


def _locate(detail: ErrorDetails, data: object, root: type[BaseModel], base: FieldPath) -> _Fault:
    """The path of an error in the data: pydantic's, without the names it adds for unions."""
    path: list[str | int] = []
    here: Any = data
    for part in (*detail["loc"], *detail.get("ctx", {}).get("at", ())):
        is_last = detail["type"] == "missing" and part == detail["loc"][-1]
        if isinstance(here, Mapping) and (part in here or is_last):
            here = here.get(part)
        elif isinstance(here, list) and isinstance(part, int):
            here = here[part]
        else:
            continue
        path.append(part)
    return _Fault(detail, (*base, *path), here, root, base)


def _is_echo(fault: _Fault) -> bool:
    """Whether the error says nothing new.

    Rules across fields are judged by the caller; a list is called too short for items that are
    faulty and have errors of their own.
    """
    least = fault.context.get("min_length", 0)
    long_enough = isinstance(fault.found, list) and len(fault.found) >= least
    return bool(fault.context.get("rules")) or (fault.detail["type"] == "too_short" and long_enough)


def _word(fault: _Fault, source: YamlSource) -> Problem:
    kind = fault.detail["type"]
    if kind == "extra_forbidden":
        return _unknown_key(fault, source)
    if kind == "missing":
        where = source.where(fault.path[:-1], key=True)
        return Problem(where, "is missing", dotted(fault.path), hint=f"add {fault.key}: ...")
    message, allowed, hint = _explain(fault)
    where = source.where(fault.path, key=bool(fault.context.get("key")))
    found = "" if fault.context.get("hides") else show(fault.found)
    return Problem(where, message, dotted(fault.path), found, allowed, hint)


def _word_briefly(fault: _Fault, source: YamlSource) -> Problem:
    return Problem(source.where(fault.path), fault.detail["msg"].lower(), dotted(fault.path))


def _explain(fault: _Fault) -> tuple[str, str, str]:
    """Message, what is allowed, and a hint."""
    kind, context = fault.detail["type"], fault.context
    if kind == "refused":
        hint = context.get("hint") or did_you_mean(str(fault.found), context.get("words", ()))
        return context["message"], context.get("allowed", ""), hint
    if kind == "literal_error":
        return _not_a_choice(fault)
    if kind in _WANTED:
        return "has the wrong type", _WANTED[kind], _type_hint(kind, fault)
    if kind in _BOUNDS:
        name, word = _BOUNDS[kind]
        return "is out of range", f"{word} {context[name]}", ""
    if kind == "too_short" or kind == "string_too_short":
        least = context.get("min_length", 1)
        return (
            ("is empty", "at least one", "")
            if least == 1
            else ("is too short", f"{least} items", "")
        )
    if kind == "too_long":
        return "has too many items", f"{context['max_length']} items at most", ""
    if kind == "string_pattern_mismatch":
        return "has characters that are not allowed", _PATTERNS.get(fault.key, ""), ""
    return fault.detail["msg"].lower(), "", ""


def _not_a_choice(fault: _Fault) -> tuple[str, str, str]:
    choices = re.findall(r"[^\s',]+", fault.context["expected"].replace(" or ", " "))
    allowed = ", ".join(choices)
    if fault.path == (*fault.base, "models"):
        hint = did_you_mean(str(fault.found), choices) or f"write a list: [{_brief(fault.found)}]"
        return "is one name where a list belongs", "a list of models, or the word recorded", hint
    hint = did_you_mean(str(fault.found), choices) if isinstance(fault.found, str) else ""
    if isinstance(fault.found, list) and len(fault.found) == 1:
        hint = f"take the brackets off: {_brief(fault.found[0])}"
    return "is not one of the choices", allowed, hint


def _type_hint(kind: str, fault: _Fault) -> str:
    value = fault.found
    if kind in ("int_type", "float_type") and isinstance(value, str):
        return "take the quotes off" if re.fullmatch(r"[-+\d.eE]+", value) else ""
    if kind == "tuple_type" and isinstance(value, str | int | float):
        return f"write a list: [{_brief(value)}]"
    if kind == "string_type" and isinstance(value, str | int | float):
        return f'put it in quotes: "{_brief(value)}"'
    return ""


def _brief(value: object) -> str:
    text = str(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _unknown_key(fault: _Fault, source: YamlSource) -> Problem:
    section = _section(fault.root, fault.path[len(fault.base) : -1])
    known = [field.alias or name for name, field in section.model_fields.items()]
    hint = did_you_mean(fault.key, known)
    if fault.key.lower() in SECRET_KEYS and "api_key_env" in known:
        hint = KEY_HINT
    elif elsewhere := [home for home in _homes(fault.root) if home[-1] == fault.key]:
        hint = f"it belongs at {'.'.join(elsewhere[0])}"
    where = source.where(fault.path, key=True)
    return Problem(where, "is not a known key", dotted(fault.path), "", ", ".join(known), hint)


def _section(root: type[BaseModel], path: FieldPath) -> type[BaseModel]:
    """The model that describes what stands at `path`."""
    section = root
    for part in path:
        inner = _inner(section, str(part))
        section = inner or section
    return section


def _homes(root: type[BaseModel], above: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The paths of all fields."""
    for name in root.model_fields:
        yield (*above, name)
        inner = _inner(root, name)
        if inner is not None:
            yield from _homes(inner, (*above, name))


def _inner(section: type[BaseModel], name: str) -> type[BaseModel] | None:
    """The model behind a field, if it holds one."""
    field = section.model_fields.get(name)
    stack: list[Any] = [] if field is None else [field.annotation]
    while stack:
        annotation = stack.pop()
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            return annotation
        stack.extend(get_args(annotation))
    return None


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
