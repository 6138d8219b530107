"""Bad files, and what is said of them: the tables `bad_suites.yaml` and `bad_models.yaml`."""

import contextlib
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from phyblock.config.models import load_models
from phyblock.config.suite import load_suite
from phyblock.errors import SpecError


def table(name: str) -> list[dict[str, Any]]:
    """The entries of a table."""
    return yaml.safe_load(Path(__file__).with_name(name).read_text(encoding="utf-8"))


def told(folder: Path, kind: str, text: str, sets: Sequence[str] = ()) -> str:
    """All that is said of a bad file, which lies in the working directory, without the folder."""
    (folder / "brief.j2").write_text("{% block user %}go{% endblock %}", encoding="utf-8")
    path = folder / f"{kind}.yaml"
    path.write_text(text, encoding="utf-8")
    with contextlib.chdir(folder), pytest.raises(SpecError) as caught:
        load_models(path) if kind == "models" else load_suite(path, sets)
    return str(caught.value).replace(f"{folder}/", "") + "\n"


def rewrite(name: str, kind: str) -> None:
    """Write what is said today into a table: `python -m tests.config.tables`."""
    path = Path(__file__).with_name(name)
    lines = [path.read_text(encoding="utf-8").splitlines()[0]]
    for entry in table(name):
        with tempfile.TemporaryDirectory() as folder:
            says = told(Path(folder), kind, entry[kind], entry.get("set", ()))
        block = {kind: entry[kind], "says": says}
        for field, text in block.items():
            lines.append(f"{'- ' if field == kind else '  '}{field}: |")
            lines += [f"    {line}" for line in text.splitlines()]
            if field == kind and "set" in entry:
                lines.append(f"  set: {json.dumps(entry['set'])}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    rewrite("bad_suites.yaml", "suite")
    rewrite("bad_models.yaml", "models")
