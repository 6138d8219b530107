"""Bad suites: each error stands at its file:line:col, in plain words, with a way out."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from phyblock.config.suite import load_suite
from phyblock.errors import Problem, SpecError

HEAD = "name: s\nmodels: [oracle]\n"


@pytest.fixture
def data_dir(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    (folder / "phyblock-400").mkdir(parents=True)
    return folder


def problems_of(text: str, folder: Path, *overrides: str) -> list[Problem]:
    """The problems of a suite; places come without the folder."""
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        load_suite(path, overrides, data_dir=folder / "data")
    return list(caught.value.problems)


# text, line:col, field, part of the message, part of allowed, part of the hint
BAD = [
    (HEAD + "levls: [1]\n", "3:1", "levls", "not a known key", "levels", "did you mean levels?"),
    (HEAD + "images:\n  layuot: separate\n", "4:3", "images.layuot", "known key", "size_px",
     "did you mean layout?"),
    (HEAD + "temperature: 0\n", "3:1", "temperature", "not a known key", "",
     "belongs at sampling.temperature"),
    (HEAD + "max_cost_usd: 5\n", "3:1", "max_cost_usd", "", "", "belongs at limits.max_cost_usd"),
    (HEAD + "zzz: 5\n", "3:1", "zzz", "not a known key", "name, description", ""),
    ("models: [oracle]\n", "1:1", "name", "is missing", "", "add name"),
    ("name: s\n", "1:1", "models", "is missing", "", "add models"),
    ("name: Quick Run\nmodels: [oracle]\n", "1:7", "name", "characters", "small letters", ""),
    ("name: 5\nmodels: [oracle]\n", "1:7", "name", "wrong type", "text", 'in quotes: "5"'),
    ("name: ''\nmodels: [oracle]\n", "1:7", "name", "characters", "1 to 64", ""),
    ("name: s\nmodels: oracle\n", "2:9", "models", "a list belongs", "", "write a list: [oracle]"),
    ("name: s\nmodels: recordd\n", "2:9", "models", "a list belongs", "recorded",
     "did you mean recorded?"),
    ("name: s\nmodels: []\n", "2:9", "models", "is empty", "at least one", ""),
    ("name: s\nmodels:\n", "2:8", "models", "wrong type", "a list", ""),
    ("name: s\nmodels: [oracle, 4]\n", "2:18", "models[1]", "wrong type", "text", '"4"'),
    ("name: s\nmodels: [a b]\n", "2:10", "models[0]", "characters", "starting with", ""),
    ("name: s\nmodels:\n  - oracle\n  - random\n  - oracle\n", "5:5", "models[2]", "twice", "",
     "keep one"),
    (HEAD + "tracks: [full_planing]\n", "3:10", "tracks[0]", "choices", "full_planning",
     "did you mean full_planning?"),
    (HEAD + "levels: [1, 5]\n", "3:13", "levels[1]", "choices", "1, 2, 3, 4", ""),
    (HEAD + "levels: [true]\n", "3:10", "levels[0]", "whole number", "1, 2, 3, 4", ""),
    (HEAD + "levels: ['1']\n", "3:10", "levels[0]", "whole number", "1, 2, 3, 4", ""),
    (HEAD + "levels: []\n", "3:9", "levels", "is empty", "at least one", ""),
    (HEAD + "levels: 3\n", "3:9", "levels", "wrong type", "a list", "write a list: [3]"),
    (HEAD + "settings: [a]\n", "3:12", "settings[0]", "choices", "A, B", "did you mean A?"),
    (HEAD + "settings: A\n", "3:11", "settings", "wrong type", "a list", "write a list: [A]"),
    (HEAD + "settings: [on]\n", "3:12", "settings[0]", "choices", "A, B", ""),
    (HEAD + "seeds: [-1]\n", "3:9", "seeds[0]", "out of range", "at least 0", ""),
    (HEAD + "seeds: [1.5]\n", "3:9", "seeds[0]", "wrong type", "whole number", ""),
    (HEAD + "seeds: ['0']\n", "3:9", "seeds[0]", "wrong type", "whole number", "quotes off"),
    (HEAD + "seeds: [0, 1, 0]\n", "3:15", "seeds[2]", "twice", "", ""),
    (HEAD + "seeds: [4294967296]\n", "3:9", "seeds[0]", "out of range", "at most", ""),
    (HEAD + "prompt: oficial\n", "3:9", "prompt", "template", ".j2", "did you mean official?"),
    (HEAD + "prompt: none.j2\n", "3:9", "prompt", "no such file", "", ""),
    (HEAD + "parser: [steps]\n", "3:9", "parser", "choices", "steps, official", "brackets off"),
    (HEAD + "parser: on\n", "3:9", "parser", "choices", "steps, official", ""),
    (HEAD + "images: {size_px: 64}\n", "3:19", "images.size_px", "range", "at least 128", ""),
    (HEAD + "images: {size_px: 4096}\n", "3:19", "images.size_px", "range", "at most 2048", ""),
    (HEAD + "images: {size_px: 512.5}\n", "3:19", "images.size_px", "type", "whole number", ""),
    (HEAD + "images: {order: [goal]}\n", "3:17", "images.order", "short", "2 items", ""),
    (HEAD + "images: {order: [goal, goal]}\n", "3:24", "images.order[1]", "twice", "", ""),
    (HEAD + "images: 512\n", "3:9", "images", "wrong type", "a mapping", ""),
    (HEAD + "images: {background: chekerboard}\n", "3:22", "images.background", "choices",
     "checkerboard, white", "did you mean checkerboard?"),
    (HEAD + "scoring:\n  level1: memberhsip\n", "4:11", "scoring.level1", "choices", "aov",
     "did you mean membership?"),
    (HEAD + "scoring:\n  matchers: [optimal, pper]\n", "4:23", "scoring.matchers[1]", "choices",
     "optimal, paper", "did you mean paper?"),
    (HEAD + "scoring: {missing: ignore}\n", "3:20", "scoring.missing", "choices", "count", ""),
    (HEAD + "sampling: {temperature: 3}\n", "3:25", "sampling.temperature", "range", "most 2", ""),
    (HEAD + "sampling: {temperature: .nan}\n", "3:25", "sampling.temperature", "", "", ""),
    (HEAD + "sampling: {temperature: 'hot'}\n", "3:25", "sampling.temperature", "wrong type",
     "a number", ""),
    (HEAD + "sampling: {top_p: 0}\n", "3:19", "sampling.top_p", "range", "above 0", ""),
    (HEAD + "sampling: {max_tokens: 0}\n", "3:24", "sampling.max_tokens", "range", "least 1", ""),
    (HEAD + "sampling: {temperature: yes}\n", "3:25", "sampling.temperature", "wrong type", "", ""),
    (HEAD + "limits: {max_concurrency: 0}\n", "3:27", "limits.max_concurrency", "range", "1", ""),
    (HEAD + "limits: {timeout_s: .inf}\n", "3:21", "limits.timeout_s", "type", "finite", ""),
    (HEAD + "limits: {max_cost_usd: -1}\n", "3:24", "limits.max_cost_usd", "range", "least 0", ""),
    (HEAD + "tables: [tabel1]\n", "3:10", "tables[0]", "choices", "published", "table1"),
    (HEAD + "description: [a]\n", "3:14", "description", "wrong type", "text", ""),
    (HEAD + "description: sk-abcdefgh12345678\n", "3:14", "description", "looks like a key", "",
     "api_key_env"),
    (HEAD + "dataset: {format: oficial}\n", "3:19", "dataset.format", "choices",
     "builtin, official", "did you mean official?"),
    (HEAD + "dataset: {format: official}\n", "3:19", "dataset.path", "checkout", "",
     "--set dataset.path=FOLDER"),
    (HEAD + "dataset: {format: official, path: null}\n", "3:35", "dataset.path", "checkout", "",
     "--set dataset.path=FOLDER"),
    (HEAD + "dataset: {path: ''}\n", "3:17", "dataset.path", "is empty", "", ""),
    (HEAD + "dataset: {path: phyblock-40}\n", "3:17", "dataset.path", "bundled data set",
     "phyblock-400", "did you mean phyblock-400?"),
    (HEAD + "dataset: {path: ./none}\n", "3:17", "dataset.path", "no such folder", "", ""),
    (HEAD + "dataset: {path: $PHYBLOCK_UNSET/x}\n", "3:17", "dataset.path",
     "variable PHYBLOCK_UNSET is not set", "", ""),
    ("name: s\nmodels: recorded\n", "2:9", "models", "official data set only", "",
     "dataset.format to official"),
    (HEAD + "prompt: official\n", "3:9", "prompt", "checkout", "", "prompt: default"),
    (HEAD + "candidates: {order: random}\n", "3:21", "candidates.order", "choices",
     "file, shuffled", ""),
    (HEAD + "full_planning: {blind: true, wrong_image: true}\n", "3:43",
     "full_planning.wrong_image", "where blind shows none", "", "set one of them"),
    ("name: s\ndataset: {format: official, path: data}\nmodels: recorded\n"
     "candidates: {order: shuffled}\n", "4:21", "candidates.order",
     "recorded replies name candidates by the numbers of the file", "", "list the models"),
    ("name: s\ndataset: {format: official, path: data}\nmodels: [oracle]\n"
     "images: {source: dataset}\ncandidates: {order: shuffled}\n", "5:21", "candidates.order",
     "show the candidates in the order of the file", "", "images.source: render"),
    (HEAD + "answer_format: json-schema\n", "3:16", "answer_format", "choices", "text, json_schema",
     "json_schema?"),
    (HEAD + "answer_format: json_schema\nparser: official\n", "4:9", "parser", "reads no JSON", "",
     "parser: steps"),
    ("name: s\ndataset: {format: official, path: data}\nmodels: recorded\n"
     "answer_format: json_schema\n", "4:16", "answer_format", "were asked for in text", "",
     "list the models"),
    (HEAD + "dataset: {format: official, path: data}\nprompt: official\n"
     "answer_format: json_schema\n", "5:16", "answer_format", "asks for lines of text", "",
     "prompt: default"),
    (HEAD + "images: {source: dataset}\n", "3:18", "images.source", "official", "", "render"),
    (HEAD + "dataset: {format: official, path: .}\nscoring: {matchers: [optimal], level1: aov}\n"
     "levels: [2]\ntables: [published]\n", "4:21", "scoring.matchers", "paper matcher", "", "add"),
    (HEAD + "dataset: {format: official, path: .}\ntables: [published]\n", "4:9",
     "scoring.level1", "membership", "", "scoring.level1: membership"),
    (HEAD + "dataset: {format: official, path: .}\nlevels: [2]\nsettings: [B]\n"
     "tables: [published]\n", "5:11", "settings", "setting A", "", "add A"),
    (HEAD + "levels: [1]\nlevels: [2]\n", "4:1", "levels", "written twice", "", "s.yaml:3:1"),
    ("[1, 2]\n", "1:1", "", "wrong type", "a mapping", ""),
    (HEAD + "images: {order: [goal\n", "4:1", "", "not YAML", "", ""),
    (HEAD + "\tlevels: [1]\n", "3:1", "", "not YAML", "", ""),
    (HEAD + "parser: !steps x\n", "3:9", "parser", "tag", "", ""),
]  # fmt: skip


@pytest.mark.parametrize(("text", "place", "field", "message", "allowed", "hint"), BAD)
def test_a_bad_suite_gives_one_error_at_its_place(
    data_dir: Path, text: str, place: str, field: str, message: str, allowed: str, hint: str
) -> None:
    (problem, *more) = problems_of(text, data_dir.parent)
    assert more == []
    assert problem.where == f"{data_dir.parent / 's.yaml'}:{place}"
    assert problem.field == field
    assert message in problem.message
    assert allowed in problem.allowed
    assert hint in problem.hint


@pytest.mark.parametrize("text", [row[0] for row in BAD])
def test_no_word_of_the_validator_reaches_the_user(data_dir: Path, text: str) -> None:
    shown = "\n".join(map(str, problems_of(text, data_dir.parent)))
    jargon = (
        r"pydantic|Input should|valid (dictionary|tuple|string)|_type\b|extra_forbidden|SuiteSp"
    )
    assert not re.search(jargon, shown)


def test_all_errors_come_at_once_in_the_order_of_the_file(data_dir: Path) -> None:
    text = (
        "name: A B\nlevls: [1]\nmodels: recorded\nlevels: [9]\nimages: {source: dataset}\n"
        "levels: [1]\nseeds: '0'\nsettings: [C]\n"
    )
    found = problems_of(text, data_dir.parent, "limits.max_atempts=1", "nonsense")
    places = [problem.where.removeprefix(str(data_dir.parent / "s.yaml")) for problem in found]
    assert places == [
        ":1:7",
        ":2:1",
        ":3:9",
        ":4:10",
        ":5:18",
        ":6:1",
        ":7:8",
        ":8:12",
        "--set nonsense",
        "--set limits.max_atempts=1",
    ]


def test_a_rule_stays_silent_when_a_field_it_reads_is_wrong(data_dir: Path) -> None:
    text = "name: s\nmodels: recorded\ndataset: {format: oficial}\n"
    assert [problem.field for problem in problems_of(text, data_dir.parent)] == ["dataset.format"]


def test_an_empty_file(data_dir: Path) -> None:
    (problem,) = problems_of("# nothing\n", data_dir.parent)
    assert problem.message == "is empty"


def test_a_secret_is_not_repeated(data_dir: Path) -> None:
    text = HEAD + "prompt: sk-abcdefgh12345678\n"
    found = problems_of(text, data_dir.parent)
    assert len(found) == 1
    assert "abcdefgh" not in str(found[0])
