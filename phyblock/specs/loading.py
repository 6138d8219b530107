"""Reads a suite file and --set overrides as a validated suite with its paths resolved."""

from __future__ import annotations

import filecmp
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from phyblock.errors import Problem, SpecError
from phyblock.registry import baseline_names, known_track
from phyblock.specs.groups import GROUP, group_names, unknown_model, with_members
from phyblock.specs.model import ModelSpec
from phyblock.specs.overrides import apply_overrides
from phyblock.specs.paths import expand, sort_problems
from phyblock.specs.prompt import PROMPT_WORDS
from phyblock.specs.rules import broken_rules, read_dotted
from phyblock.specs.suite import (
    BUILTIN_DATASET,
    RECORDED,
    SuiteSpec,
    suite_model,
)
from phyblock.specs.validation import MOST_HINTS, check, find_secrets, merge_problems
from phyblock.specs.vary_check import vary_problems
from phyblock.specs.words import did_you_mean, show
from phyblock.specs.yaml_source import FieldPath, YamlSource, dotted, read_yaml
from phyblock.variants import Variant

__all__ = ["LoadedSuite", "load_suite", "resolve_models", "suite_tracks"]

_BARE_NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9_-]*$")


@dataclass(frozen=True)
class LoadedSuite:
    """A suite and the file it was read from.

    `dataset_path` is the absolute folder of the data set; by track, `folders` are those of data of
    its own, and `templates` the absolute paths of prompts that are files. Where prompts
    vary, `suite` and `templates` are those of the reference, and `prompts` has the paths of all by
    their texts. `unused` are templates of one's own that stand in for the bundled one of the other
    form of answers.
    """

    suite: SuiteSpec
    path: Path
    dataset_path: Path
    source: YamlSource = field(repr=False, compare=False)
    folders: Mapping[str, Path] = field(default_factory=dict)
    templates: Mapping[str, Path] = field(default_factory=dict)
    prompts: Mapping[str, Path] = field(default_factory=dict)
    unused: Mapping[str, Path] = field(default_factory=dict)

    def at(self, variant: Variant) -> LoadedSuite:
        """The suite as a variant asks."""
        suite = self.suite.at(variant)
        texts = {name: _prompt(suite, name) for name in suite.tracks}
        known = {name: self.prompts[text] for name, text in texts.items() if text in self.prompts}
        templates = known if "prompt" in suite.vary.factors else self.templates
        return replace(self, suite=suite, templates=templates)

    def where(self, *path: str | int) -> str:
        """Place ("file:line:col" or "--set ...") of a field, for errors found later."""
        return self.source.where(path)


def load_suite(
    path: Path,
    overrides: Sequence[str] = (),
    *,
    data_dir: Path,
    prompt_dirs: Sequence[Path] = (),
) -> LoadedSuite:
    """Read, override and validate a suite.

    `overrides` are "key=value" texts; `data_dir` is the folder of the bundled data sets, where
    bare names are looked up. A file in one of `prompt_dirs` that is called as a bundled prompt is
    used in its place where the suite says `default`. Raises SpecError with all that is wrong, in
    the order of the file.
    """
    source = read_yaml(path)
    apply_overrides(source, overrides)
    if source.data is None:
        raise SpecError([*source.problems, Problem(str(path), "is empty", allowed="a suite")])
    suite, problems = check(suite_model(), source.data, source)
    secrets = list(find_secrets(source.data, source))
    if suite is None and isinstance(source.data, dict):
        problems += _broken_rules(source, problems)
    all_problems = merge_problems(source.problems, secrets, problems)
    if suite is not None:
        all_problems += vary_problems(suite, source)
    if suite is None or all_problems:
        raise SpecError(sort_problems(all_problems))
    # What varies has the values of the reference, wherever one value alone is asked for.
    return _locate(suite.at(Variant()), path, source, data_dir, prompt_dirs)


def suite_tracks(path: Path) -> tuple[str, ...]:
    """The tracks of a suite that is known to be sound, whatever else it still needs to run."""
    default = suite_model().model_fields["tracks"].get_default(call_default_factory=True)
    return tuple(read_yaml(path).data.get("tracks", default))


def resolve_models(
    loaded: LoadedSuite, known: Mapping[str, ModelSpec]
) -> dict[str, ModelSpec | None]:
    """The suite's models in its order, those of a group in its place; None stands for a built-in
    baseline.

    Raises SpecError for each unknown name, at its place in the suite, and ValueError when the
    suite asks for recorded replies (those are listed by the data set).
    """
    names = loaded.suite.models
    if names == RECORDED:
        raise ValueError("the models of a suite of recorded replies are listed by its data set")
    allowed = [*baseline_names(), *known, *(GROUP + name for name in group_names(known))]
    unknown = [(index, name) for index, name in enumerate(names) if name not in allowed]
    problems = [
        Problem(
            loaded.where("models", index),
            unknown_model(name),
            f"models[{index}]",
            show(name),
            ", ".join(allowed) if len(allowed) <= 12 else "",
            (did_you_mean(name, allowed) if number < MOST_HINTS else "")
            or "list them: phyblock models",
        )
        for number, (index, name) in enumerate(unknown)
    ]
    if problems:
        raise SpecError(problems)
    return {name: known.get(name) for name in with_members(names, known)}


def _broken_rules(source: YamlSource, problems: list[Problem]) -> list[Problem]:
    """Problems between fields, judged on the raw data where the fields themselves are sound."""
    faulty = {re.sub(r"\[.*", "", problem.field) for problem in problems}
    get = _raw_reader(source.data)
    return [
        Problem(_rule_place(source, rule.reads), rule.message, rule.field, hint=rule.hint)
        for rule in broken_rules(get, tuple(sorted(faulty)))
    ]


def _raw_reader(data: Mapping[str, Any]) -> Callable[[str], Any]:
    def get(name: str) -> Any:
        here: Any = data
        for key in name.split("."):
            if not isinstance(here, Mapping) or key not in here:
                return _default(name)
            here = here[key]
        return here

    return get


def _default(name: str) -> Any:
    value: Any = suite_model()
    for key in name.split("."):
        value = (
            value.model_fields[key].get_default(call_default_factory=True)
            if isinstance(value, type) and issubclass(value, BaseModel)
            else getattr(value, key)
        )
    return value


def _rule_place(source: YamlSource, reads: tuple[str, ...]) -> str:
    paths: list[FieldPath] = [tuple(name.split(".")) for name in reads]
    written = next((path for path in paths if path in source.values), paths[0])
    return source.where(written)


def _locate(
    suite: SuiteSpec,
    path: Path,
    source: YamlSource,
    data_dir: Path,
    prompt_dirs: Sequence[Path],
) -> LoadedSuite:
    finder = _Finder(path, source, data_dir)
    scenes = suite.dataset
    is_bundled = scenes.format == "builtin"
    dataset = finder.data(scenes.path or BUILTIN_DATASET, ("dataset", "path"), is_bundled)
    folders: dict[str, Path | None] = {}
    templates: dict[str, Path | None] = {}
    unused: dict[str, Path | None] = {}
    for name in suite.tracks:
        kind = known_track(name)
        if (own := kind.data_folder(suite)) is not None:
            folders[name] = finder.data(*own)
        prompt = _prompt(suite, name)
        if "prompt" not in suite.vary.factors and prompt not in PROMPT_WORDS:
            templates[name] = finder.file(prompt, kind.prompt_field)
        elif prompt == PROMPT_WORDS[0] or "default" in suite.vary.prompt:
            in_text = suite.answer_format == "text"
            forms = (kind.template, kind.json_template)
            bundled, other = forms if in_text else reversed(forms)
            templates[name] = _in_place_of(bundled, prompt_dirs)
            unused[name] = _in_place_of(other, prompt_dirs)
    prompts = {
        text: finder.file(text, ("vary", "prompt", place))
        for place, text in enumerate(suite.vary.prompt)
        if text not in PROMPT_WORDS
    }
    if "default" in suite.vary.prompt:
        prompts |= {"default": next(iter(templates.values()), None)}
    finder.check_twice(prompts, ("vary", "prompt"))
    if dataset is None or finder.problems:
        raise SpecError(sort_problems(finder.problems))
    located = map(_there, (folders, templates, prompts, unused))
    return LoadedSuite(suite, path, dataset, source, *located).at(Variant())


def _prompt(suite: SuiteSpec, track: str) -> str:
    """What a suite names as the prompt of a track."""
    return str(read_dotted(suite, ".".join(known_track(track).prompt_field)))


def _in_place_of(bundled: Path | None, folders: Sequence[Path]) -> Path | None:
    """The first file of the same name in the folders, unless it is the same as the bundled one."""
    if bundled is None:
        return None
    paths = (folder.absolute() / bundled.name for folder in folders)
    own = next((path for path in paths if os.path.isfile(path)), None)
    is_same = own is not None and filecmp.cmp(own, bundled, shallow=False)
    return None if is_same else own


def _there(paths: Mapping[str, Path | None]) -> dict[str, Path]:
    return {name: path for name, path in paths.items() if path is not None}


class _Finder:
    """Resolves the paths of one suite and gathers what is wrong with them."""

    def __init__(self, path: Path, source: YamlSource, data_dir: Path) -> None:
        self.problems: list[Problem] = []
        self._path = path
        self._source = source
        self._data_dir = data_dir

    def data(self, text: str, at: FieldPath, may_be_bundled: bool) -> Path | None:
        """The folder of data: a bundled set by its name, or a path."""
        if may_be_bundled and _BARE_NAME.match(text):
            folder = self._data_dir.absolute() / text
            if not os.path.isdir(folder):
                names = sorted(p.name for p in self._data_dir.glob("*/"))
                allowed = f"a bundled data set ({', '.join(names)}), or the path of a folder"
                hint = did_you_mean(text, names) or f"for a folder beside the suite write ./{text}"
                self._complain(at, "is not a bundled data set", show(text), allowed, hint)
            return folder
        path = self._expand(text, at)
        if path is not None and not os.path.isdir(path):
            self._complain(at, "no such folder", str(path))
        return path

    def file(self, text: str, at: FieldPath) -> Path | None:
        """A file that must be there."""
        path = self._expand(text, at)
        if path is not None and not os.path.isfile(path):
            self._complain(at, "no such file", str(path))
        return path

    def check_twice(self, files: Mapping[str, Path | None], at: FieldPath) -> None:
        """Complain of names that mean a file that another means already."""
        first: dict[str, str] = {}
        for text, path in files.items():
            if path is not None and os.path.isfile(path):
                known = first.setdefault(os.path.realpath(path), text)
                if known != text:
                    message = f"is the same file as {known}: this level would change nothing"
                    hint = "name the other one in another way, or move it out of prompts/"
                    self._complain(at, message, show(text), hint=hint)

    def _expand(self, text: str, at: FieldPath) -> Path | None:
        base = Path.cwd() if self._source.is_overridden(at) else self._path.parent
        try:
            return expand(text, base)
        except ValueError as error:
            self._complain(at, str(error), show(text))
            return None

    def _complain(
        self, at: FieldPath, message: str, found: str, allowed: str = "", hint: str = ""
    ) -> None:
        where = self._source.where(at)
        self.problems.append(Problem(where, message, dotted(at), found, allowed, hint))
