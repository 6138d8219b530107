"""Time and memory to rebuild what is made of a large run, against reading its records alone.

    python benchmarks/perf/reporting.py [--records 20000] [--from RUN] [--keep FOLDER]

A run is made up by repeating the records of a real one (--from; without it, the baselines are run
on the bundled scenes) under further names of models. Then `phyblock figures`
and `phyblock report` (all of it, with the page) rebuild it, each in a process of its own; the peer
parses the same lines as JSON and does nothing with them. Prints wall seconds, their ratio to the
peer's, CPU seconds and peak memory.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from measure import Cost, run_measured

BASELINES = "oracle,oracle-no-orientation,random,all-candidates"
PEER = "import json, sys\nfor line in open(sys.argv[1], 'rb'):\n    json.loads(line)\n"
PHYBLOCK = (sys.executable, "-m", "phyblock")


def make_source(folder: Path) -> Path:
    """A real run of the baselines on all bundled scenes."""
    command = (*PHYBLOCK, "run", "full", "--models", BASELINES, "--set", "seeds=[0]")
    run_measured((*command, "--out", str(folder), "--yes"), os.environ)
    return folder


def repeated(source: Path, wanted: int) -> Iterator[dict[str, Any]]:
    """Records of a run again and again, each time under further names of models."""
    with (source / "records.jsonl").open(encoding="utf-8") as lines:
        records = [json.loads(line) for line in lines]
    if not records:
        sys.exit(f"{source} holds no records")
    for number in range(wanted):
        again, place = divmod(number, len(records))
        record = records[place]
        model = f"{record['model']}-{again:02}"
        sample = record["sample"].replace(f"/{record['model']}/", f"/{model}/", 1)
        yield {**record, "model": model, "sample": sample}


def write_large(source: Path, folder: Path, wanted: int) -> Path:
    """A run folder with `wanted` records; its manifest names the models that they are of."""
    manifest = yaml.safe_load((source / "run.yaml").read_text(encoding="utf-8"))
    about = {model["name"]: model for model in manifest["models"]}
    folder.mkdir(parents=True, exist_ok=True)
    seen: dict[str, dict[str, Any]] = {}
    with (folder / "records.jsonl").open("w", encoding="utf-8") as file:
        for record in repeated(source, wanted):
            original = record["model"].rpartition("-")[0]
            seen.setdefault(record["model"], {**about[original], "name": record["model"]})
            file.write(json.dumps(record, ensure_ascii=False, separators=(",", ":")) + "\n")
    manifest["models"] = list(seen.values())
    (folder / "run.yaml").write_text(yaml.safe_dump(manifest, sort_keys=False), encoding="utf-8")
    prompts = source / "prompts.jsonl"
    if prompts.exists():
        (folder / prompts.name).write_bytes(prompts.read_bytes())
    return folder


def show(name: str, cost: Cost, peer: Cost) -> None:
    """A line of the result."""
    ratio = f"{cost.wall_s / peer.wall_s:5.1f} x"
    print(f"{name:<34} {cost.wall_s:7.2f} s {ratio} {cost.cpu_s:7.2f} s CPU {cost.peak_mb:7.0f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--records", type=int, default=20_000)
    parser.add_argument("--from", dest="source", type=Path)
    parser.add_argument("--keep", type=Path, help="make the large run here, and leave it")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        source = given.source or make_source(Path(scratch) / "source")
        run = write_large(source, given.keep or Path(scratch) / "large", given.records)
        records = run / "records.jsonl"
        print(f"{given.records:,} records, {records.stat().st_size / 1e6:.0f} MB")
        peer = run_measured((sys.executable, "-c", PEER, str(records)), os.environ)
        show("reading the lines as JSON", peer, peer)
        for verb in ("figures", "report"):
            command = (*PHYBLOCK, verb, str(run))
            show(f"phyblock {verb}", run_measured(command, os.environ), peer)


if __name__ == "__main__":
    main()
