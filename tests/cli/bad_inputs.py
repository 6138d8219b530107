"""Inputs that are wrong, each with what the one message about it must say."""

from __future__ import annotations

from dataclasses import dataclass

from tests.cli.breakage import (
    FAKE_KEY,
    FRESH,
    RUN,
    Prepare,
    broken_record,
    cache_file,
    changed_data,
    checkout,
    command,
    earlier_run,
    file_in_the_way,
    lost_data,
    manifest_without,
    many_files,
    models_text,
    no_manifest,
    noise,
    options,
    pictures_taken,
    pipe,
    png,
    recording,
    scenes_text,
    scores_over_run,
    second_scene,
    suite_line,
    suite_text,
    template,
    user_block,
    without_field,
)
from tests.fuzz.strategies import png_header
from tests.workspace import tower

EPS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 90 90\nshowpage\n"
LONG = "x" * 5_000


@dataclass(frozen=True)
class Bad:
    """A bad input.

    `prepare` breaks something and gives the command line; `says` are parts that each message, or
    the only one, must hold; `messages` how many problems there are; `writes` the files that may
    have appeared or grown; `bytes_left` the size that no file may pass.
    """

    name: str
    prepare: Prepare
    says: tuple[str, ...]
    messages: int = 1
    env: tuple[tuple[str, str], ...] = ()
    writes: tuple[str, ...] = ()
    bytes_left: int | None = None


SUITES: tuple[Bad, ...] = (
    Bad("key", suite_line("sede: [1]"), ("suite.yaml:4:1: sede", "did you mean seeds?", "allowed")),
    Bad("inner-key", suite_line("limits: {max_cost: 1}"), ("suite.yaml:4:10: limits.max_cost",)),
    Bad("type", suite_line("seeds: five"), ("suite.yaml:4:8: seeds", 'found: "five"', "list")),
    Bad("no-name", suite_text("models: [random]\n"), ("suite.yaml", "name: is missing")),
    Bad("no-models", suite_text("name: trial\n"), ("suite.yaml", "models: is missing")),
    Bad("nan", suite_line("sampling: {temperature: .nan}"), ("suite.yaml:4:", "temperature")),
    Bad("yaml", suite_line("seeds: [1, 2"), ("suite.yaml:",)),
    Bad(
        "key-twice", suite_text("name: a\nmodels: [random]\nname: b\n"), ("suite.yaml:3:1", "name")
    ),
    Bad("empty", suite_text(""), ("suite.yaml: is empty",)),
    Bad("tab", suite_text("name: trial\n\tmodels: [random]\n"), ("suite.yaml:2:1",)),
    Bad("level", suite_line("levels: [1, 5]"), ("suite.yaml:4:13: levels[1]", "1, 2, 3, 4")),
    Bad("model", suite_line("models: [alpah]"), ("suite.yaml:3:10: models[0]", "mean alpha?")),
    Bad("no-list", suite_line("models: random"), ("suite.yaml:3:9: models", "[random]")),
    Bad("no-folder", suite_line("dataset: {path: ./dta}"), ("suite.yaml:3:", "no such folder")),
    Bad("no-set", suite_line("dataset: {path: mini}"), ("suite.yaml:3:", "bundled", "phyblock-")),
    Bad("no-path", suite_line("dataset: {format: official}"), ("dataset.path", "--set")),
    Bad("no-samples", suite_line("dataset: {path: ./low}\nlevels: [4]"), ("no samples", "1, 2")),
    Bad("variable", suite_line("dataset: {path: $NOWHERE/x}"), ("dataset.path", "NOWHERE")),
    Bad("absent", command("run", "quik"), ("quik: ", "allowed: ", "did you mean quick?")),
    Bad("folder", command("run", "data"), ("data: is a folder",)),
)
OPTIONS: tuple[Bad, ...] = (
    Bad("set-key", options("--set", "limits.max=1"), ("--set limits.max=1: limits.max", "allowed")),
    Bad("set-value", options("--set", "seeds=x"), ("--set seeds=x: seeds", 'found: "x"')),
    Bad("set-form", options("--set", "seeds"), ("--set seeds", "key=value")),
    Bad("set-yaml", options("--set", "seeds=[1"), ("--set seeds=[1",)),
    Bad("models", options("--models", "oracel"), ("--models", "found: oracel", "mean oracle?")),
    Bad("no-file", options("--models-file", "gone.yaml"), ("gone.yaml", "no such models file")),
    Bad("limit", options("--limit", "0"), ("--limit", "0 is not in the range")),
    Bad("limit-word", options("--limit", "few"), ("--limit", "few")),
    Bad("verb", command("rum"), ("rum", "run")),
    Bad("check", command("models", "check", "alpah"), ("alpah", "did you mean alpha?")),
    Bad("parser", command("score", "out", "--parser", "mine"), ("--parser", "steps", "official")),
    Bad("validate", many_files, (), messages=3),
    Bad("validate-pipe", pipe("p.yaml", "validate", "p.yaml"), ("p.yaml: is not a regular file",)),
    Bad("validate-device", command("validate", "/dev/zero"), ("/dev/zero: is not a regular",)),
    # A file that is there and cannot be read, for root too.
    Bad("validate-locked", command("validate", "/proc/self/mem"), ("mem: cannot be read: ",)),
    Bad("validate-noise", noise("n.yaml", "validate", "n.yaml"), ("n.yaml: is larger than",)),
    Bad(
        "validate-data",
        pipe("data/scenes.jsonl", "validate", "data"),
        ("scenes.jsonl: is not a regular file",),
    ),
    Bad("validate-lines", noise("data/scenes.jsonl", "validate", "data"), ("is not UTF-8 text",)),
    Bad("validate-long", command("validate", LONG), (LONG[:80], "there is no such suite")),
    Bad("run-long", command("run", "suite.yaml", "--models-file", LONG), ("no such models file",)),
    Bad("report-long", command("report", LONG), (LONG[:80],)),
    Bad("show-long", command("scenes", "show", LONG, "t1"), (LONG[:80],)),
    Bad(
        "set-long",
        options("--set", "seeds=[0x" + "f" * 90_000 + "]"),
        ("seeds[0]: is too long a number",),
    ),
    Bad("set-deep", options("--set", "a." * 9_000 + "a=1"), ("key=value",)),
    Bad("init", command("init", "."), ("models.yaml", "is already there")),
)
DATA: tuple[Bad, ...] = (
    Bad("cycle", second_scene("blocks.0.depend", [2]), ("scenes.jsonl:2: ", "cycle", "1 -> 2")),
    Bad("dangling", second_scene("blocks.1.depend", [7]), ("scenes.jsonl:2: ", "found: 7")),
    Bad("nan-m", second_scene("blocks.1.position", [0, 0, float("nan")]), ("jsonl:2:", "position")),
    Bad("far", second_scene("blocks.1.position", [0, 0, -1e308]),
        ("jsonl:2: blocks[1].position", "is out of range", "-100 to 100 m")),
    Bad("kind", second_scene("blocks.0.type", "cub"), ("jsonl:2: blocks[0].type", "cube, cuboid1")),
    Bad("layer", second_scene("blocks.1.layer", 1), ("jsonl:2: blocks[1].layer", "found: 1")),
    Bad("lost", second_scene("candidates", [tower("t", [1], ("red",))["candidates"][0]]),
        ("jsonl:2: candidates", "block 2")),
    Bad("json", scenes_text(lambda lines: [*lines[:3], "{", *lines[4:]]), ("scenes.jsonl:4:",)),
    Bad("twice", scenes_text(lambda lines: [*lines, lines[0]]), ("scenes.jsonl:6: id", "line 1")),
    Bad("none", scenes_text(lambda _: []), ("scenes.jsonl", "holds no scenes")),
    Bad("no-png", checkout(None), ("official", "images.source", "found: 000", "render")),
    Bad("bad-png", checkout(b"no picture"), ("000.png", "is no picture")),
    Bad("eps", checkout(EPS), ("000.png", "is no picture", "PNG, JPEG, GIF or WebP")),
    Bad("dot-png", checkout(png((1, 1))), ("000.png", "found: 1 x 1 pixels", "10,000 pixels")),
    Bad("huge-png", checkout(png_header(30_000, 30_000)), ("000.png", "900,000,000 pixels")),
    Bad("cut-png", checkout(png()[:-40]), ("000.png", "is not a readable picture")),
)  # fmt: skip
MODELS: tuple[Bad, ...] = (
    Bad("jinja", template("{% block user %}{{ "), ("mine.j2:1", "is not valid Jinja")),
    Bad("undefined", template(user_block("{{ solution }}")),
        ("mine.j2:2: ", "block user", "solution", "n_candidates"), writes=("fresh",)),
    Bad("jinja-type", template(user_block("{{ n_candidates + 'x' }}")),
        ("mine.j2:2: ", "unsupported operand"), writes=("fresh",)),
    Bad("jinja-loader", template(user_block("{% include 'x' %}")),
        ("mine.j2:2: ", "loader"), writes=("fresh",)),
    Bad("jinja-sandbox", template(user_block("{{ pictures.__class__.__mro__ }}")),
        ("mine.j2:2: ", "unsafe"), writes=("fresh",)),
    Bad("jinja-bomb", template(user_block("{{ 'x' * 10**9 }}")),
        ("mine.j2:2: ", "more than 500,000 steps"), writes=("fresh",)),
    Bad("jinja-lipsum", template(user_block("{{ lipsum(9) }}")),
        ("mine.j2:2: ", "'lipsum' is undefined"), writes=("fresh",)),
    Bad("jinja-pipe", pipe("mine.j2", *FRESH, "--set", "prompt=mine.j2"), ("no such file",)),
    Bad("hex", models_text("a:\n  id: openai/x\n  extra_body: {k: 0x" + "f" * 90_000 + "}\n"),
        ("models.yaml:3:19: a.extra_body.k: is too long a number", "90,002 digits")),
    Bad("no-user", template("Build it."), ("mine.j2", "has no user block")),
    Bad("no-template", template(None), ("suite.yaml", "prompt", "no such file")),
    Bad("secret", models_text(f"mine:\n  id: openai/x\n  api_key: {FAKE_KEY}\n"),
        ("models.yaml:3:", "mine.api_key", "api_key_env")),
    Bad("model-twice", models_text("a: openai/x\nb: openai/x\na: openai/y\n"),
        ("models.yaml:3:1", "a")),
    Bad("no-provider", models_text("mine: gpt-4o\n"), ("models.yaml:1:7", "openai/gpt-4o?")),
    Bad("builtin", models_text("oracle: openai/x\n"), ("models.yaml:1:1: oracle",)),
    Bad("no-key", models_text("alpha: openai/gpt-4o\n"),
        ("alpha", "OPENAI_API_KEY", "--models")),
    Bad("no-price", command(*FRESH, "--models", "alpha", "--set", "limits.max_cost_usd=1"),
        ("model alpha: price", "max_cost_usd", "models.yaml"), writes=("fresh",)),
    Bad("no-recording", recording(None), ("model old", "recordings not found", "replies"),
        writes=("fresh",)),
    Bad("strange-reply", recording('{"speech": 1}'), ("t1.json", "speech"), writes=("fresh",)),
    Bad("no-json", recording('{"text": '), ("t1.json:1:10", "is not JSON"), writes=("fresh",)),
)  # fmt: skip
FOLDERS: tuple[Bad, ...] = (
    Bad("below-file", file_in_the_way("run", "suite.yaml", "--out", "taken/x"),
        ("taken/x", "cannot be written: Not a directory", "--out")),
    Bad("is-file", file_in_the_way("run", "suite.yaml", "--out", "taken"),
        ("taken", "cannot be written", "--out")),
    Bad("proc", command("run", "suite.yaml", "--out", "/proc/here"), ("/proc/here", "--out")),
    Bad("other-run", command(*RUN, "--set", "seeds=[7]"),
        ("out: holds another run", "found: different: suite.seeds\n")),
    Bad("dry-other-run", command(*RUN, "--set", "seeds=[7]", "--dry-run"),
        ("out: holds another run", "found: different: suite.seeds\n")),
    Bad("manifest", earlier_run("run.yaml", "identity: [1"),
        ("out/run.yaml:1:13: is not YAML", "from a copy")),
    Bad("no-manifest", earlier_run("run.yaml", "other: 1\n"), ("out/run.yaml", "identity")),
    Bad("record", broken_record(lambda line: line[:40]), ("out/records.jsonl:2:41: ", "hint: ")),
    Bad("record-field", broken_record(without_field("outcome")),
        ("out/records.jsonl:2: outcome",)),
    Bad("record-reply", broken_record(without_field("reply")), ("out/records.jsonl:2", "reply")),
    Bad("record-report", broken_record(without_field("scores"), "report", "out"),
        ("out/records.jsonl:2", "scores")),
    Bad("record-usage", broken_record(lambda line: line.replace('"usage"', '"used"')),
        ("out/records.jsonl:2", "reply.usage")),
    Bad("record-counts", broken_record(lambda line: line.replace('"tp":', '"tq":', 1)),
        ("out/records.jsonl:2", "scores[0].tp")),
    Bad("record-score", broken_record(without_field("n_blocks"), "score", "out"),
        ("out/records.jsonl:2", "n_blocks")),
    Bad("manifest-report", manifest_without("suite", "report", "out"), ("out/run.yaml", "suite")),
    Bad("manifest-score", manifest_without("suite", "score", "out"), ("out/run.yaml", "suite")),
    Bad("manifest-data", manifest_without("dataset", "score", "out"), ("out/run.yaml", "dataset")),
    Bad("no-run", command("report", "data"), ("data: holds no run.yaml",)),
    Bad("nothing", command("report", "nowhere"), ("nowhere", "phyblock run")),
    Bad("score-file", command("score", "suite.yaml"), ("suite.yaml", "phyblock run")),
    Bad("orphans", no_manifest, ("out: holds another run", "records, and no run.yaml")),
    Bad("changed-data", changed_data, ("data: sha256: is not the data set", "found", "allowed")),
    Bad("lost-data", lost_data, ("data: ", "is not there", "--data")),
    Bad("score-over-run", scores_over_run, ("precious: holds another run", "--out")),
    Bad("score-over-self", command("score", "out", "--out", "out"), ("out: holds another run",)),
    Bad("full-disk", command(*FRESH, "--no-cache", "--models", "random,oracle"),
        ("fresh/records.jsonl", "cannot be written: File too large", "it goes on from here"),
        writes=("fresh",), bytes_left=6000),
    Bad("full-at-once", command("run", "suite.yaml", "--out", "fresh"),
        ("fresh", "cannot be written"), writes=("fresh",), bytes_left=100),
    Bad("full-tables", command("report", "out"), ("out", "cannot be written"),
        writes=("out/tables",), bytes_left=100),
    Bad("full-scores", command("score", "out"), ("out/scores", "cannot be written"),
        writes=("out/scores",), bytes_left=100),
    Bad("full-init", command("init", "new"), ("new", "cannot be written"),
        writes=("new",), bytes_left=100),
)  # fmt: skip
CACHES: tuple[Bad, ...] = (
    Bad("broken-cache", cache_file(b"not a database, by far" * 40), ("replies.sqlite", "hint: "),
        writes=("fresh",)),
    Bad("foreign-cache", cache_file(None), ("replies.sqlite", "another version", "hint: "),
        writes=("fresh",)),
    Bad("broken-stats", cache_file(b"not a database" * 40, "cache", "stats"), ("replies.sqlite",)),
    Bad("full-cache", command(*FRESH, "--models", "alpha", "--set", "seeds=[1]"),
        ("replies.sqlite", "cannot be used: disk I/O error", "free some space"),
        writes=("fresh", "cache/replies.sqlite-"), bytes_left=6000),
    Bad("no-pictures", pictures_taken, ("c2/pictures", "cannot be written", "PHYBLOCK_CACHE"),
        env=(("PHYBLOCK_CACHE", "c2"),), writes=("fresh", "c2/replies.sqlite")),
    Bad("cache-below", file_in_the_way("run", "suite.yaml", "--out", "fresh", "--models", "alpha"),
        ("taken/x", "PHYBLOCK_CACHE"), env=(("PHYBLOCK_CACHE", "taken/x"),), writes=("fresh",)),
)  # fmt: skip
BAD: tuple[Bad, ...] = SUITES + OPTIONS + DATA + MODELS + FOLDERS + CACHES
