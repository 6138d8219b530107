"""models.yaml: the models that suites may name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from phyblock.errors import Problem, SpecError
from phyblock.registry import baseline_names
from phyblock.specs.fields import ModelName
from phyblock.specs.groups import GROUP
from phyblock.specs.model import ModelSpec
from phyblock.specs.paths import expand, sort_problems
from phyblock.specs.suite import RECORDED
from phyblock.specs.validation import MOST_HINTS, check, find_secrets, merge_problems
from phyblock.specs.words import show
from phyblock.specs.yaml_source import YamlSource, read_yaml

__all__ = ["load_models"]

_NAME = TypeAdapter(ModelName)


def load_models(path: Path) -> dict[str, ModelSpec]:
    """Read a models file: each name maps to a litellm id or to a mapping.

    Paths of replay folders, of lists of servers and of programs that list them come out absolute.
    Raises SpecError with all that is wrong.
    """
    source = read_yaml(path)
    data = {} if source.data is None else source.data
    if not isinstance(data, dict):
        wrong = Problem(source.where(()), "has the wrong type", "", show(data),
                        "a mapping: name: provider/model")  # fmt: skip
        raise SpecError([*source.problems, wrong])
    models: dict[str, ModelSpec] = {}
    problems: list[Problem] = []
    for name, entry in data.items():
        hints = max(0, MOST_HINTS - len(problems))
        spec, of_entry = _read_entry(name, entry, source, hints)
        problems += of_entry
        if spec is not None:
            models[name] = spec
    secrets = list(find_secrets(data, source))
    merged = merge_problems(source.problems, secrets, problems)
    if merged:
        raise SpecError(sort_problems(merged))
    return models


def _read_entry(
    name: str, entry: Any, source: YamlSource, hints: int
) -> tuple[ModelSpec | None, list[Problem]]:
    problems = _check_name(name, source)
    if not isinstance(entry, str | dict):
        wrong = Problem(source.where((name,)), "has the wrong type", name, show(entry),
                        "a litellm id (provider/model), or a mapping")  # fmt: skip
        return None, [*problems, wrong]
    spec, of_entry = check(ModelSpec, {"id": entry} if isinstance(entry, str) else entry, source,
                        (name,), hints)  # fmt: skip
    problems += of_entry
    if spec is None:
        return None, problems
    for index, price in enumerate(spec.prices):
        line = source.where((name, "price", index)).split(":")[-2]
        price.stands_at(f"{Path(source.label).name} line {line}")
    for field, path in _paths(spec).items():
        try:
            absolute = str(expand(path, Path(source.label).parent))
        except ValueError as error:
            where = source.where((name, field))
            return None, [*problems, Problem(where, str(error), f"{name}.{field}", path)]
        words = spec.api_base_command if field == "api_base_command" else None
        value = absolute if words is None else (absolute, *words[1:])
        spec = spec.model_copy(update={field: value})
    return spec, problems


def _paths(spec: ModelSpec) -> dict[str, str]:
    """The paths in an entry by field; a program's name alone is looked for as a shell does."""
    program = (spec.api_base_command or ("",))[0]
    paths = {
        "replay": spec.replay,
        "api_base_file": spec.api_base_file,
        "api_base_command": program if "/" in program else None,
    }
    return {field: path for field, path in paths.items() if path is not None}


def _check_name(name: str, source: YamlSource) -> list[Problem]:
    where = source.where((name,), key=True)
    if name in (*baseline_names(), RECORDED):
        taken = ", ".join((*baseline_names(), RECORDED))
        return [Problem(where, "is a name of phyblock's own", name, allowed=f"not {taken}",
                        hint="choose another name")]  # fmt: skip
    if name.startswith(GROUP):
        message, hint = f"begins with {GROUP}, which names groups", "choose another name"
        return [Problem(where, message, name, show(name), hint=hint)]
    try:
        _NAME.validate_python(name)
    except ValidationError:
        allowed = "up to 80 letters, digits and . _ : + -, starting with a letter or digit"
        return [Problem(where, "is not a usable name", name, show(name), allowed)]
    return []
