"""The laws hold for whatever a person gives: files, arguments, folders, earlier runs."""

import json
import os
import shutil
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from tests.data.broken import YAML_TEXTS, checkout_files, sound_scene
from tests.fuzz import strategies as bad
from tests.fuzz.laws import watched
from tests.fuzz.strategies import JSON_TOKENS, NASTY_TOKENS, NOISE, broken, fuzzed
from tests.workspace import SCENES, questions, vqa_suite, write_questions

pytestmark = pytest.mark.fuzz

RUN = ("run", "suite.yaml", "--out", "fresh", "--no-report")
DRY = ("run", "suite.yaml", "--dry-run")
STEPS = ("--set", "tracks=[step_planning]", "--set", "steps.physics=off")
IN_OUT = ("report/ch1/thesis.tex", "figures/mine.svg", "tables/mine.csv", "notes.md")
LASTING = ("thesis/ch1.tex", "suite.yaml", "models.yaml", "data/scenes.jsonl")


@pytest.fixture(scope="module")
def sound(new_workspace):
    """A folder with a sound suite, models, scenes, questions, and files of the user's own."""
    made = new_workspace(*SCENES[:2])
    write_questions(made.root / "questions", questions(SCENES[:2], 1, ("SH", "OR")))
    suite = made.write_suite(name="asked", models=["random"], **vqa_suite())
    suite.rename(made.root / "questions.yaml")
    made.write_suite(models=["random"])
    made.write_yaml("models.yaml", {"old": {"replay": "replies"}, "far": "openai/gpt-4o"})
    write(made.root, "thesis/ch1.tex")
    return made


@pytest.fixture(scope="module")
def ended(sound, tmp_path_factory):
    """The same with a finished run of each track: `out`, `steps` and `asked`."""
    made = sound.copied(tmp_path_factory.mktemp("ended") / "w")
    for words in (
        ("suite.yaml", "--out", "out", "--models", "random,oracle"),
        ("suite.yaml", "--out", "steps", "--models", "oracle", *STEPS),
        ("questions.yaml", "--out", "asked"),
    ):
        made.does("run", *words, "--no-report")
    write(made.root / "out", *IN_OUT)
    return made


def write(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("precious", encoding="utf-8")


@dataclass(frozen=True)
class Case:
    """A command line and what stands in the folder where it is given: bytes in a file, a text that
    a link points to, or None for a pipe that nobody writes to; see `watched` for the rest.
    """

    args: tuple[str, ...]
    files: Mapping[str, bytes | str | None] = field(default_factory=dict)
    may_write: tuple[str, ...] = ()
    lasting: tuple[str, ...] = ()

    def tried_in(self, here):
        (here.root / "tmp").mkdir()
        here.env["TMPDIR"] = str(here.root / "tmp")
        for name, content in self.files.items():
            path = here.root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
            if content is None:
                os.mkfifo(path)
            elif isinstance(content, str):
                path.symlink_to(content)
            else:
                path.write_bytes(content)
        return watched(self.args, here, (*self.may_write, "tmp"), self.lasting)


_TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
_NO_FILES = st.sampled_from(
    [
        *(None, "/dev/zero", "/dev/stdin", "/proc/self/environ", ".", "gone", "/etc/hosts"),
        b"",
        b"\xff\xfe\x00",
        b"a: &a [x,x,x,x,x,x,x,x,x]\nb: &b [*a,*a,*a,*a,*a,*a,*a]\nc: [*b,*b,*b,*b,*b,*b,*b]\n",
        b"[" * 100_000,
        b"a: " * 50_000,
        b"- " * 200_000,
        b"x" * 3_000_000,
        b'"' + b"x" * 2_000_000 + b'"',
        b"name: 0x" + b"f" * 100_000,
        b"seeds: [" + b"1, " * 200_000 + b"1]",
    ]
)
"""Contents and links that may stand where a file is expected."""


def _file(name, contents, *commands, may_write=("fresh",), lasting=()):
    """A command, and a file of this name that is drawn; once in ten it is no such file at all."""
    mostly = st.integers(0, 9).flatmap(lambda n: contents if n else _NO_FILES)
    return st.builds(
        lambda content, args: Case(args, {name: content}, may_write, lasting),
        mostly,
        st.sampled_from(commands),
    )


def _sets(texts):
    return [arg for text in texts for arg in ("--set", text)]


def _place_case(place, is_there, content):
    """A run that is told to go somewhere, where something of the user's may be already."""
    here = place.removeprefix("~/")
    can_be_there = is_there and place[:1] not in ("", "/", "~") and len(place) < 80
    can_be_there = can_be_there and not place.startswith("suite.yaml")
    files = {f"{place}/report/ch1/thesis.tex": content} if can_be_there else {}
    return Case(
        ("run", "suite.yaml", "--out", place, "--no-report", "--models", "oracle"),
        files,
        (place,) if place.startswith("/") else (here.partition("/")[0] or "nowhere",),
        (*LASTING, *files),
    )


_PLACES = st.sampled_from(
    [
        *(".", "thesis", "fresh", "a/b/c", "~/x", "$HOME/x", "-x", "=1+1", ":b:", "a\nb"),
        *("[red]x", "x" * 300, "d/" * 3000, "\udcff", "data", "suite.yaml", "suite.yaml/x"),
        *("/proc/x", "/dev/null", "cache", "..x", "a b", "\u202e", "%s", "{x}"),
    ]
)
_VERBS = (
    *("run", "score", "report", "figures", "compare", "export", "show", "play"),
    *("bundle", "verify", "site"),
    *("models", "validate", "scenes", "questions", "init", "--help", "-V", "nope", ""),
)
_WORDS = (
    *("suite.yaml", "data", "questions", "thesis", "gone", "stats", "audit", "show", "verify"),
    *("--dry-run", "--set", "--limit", "--models", "--models-file", "--only", "--format", "--to"),
    *("-1", "0", "9" * 400, "x=1", "seeds=[0]", "random", "t1", "csv", "html", "\udcff", "a\nb"),
    *("/dev/null", "/dev/stdin", "--yes", "--", "x" * 5000, "../..", "http://[::1/v1", "%s", "{}"),
    *("fresh", "check", "list", "--json", "--jobs", "--help"),
)
_ARGUMENTS = st.builds(
    lambda verb, words: (verb, *words),
    st.sampled_from(_VERBS),
    st.lists(st.sampled_from(_WORDS) | _TEXTS, max_size=4),
    # Commands whose honest work takes long: generating data sets, drawing all scenes.
).filter(lambda args: args[0] != "init" and not {"generate", "render"} & set(args))


def _reply(content):
    choice = {"finish_reason": "stop", "message": {"role": "assistant", "content": content}}
    usage = {"prompt_tokens": 10, "completion_tokens": 3, "total_tokens": 13}
    return {"id": "x", "model": "m", "choices": [choice], "usage": usage}


_STEPS = st.sampled_from(
    [
        *("Step1: Move block with index 1", "Step 2:", "Move(3)", "index", "1", "-1"),
        *("9" * 400, "\n", "Answer: A", "=1+1", "<script>", "\ud800", "\u202e", "```json"),
        *("[1, 2]", "{", "<think>", "\0", "٣", "①", "Step" * 2000, "1, " * 3000),
        *("Next plan: Done", ":b:", "[red]", "\x1b[31m"),
    ]
)


_REPLY_FILES = broken(st.just(_reply("1, 2")), JSON_TOKENS) | st.lists(
    _STEPS | _TEXTS, max_size=8
).map(lambda pieces: json.dumps(_reply(" ".join(pieces))).encode())


def _official(picture, candidates):
    """A checkout in the official layout with one picture and maybe broken candidates."""
    whole = checkout_files({**sound_scene(), "id": "000"})
    files = {f"official/{name}": text.encode() for name, text in whole.items()}
    files["official/data/SCENEs_400_Goal_and_Cand_Imgs_resized/000.png"] = picture
    if candidates:
        files["official/data/SCENEs_400_Cand_Jsons/000_16_cand_blocks.json"] = candidates
    sets = ("dataset.format=official", "dataset.path=official", "images.source=dataset")
    return Case((*RUN, *_sets(sets)), files, ("fresh",))


def _replies(*texts):
    files = {f"replies/t{n}.json": text for n, text in enumerate(texts, 1)}
    return Case((*RUN, "--models", "old"), files, ("fresh",))


_PROMPTED = ("--set", "prompt=mine.j2")
_AUDIT = ("scenes", "audit", "data", "--jobs", "1")
_ASK = ("run", "questions.yaml", "--dry-run")

_ELSEWHERE = _TEXTS.filter(lambda text: ".." not in text and text[:1] not in ("/", "~"))

KINDS = {
    "suites": _file("x.yaml", bad.SUITES, ("validate", "x.yaml"), ("run", "x.yaml", "--dry-run")),
    "models": _file("models.yaml", bad.MODELS_FILES, ("validate", "models.yaml"), ("models",), DRY),
    "overrides": st.lists(bad.OVERRIDES, min_size=1, max_size=3).map(
        lambda texts: Case((*DRY, *_sets(texts)))
    ),
    # A run whose --out was not drawn writes to results.
    "arguments": _ARGUMENTS.map(lambda args: Case(args, may_write=("fresh", "results"))),
    "scenes": _file("data/scenes.jsonl", bad.SCENES, ("validate", "data"), _AUDIT, DRY, RUN),
    "questions": _file("questions/questions.jsonl", bad.QUESTIONS, ("validate", "questions"), _ASK),
    "prompts": _file("mine.j2", bad.TEMPLATES, (*RUN, *_PROMPTED), (*DRY, *_PROMPTED)),
    "pictures": st.builds(_official, bad.PICTURES, st.none() | bad.CANDIDATES),
    "replies": st.builds(_replies, _REPLY_FILES, _REPLY_FILES),
    "places": st.builds(_place_case, _PLACES | _ELSEWHERE, st.booleans(), NOISE),
}
"""Cases beside a sound suite, by what is bad about them."""
_PERCENT = dict(zip([*KINDS, "run folders"], (14, 12, 8, 10, 12, 8, 8, 6, 6, 6, 10), strict=True))
"""Their shares of all inputs."""

_OF_RUN = {
    "out": (
        ("report", "out", "--print"),
        ("score", "out"),
        ("export", "out", "--to", "csv", "--out", "fresh"),
        ("compare", "out"),
        ("report", "out"),
        ("run", "suite.yaml", "--out", "out", "--no-report", "--models", "random,oracle"),
    ),
    "steps": (
        ("report", "steps", "--print"),
        ("show", "steps", "step_planning/oracle/t1/s0"),
        ("run", "suite.yaml", "--out", "steps", "--no-report", "--models", "oracle", *STEPS),
    ),
    "asked": (
        ("report", "asked", "--print"),
        ("score", "asked"),
        ("run", "questions.yaml", "--out", "asked", "--no-report"),
    ),
}
_GROWING = ("records.jsonl", "calls.jsonl", "prompts.jsonl")


def run_cases(root):
    """Cases about the finished runs in `root`: a line of a file that grows, or the manifest."""
    found = []
    for run, commands in _OF_RUN.items():
        own = tuple(f"{run}/{name}" for name in IN_OUT) if run == "out" else ()
        for name in (*_GROWING, "run.yaml"):
            path = root / run / name
            if not path.exists():
                continue
            contents = _manifests(path) if name == "run.yaml" else _with_bad_line(path)
            ours = {"may_write": (run, "fresh"), "lasting": (*LASTING, *own)}
            found.append(_file(f"{run}/{name}", contents, *commands, **ours))
    return st.one_of(found)


def _manifests(path):
    whole = path.read_bytes()
    # A field that is not known may hold anything; one that is written already is there twice.
    added = st.builds(
        lambda field, text: whole + f"{field}: {text}\n".encode(),
        st.sampled_from(["mine", "created", "limit", "scenes", "scenes_by_level"]),
        st.sampled_from([*YAML_TEXTS.values()]),
    )
    return broken(st.just(yaml.safe_load(whole)), NASTY_TOKENS) | added


def _with_bad_line(path):
    lines = path.read_bytes().splitlines(keepends=True)
    documents = [json.loads(line) for line in lines]

    def joined(place, bad, ending):
        return b"".join([*lines[:place], bad + ending, *lines[place + 1 :]])

    bad = broken(st.sampled_from(documents), JSON_TOKENS) | NOISE
    endings = st.sampled_from([b"\n", b"\n", b"\n", b"", b"\r\n", b"\n\n"])
    return st.builds(joined, st.integers(0, len(lines) - 1), bad, endings)


@pytest.mark.parametrize("kind", [*KINDS, "run folders"])
def test_bad_input(kind, request, tmp_path, tallies):
    if kind in KINDS:
        template, cases = request.getfixturevalue("sound"), KINDS[kind]
    else:
        template = request.getfixturevalue("ended")
        cases = run_cases(template.root)
    tally, found = tallies.setdefault(kind, Counter()), {}

    @fuzzed(_PERCENT[kind])
    @given(case=cases)
    def run(case):
        here = template.copied(tmp_path / "here")
        try:
            ended, laws = case.tried_in(here)
        finally:
            shutil.rmtree(here.root)
        tally["hangs" if ended.code is None else f"code {ended.code}"] += 1
        for law in laws:
            # Of cases that broke the same, the smallest is kept.
            known = found.setdefault(law.name, (law, case))
            found[law.name] = min(known, (law, case), key=lambda one: len(repr(one[1])))

    run()
    told = []
    for law, case in found.values():
        parts = (f"{key}={value!r}"[:1500] for key, value in vars(case).items())
        told += ["", law.name, law.detail, *parts]
    if told:
        pytest.fail("\n".join(told), pytrace=False)
