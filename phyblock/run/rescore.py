"""Reading and scoring stored replies again: no model is called, nothing stored is changed."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from phyblock.errors import DataError, Problem, StoreError
from phyblock.parsing import PlanParser
from phyblock.run.plan import open_dataset, planning_rules
from phyblock.run.reading import MANIFEST, RECORDS, read_manifest, read_records
from phyblock.run.records import judged
from phyblock.scoring import Matcher
from phyblock.specs import SuiteSpec
from phyblock.tasks import FullPlanning

__all__ = ["rescore"]


def rescore(
    folder: Path, parser: PlanParser | None, matcher: Matcher | None, out: Path | None
) -> Path:
    """Score a run again, with another parser or headline matcher, into a run folder of its own.

    The new folder (`<run>/scores/<parser>-<matcher>` when `out` is None) holds a manifest and
    records like any run, so that tables and notebooks read it. Raises StoreError for a folder that
    is no run or cannot be written, DataError when the data set is not what the run was made on.
    """
    manifest = read_manifest(folder)
    suite = SuiteSpec.model_validate(_with(manifest["suite"], parser, matcher))
    dataset = open_dataset(suite.dataset.format, Path(manifest["dataset"]["root"]))
    tasks = {task.scene.id: task for task in dataset.tasks}
    track = FullPlanning(planning_rules(suite))
    records = []
    for record in read_records(folder).values():
        task = tasks.get(record["scene"])
        if task is None or len(task.scene) != record["n_blocks"]:
            found = "no such scene" if task is None else f"{len(task.scene)} blocks"
            raise DataError(
                Problem(
                    str(dataset.root),
                    "is not the data set that the run was made on",
                    f"scene {record['scene']}",
                    found,
                    f"{record['n_blocks']} blocks",
                )
            )
        text = None if record["reply"] is None else record["reply"]["text"]
        records.append(judged(record, track.judge(task, text), suite.parser))
    target = out or folder / "scores" / f"{suite.parser}-{suite.scoring.matchers[0]}"
    _write(target, {**manifest, "suite": suite.model_dump(mode="json")}, records)
    return target


def _with(
    suite: Mapping[str, Any], parser: PlanParser | None, matcher: Matcher | None
) -> dict[str, Any]:
    scoring = dict(suite["scoring"])
    if matcher is not None:
        others = [name for name in scoring["matchers"] if name != matcher]
        scoring["matchers"] = [matcher, *others]
    return {**suite, "scoring": scoring, "parser": parser or suite["parser"]}


def _write(folder: Path, manifest: Mapping[str, Any], records: list[dict[str, Any]]) -> None:
    lines = (json.dumps(r, ensure_ascii=False, separators=(",", ":")) for r in records)
    texts = {
        MANIFEST: yaml.safe_dump(dict(manifest), sort_keys=False, allow_unicode=True, width=100),
        RECORDS: "".join(line + "\n" for line in lines),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            partial = folder / f"{name}.part"
            partial.write_text(text, encoding="utf-8")
            os.replace(partial, folder / name)
    except OSError as error:
        problem = Problem(str(folder), f"cannot be written: {error.strerror}")
        raise StoreError(problem) from error
