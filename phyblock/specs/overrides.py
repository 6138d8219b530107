"""`--set key=value`: changes to a suite from the command line, before it is validated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from phyblock.errors import Problem, SpecError
from phyblock.specs.paths import is_utf8
from phyblock.specs.words import looks_secret, show
from phyblock.specs.yaml_source import FieldPath, YamlSource, dotted, parse_yaml

__all__ = ["apply_overrides"]

_MOST, _DEEPEST, _LONGEST_SHOWN = 200, 16, 200
_FORM = "--set KEY=VALUE, for example --set levels=[1,2] or --set dataset.path=FOLDER"


def apply_overrides(source: YamlSource, overrides: Iterable[str]) -> None:
    """Put each "key=value" into the source's data, as if the file said so.

    Keys are dotted; values are YAML. A later override of the same key wins. What is wrong with
    an override's own form is added to `source.problems`; whether key and value make sense is
    judged with the rest of the file, and reported against the --set text.
    """
    texts = tuple(overrides)
    if len(texts) > _MOST:
        problem = Problem("--set", "is given too often", "", f"{len(texts):,}", f"{_MOST} at most")
        raise SpecError(problem)
    for text in texts:
        try:
            _apply(source, text)
        except SpecError as error:
            source.problems.extend(error.problems)


def _apply(source: YamlSource, text: str) -> None:
    shown = text if len(text) <= _LONGEST_SHOWN else text[:_LONGEST_SHOWN] + "..."
    place = "--set ..." if looks_secret(text) else f"--set {shown}"
    if not is_utf8(text):
        raise SpecError(Problem(place, "is not UTF-8"))
    key, equals, raw = text.partition("=")
    parts = tuple(part.strip() for part in key.split("."))
    if not equals or not all(parts) or len(parts) > _DEEPEST:
        raise SpecError(Problem(place, "is not of the form key=value", hint=_FORM))
    value = parse_yaml(raw, place, place=place)
    if value.problems:
        raise SpecError(_below(parts, problem) for problem in value.problems)
    section = _section(source, parts[:-1], place)
    section[parts[-1]] = value.data
    for table in (source.keys, source.values):
        for path in [path for path in table if path[: len(parts)] == parts]:
            del table[path]
    source.keys[parts] = source.values[parts] = place
    source.overridden.add(parts)


def _below(parts: FieldPath, problem: Problem) -> Problem:
    """A problem of an override's value, said of the field of the suite that it is in."""
    inner = problem.field
    joint = "." if inner and not inner.startswith("[") else ""
    return replace(problem, field=f"{dotted(parts)}{joint}{inner}")


def _section(source: YamlSource, parts: FieldPath, place: str) -> dict[Any, Any]:
    """The mapping that holds the key, made where it is not there."""
    if source.data is None:
        source.data = {}
    here = source.data
    for end, part in enumerate(parts, 1):
        if not isinstance(here, dict):
            break
        if here.get(part) is None:
            here[part] = {}
            source.keys[parts[:end]] = place
        here = here[part]
    if not isinstance(here, dict):
        at = dotted(parts) or "the suite"
        raise SpecError(
            Problem(place, f"cannot be set: {at} is not a mapping", found=show(here),
                    hint="set the whole value")
        )  # fmt: skip
    return here
