"""Golden runs: numbers and requests that must not move.

    python -m tests.golden [NAME ...]    write these in tests/golden.json again, or all

Numbers are compared by digests of the rows of each model and measure in `estimates.csv`, and of
each model in the headline tables; models, measures and columns that a run adds are no difference.
Requests are compared by a digest of all bodies that a local server received.
"""

import hashlib
import json
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

from tests.conftest import official_root
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace, csv_rows

GOLDEN = Path(__file__).with_name("golden.json")

KEY_COLUMNS = (
    *("track", "measure", "model", "setting", "matcher", "criterion", "cell"),
    *("n", "value", "lo", "hi"),
)
HEADLINES = ("table1.csv", "table2.csv", "table3.csv", "table_c.csv")

RUNS: dict[str, tuple[str, ...]] = {
    "quick": ("quick",),
    "steps": ("steps", "--models", "random", "--limit", "60"),
    "pose": ("pose", "--limit", "16"),
    "quick-60": ("quick", "--limit", "60"),
    "pose-low": ("pose", "--limit", "6", "--set", "levels=[1,2,3]"),
    "vqa": ("vqa", "--models", "random,majority"),
    "paper-table1": ("paper-table1", "--set", "dataset.path={official}"),
}

_JSON = {"answer_format": "json_schema"}
_SHOWN: dict[str, Any] = {"source": "render", "size_px": 128}
SUITES: dict[str, dict[str, Any]] = {
    "plans": {},
    "plans-separate": {"images": {**_SHOWN, "layout": "separate", "order": ["candidates", "goal"]}},
    "plans-json": _JSON,
    "plans-blind": {"full_planning": {"blind": True}},
    "plans-shuffled": {"candidates": {"order": "shuffled"}, "seeds": [0, 1]},
    "plans-varied": {
        "vary": {"view": ["oblique", "front"], "layout": ["composite", "separate"], "repeats": 2}
    },
    "steps": {"tracks": ["step_planning"]},
    "steps-json": {"tracks": ["step_planning"], **_JSON},
    "poses": {"tracks": ["pose_planning"]},
    "questions": {"tracks": ["vqa"]},
    "questions-json": {"tracks": ["vqa"], **_JSON, "vqa": {"circular": True}},
}
_LIMITS = {"questions": 16, "questions-json": 16}


def rows_digests(path: Path) -> dict[str, str]:
    """Return a digest of the rows of each model, of estimates each model and measure, in a table,
    in any order.
    """
    by_model: defaultdict[str, list[str]] = defaultdict(list)
    for row in csv_rows(path):
        key, told = row.get("model") or "", [*row.values()]
        if path.name == "estimates.csv":
            key, told = f"{key} {row['measure']}", [row[column] for column in KEY_COLUMNS]
        by_model[key].append(json.dumps(told))
    return {model: _digest(sorted(lines)) for model, lines in by_model.items()}


def run_numbers(name: str, root: Path, pictures: Path) -> dict[str, dict[str, str]]:
    """Run a suite of `RUNS` below `root`; digests of its tables by file and model."""
    arguments = [text.format(official=f"{official_root()}/PhyBlock") for text in RUNS[name]]
    made = Workspace(root / name, pictures)
    made.does("run", *arguments, "--out", made.out, "--yes", "--no-report", fresh=True)
    tables = [made.out / "tables" / file for file in ("estimates.csv", *HEADLINES)]
    return {path.name: rows_digests(path) for path in tables if path.is_file()}


def request_digests(name: str, root: Path, pictures: Path) -> dict[str, Any]:
    """Run a suite of `SUITES` against a local server; number and digest of all bodies sent."""
    made = Workspace(root / f"requests-{name}", pictures)
    fields = {"dataset": {"format": "builtin", "path": "phyblock-400"}, "images": _SHOWN}
    suite = {**fields, "limit": _LIMITS.get(name, 4), **SUITES[name]}
    with made.served(OpenAIChat(), "probe", **suite) as server:
        made.completed("--yes")
    bodies = sorted(json.dumps(seen.raw, sort_keys=True) for seen in server.seen)
    return {"requests": len(bodies), "digest": _digest(bodies)}


def _digest(lines: list[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:32]


def main() -> None:
    """Write the golden runs that are named again."""
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    for name in sys.argv[1:] or [*RUNS, "requests"]:
        if name == "paper-table1" and official_root() is None:
            print("paper-table1 needs the official data: left as it is")
            continue
        with tempfile.TemporaryDirectory(prefix="phyblock-golden-") as folder:
            root, pictures = Path(folder), Path(folder) / "cache" / "pictures"
            if name == "requests":
                golden[name] = {suite: request_digests(suite, root, pictures) for suite in SUITES}
            else:
                golden[name] = run_numbers(name, root, pictures)
        GOLDEN.write_text(json.dumps(golden, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
