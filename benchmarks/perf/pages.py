"""Times to open a report and a leaderboard of many samples, and the size of their pages.

    python benchmarks/perf/pages.py RUN --models 30 --seeds 9

RUN is a run of full planning; its records are repeated for so many models and seeds.
"""

from __future__ import annotations

import argparse
import itertools
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from playwright.sync_api import Browser

from benchmarks.perf.measure import ROOT, run_measured
from tests.web.conftest import chromium

_OPENED = """() => {
    const [page] = performance.getEntriesByType("navigation");
    return document.documentElement.dataset.shown ? performance.now() - page.startTime : 0;
}"""


def repeated(run: Path, models: int, seeds: int, out: Path) -> int:
    """Write a run of so many models and seeds; return its number of samples."""
    facts = yaml.safe_load((run / "run.yaml").read_text(encoding="utf-8"))
    known = [model for model in facts["models"] if model["kind"] != "baseline"]
    names = [f"model-{n:02}" for n in range(models)]
    sources = dict(zip(names, itertools.cycle(known), strict=False))
    facts["models"] = [{**sources[name], "name": name} for name in names]
    facts["suite"] |= {"models": names, "seeds": list(range(seeds))}
    out.mkdir()
    (out / "run.yaml").write_text(yaml.safe_dump(facts), encoding="utf-8")
    by_model: dict[str, list[dict[str, Any]]] = {}
    with (run / "records.jsonl").open(encoding="utf-8") as lines:
        for record in map(json.loads, lines):
            by_model.setdefault(record["model"], []).append(record)

    def written() -> Iterator[str]:
        for name, seed in itertools.product(names, range(seeds)):
            for record in by_model[sources[name]["name"]]:
                sample = f"full_planning/{name}/{record['key']}/s{seed}"
                yield json.dumps(record | {"sample": sample, "model": name, "seed": seed}) + "\n"

    with (out / "records.jsonl").open("w", encoding="utf-8") as file:
        return sum(bool(file.write(line)) for line in written())


def opened_ms(browser: Browser, path: Path) -> float:
    """Return the best of three times from the address to a page that is shown [ms]."""
    times = []
    for _ in range(3):
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.goto(path.as_uri())
        times.append(float(page.wait_for_function(_OPENED, polling=5).json_value()))
        page.close()
    return min(times)


def main() -> None:
    """Make, write and open both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("--models", type=int, default=30)
    parser.add_argument("--seeds", type=int, default=9)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        run, site = Path(folder, "run"), Path(folder, "site")
        count = repeated(given.run, given.models, given.seeds, run)
        phyblock = [shutil.which("phyblock") or str(Path(sys.executable).with_name("phyblock"))]
        for words, page in (
            (["report", run], run / "report.html"),
            (["site", run, "--out", site], site / "index.html"),
        ):
            cost = run_measured([*phyblock, *map(str, words)], {"PATH": str(ROOT)})
            size_mb = page.stat().st_size / 1e6
            three_mb = sum(path.stat().st_size for path in page.parent.rglob("three.js")) / 1e6
            print(
                f"{words[0]}: {given.models} models, {count:,} samples: written in "
                f"{cost.wall_s:.0f} s, page {size_mb:.2f} MB and three.js {three_mb:.2f} MB, "
                f"opens in {opened_ms(browser, page):.0f} ms"
            )


if __name__ == "__main__":
    main()
