"""Help texts: at once, complete, without importing what the verbs need."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import click

from phyblock.cli.main import phyblock as group
from phyblock.sim.engine import ENGINES

VERBS = tuple(group.list_commands(None))  # type: ignore[arg-type]
CALLS = re.compile(rf"\bphyblock ((?:{'|'.join(VERBS)})\b[^\n`;|&>\"#]*)")
LIBRARIES = tuple(ENGINES)
HEAVY = ("litellm", *LIBRARIES, "pandas", "aiohttp", "matplotlib", "phyblock.making")
SCRIPT = """
import sys
from phyblock.cli.main import main
for words in sys.argv[1:]:
    sys.argv = ["phyblock", *words.split()]
    try:
        main()
    except SystemExit as ending:
        assert not ending.code
sys.stderr.write(" ".join({n.split(".")[0] for n in sys.modules}))
"""


def ask(*commands: str) -> tuple[str, set[str]]:
    """Return what commands print, and the packages that they imported."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *commands], capture_output=True, text=True, check=True
    )
    return done.stdout, set(done.stderr.split())


def test_help_names_every_verb_and_imports_nothing_heavy() -> None:
    told, imported = ask("--help")
    for verb in VERBS:
        assert f"\n  {verb} " in told
    assert "phyblock run quick" in told
    assert not imported & {*HEAVY, "numpy", "pydantic", "rich", "yaml"}


def test_help_of_verbs_and_version_import_nothing_heavy() -> None:
    verbs = ("run", "report", "score", "validate", "models", "cache", "init")
    told, imported = ask("--version", *(f"{verb} --help" for verb in verbs))
    assert told.startswith("phyblock, version ")
    for verb in verbs:
        assert f"Usage: phyblock {verb} " in told
    assert not imported & set(HEAVY)


def test_every_option_that_messages_and_docs_name_is_there() -> None:
    root = Path(__file__).parents[2]
    written = [*root.glob("phyblock*/**/*.py"), root / "README.md", *root.glob("docs/**/*.md")]
    named: set[tuple[str, ...]] = set()
    for path in written:
        for call in CALLS.findall(path.read_text(encoding="utf-8")):
            before, *options = re.split(r"(?<!\S)(?=--)", call)
            words = before.split()
            named |= {(*words[:2], re.split(r"[^a-z0-9-]", option)[0]) for option in options}
    assert {verb for verb, *_ in named} >= {"run", "scenes", "compare"}
    assert [each for each in sorted(named) if not is_option(*each)] == []


def is_option(verb: str, *words: str) -> bool:
    """True if a verb, or its own verb that the next word names, has the option that ends it."""
    context = click.Context(group)
    command = group.get_command(context, verb)
    assert command is not None
    inner = command.get_command(context, words[0]) if isinstance(command, click.Group) else None
    known = {name for one in (command, inner) if one for param in one.params for name in param.opts}
    return words[-1] in known | {"--help"}
