"""How large a site is, how long it takes to make, and how long it takes to open.

    python benchmarks/perf/site.py [--models 30] [--samples 100000] [--from RUN] [--keep FOLDER]

Runs are made up by repeating the records of a real one (--from, as a run of recordings; without it,
the baselines are run on the bundled scenes) under further names of models and further seeds, each
time with the replies to other scenes, so that none is packed as a copy of its neighbor. Then
`phyblock site` puts them into one folder, and headless Chromium opens it from disk, where
playwright and a Chromium are installed. Prints seconds, memory and sizes.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path
from typing import Any

import yaml
from measure import run_measured
from reporting import make_source

CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run"]
PHYBLOCK = (sys.executable, "-m", "phyblock")
WAIT_MS = 60_000
APART = 47
"""How many scenes lie between one reply and the one that takes its place."""


def by_model(source: Path) -> dict[str, list[dict[str, Any]]]:
    """The records of a run by model."""
    found: dict[str, list[dict[str, Any]]] = {}
    with (source / "records.jsonl").open(encoding="utf-8") as lines:
        for line in lines:
            record = json.loads(line)
            found.setdefault(record["model"], []).append(record)
    return found


def repeated(records: list[dict[str, Any]], name: str, run: str) -> Iterator[dict[str, Any]]:
    """Records of one model again and again, under another name and with further seeds."""
    seeds = len({record["seed"] for record in records})
    for again in count():
        for place, record in enumerate(records):
            seed = record["seed"] + again * seeds
            sample = f"{record['track']}/{name}/{record['key']}/s{seed}"
            about = {"sample": sample, "model": name, "seed": seed, "run": run}
            reply = records[(place + again * APART) % len(records)]["reply"]
            yield {**record, **about, "reply": reply}


def write_runs(source: Path, folder: Path, models: int, samples: int, runs: int) -> list[Path]:
    """Run folders with `models` models and `samples` samples in all."""
    records = by_model(source)
    manifest = yaml.safe_load((source / "run.yaml").read_text(encoding="utf-8"))
    about = {model["name"]: model for model in manifest["models"]}
    paths = []
    for number in range(runs):
        path = folder / f"run-{number}"
        path.mkdir(parents=True)
        identity = f"{number:064x}"
        named, seeds = [], set()
        with (path / "records.jsonl").open("w", encoding="utf-8") as file:
            for place in range(number, models, runs):
                original = list(records)[place % len(records)]
                name = f"{original}-{place:02}"
                named.append({**about[original], "name": name})
                of_model = repeated(records[original], name, identity[:16])
                for record in islice(of_model, samples // models):
                    seeds.add(record["seed"])
                    file.write(json.dumps(record, ensure_ascii=False) + "\n")
        suite = {**manifest["suite"], "seeds": sorted(seeds)}
        told = {**manifest, "identity": identity, "models": named, "suite": suite}
        (path / "run.yaml").write_text(yaml.safe_dump(told, sort_keys=False), encoding="utf-8")
        paths.append(path)
    return paths


def opened(site: Path) -> None:
    """Print how long views take in a browser, from disk."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("not opened: playwright is not installed")
        return
    found = next(filter(None, map(shutil.which, CHROMIUMS)), None)
    if found is None:
        print("not opened: there is no Chromium")
        return
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=found, args=FLAGS)
        page = browser.new_page()
        address = (site / "index.html").as_uri()
        page.goto("about:blank")
        start = time.perf_counter()
        page.goto(address)
        page.wait_for_selector(".board tbody tr", timeout=WAIT_MS)
        print(f"opened, ranked table shown     {time.perf_counter() - start:7.2f} s")
        for name, selector, shown in (
            ("a model, all of its samples", ".board tbody a", ".tiles a"),
            ("a replay", ".tiles a", ".card"),
        ):
            start = time.perf_counter()
            page.locator(selector).first.click()
            page.wait_for_selector(shown, timeout=WAIT_MS)
            print(f"{name:<30} {time.perf_counter() - start:7.2f} s")
        start = time.perf_counter()
        page.goto(f"{address}#scenes")
        page.wait_for_selector(".lead", timeout=WAIT_MS)
        print(f"{'all scenes':<30} {time.perf_counter() - start:7.2f} s")
        browser.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--models", type=int, default=30)
    parser.add_argument("--samples", type=int, default=100_000)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--from", dest="source", type=Path)
    parser.add_argument("--keep", type=Path, help="make runs and site here, and leave them")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        source = given.source or make_source(folder / "source")
        runs = write_runs(source, folder, given.models, given.samples, given.runs)
        site = folder / "site"
        command = (*PHYBLOCK, "site", *map(str, runs), "--out", str(site))
        cost = run_measured(command, os.environ)
        print(f"{given.models} models, {given.samples:,} samples in {given.runs} runs")
        took = f"{cost.wall_s:7.2f} s  {cost.cpu_s:.2f} s CPU  {cost.peak_mb:.0f} MB"
        print(f"{'phyblock site':<30} {took}")
        files = [path for path in site.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
        print(f"{'folder':<30} {size / 1e6:7.2f} MB in {len(files)} files")
        first = [path for path in files if path.name in ("index.html", "board.js")]
        print(f"{'read to open':<30} {sum(p.stat().st_size for p in first) / 1e6:7.2f} MB")
        opened(site)


if __name__ == "__main__":
    main()
