"""Golden runs: numbers and requests that must not move.

    python -m tests.golden check [NAME ...]    compare with tests/golden.json
    python -m tests.golden make [NAME ...]     write tests/golden.json again
    ... --keep FOLDER                          keep the run folders there, to look into a difference

Numbers are compared by digests of the rows of each model and measure in `estimates.csv`, and of
each model in the headline tables; models, measures and columns that a run adds are no difference.
Requests are compared by a digest of all bodies that a local server received.
"""

import argparse
import hashlib
import json
import shutil
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

from tests.conftest import official_root
from tests.servers.chassis import Running
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

_SHOWN: dict[str, Any] = {"source": "render", "size_px": 128}
SUITES: dict[str, dict[str, Any]] = {
    "plans": {},
    "plans-separate": {"images": {**_SHOWN, "layout": "separate", "order": ["candidates", "goal"]}},
    "plans-json": {"answer_format": "json_schema"},
    "plans-blind": {"full_planning": {"blind": True}},
    "plans-shuffled": {"candidates": {"order": "shuffled"}, "seeds": [0, 1]},
    "plans-varied": {"vary": {"view": ["oblique", "front"], "layout": ["composite", "separate"]}},
    "steps": {"tracks": ["step_planning"]},
    "steps-json": {"tracks": ["step_planning"], "answer_format": "json_schema"},
    "poses": {"tracks": ["pose_planning"]},
    "questions": {"tracks": ["vqa"]},
    "questions-json": {
        "tracks": ["vqa"],
        "answer_format": "json_schema",
        "vqa": {"circular": True},
    },
}
_LIMITS = {"questions": 16, "questions-json": 16}


def rows_digests(path: Path) -> dict[str, str]:
    """Return a digest of the rows of each model, of estimates each model and measure, in a table.

    The order of rows changes nothing.
    """
    rows = csv_rows(path)
    columns = KEY_COLUMNS if path.name == "estimates.csv" else tuple(rows[0] if rows else ())
    by_model: defaultdict[str, list[str]] = defaultdict(list)
    for row in rows:
        model = row.get("model") or ""
        key = f"{model} {row['measure']}" if path.name == "estimates.csv" else model
        by_model[key].append(json.dumps([row[column] for column in columns]))
    return {model: _digest(sorted(lines)) for model, lines in by_model.items()}


def run_numbers(name: str, root: Path, pictures: Path) -> dict[str, dict[str, str]]:
    """Run a suite of `RUNS` below `root`; digests of its tables by file and model."""
    official = official_root()
    place = "" if official is None else str(official / "PhyBlock")
    arguments = [text.format(official=place) for text in RUNS[name]]
    made = _workspace(root / name, pictures)
    done = made.phyblock("run", *arguments, "--out", made.out, "--yes", "--no-report", fresh=True)
    if done.code != 0:
        raise SystemExit(f"{name}: exit code {done.code}\n{done.out}{done.err}")
    tables = [made.out / "tables" / file for file in ("estimates.csv", *HEADLINES)]
    return {path.name: rows_digests(path) for path in tables if path.is_file()}


def request_digests(name: str, root: Path, pictures: Path) -> dict[str, Any]:
    """Run a suite of `SUITES` against a local server; number and digest of all bodies sent."""
    made = _workspace(root / f"requests-{name}", pictures)
    fields = {"dataset": {"format": "builtin", "path": "phyblock-400"}, "images": _SHOWN}
    limit = _LIMITS.get(name, 4)
    made.write_suite(**{**fields, "models": ["probe"], "limit": limit, **SUITES[name]})
    server = OpenAIChat()
    with Running(server) as running:
        made.write_models(running.url, "probe")
        arguments = ("--models-file", made.root / "models.yaml", "--out", made.out, "--yes")
        done = made.phyblock("run", made.root / "suite.yaml", *arguments, "--no-report")
    if done.code != 0:
        raise SystemExit(f"{name}: exit code {done.code}\n{done.out}{done.err}")
    bodies = sorted(json.dumps(seen.raw, sort_keys=True) for seen in server.seen)
    return {"requests": len(bodies), "digest": _digest(bodies)}


def compare(golden: dict[str, Any], now: dict[str, Any], name: str) -> list[str]:
    """Return what differs, a line each; what `now` has beyond `golden` is no difference."""
    lines = []
    for key, value in golden.items():
        if isinstance(value, dict):
            lines += compare(value, now.get(key, {}), f"{name}: {key}")
        elif now.get(key) != value:
            lines.append(f"{name}: {key}: {'differs' if key in now else 'is missing'}")
    return lines


def _workspace(root: Path, pictures: Path) -> Workspace:
    root.mkdir(parents=True)
    return Workspace(root, pictures)


def _digest(lines: list[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:32]


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.golden")
    parser.add_argument("action", choices=("check", "make"))
    parser.add_argument("names", nargs="*", help=f"{', '.join(RUNS)}, requests; default: all")
    parser.add_argument("--keep", type=Path, help="folder in which the runs stay")
    return parser.parse_args()


def main() -> int:
    """Make or check the golden runs that are named."""
    options = _parse()
    names = options.names or [*RUNS, "requests"]
    golden = json.loads(GOLDEN.read_text(encoding="utf-8")) if GOLDEN.is_file() else {}
    root = options.keep or Path(tempfile.mkdtemp(prefix="phyblock-golden-"))
    pictures = root / "cache" / "pictures"
    differences: list[str] = []
    try:
        for name in names:
            if name == "paper-table1" and official_root() is None:
                print("paper-table1: skipped, the official data is not here")
                continue
            if name == "requests":
                now: dict[str, Any] = {s: request_digests(s, root, pictures) for s in SUITES}
            else:
                now = run_numbers(name, root, pictures)
            if options.action == "make":
                golden[name] = now
                GOLDEN.write_text(json.dumps(golden, indent=1) + "\n", encoding="utf-8")
            found = compare(golden.get(name, {}), now, name)
            differences += found
            print(f"{name}: {f'{len(found)} differences' if found else 'equal'}", flush=True)
    finally:
        if options.keep is None:
            shutil.rmtree(root)
    print(*differences, sep="\n")
    return 1 if differences else 0


if __name__ == "__main__":
    sys.exit(main())
