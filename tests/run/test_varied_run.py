"""Whole runs that vary how they ask, at a local server: every question once, each repeat anew."""

from __future__ import annotations

import csv
import hashlib
import io
import json
from typing import Any

import numpy as np
import pytest
import yaml

from phyblock.scoring.counts import f1_of
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Raw, Workspace

VARY = {
    "prompt": ["default", "./brief.j2"],
    "background": ["checkerboard", "white"],
    "candidate_order": ["file", "shuffled"],
    "repeats": 2,
}
WAYS, SCENES = 16, 3
BRIEF = "{% block user %}Build it. End with lines: Step1: Move block with index N{% endblock %}"
KNOWN = ("sample", "variant", "shown", "parse", "scores", "prompt")


class Moody(OpenAIChat):
    """Answers by the seed as well, as a model that draws."""

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        draw = hashlib.sha256(seen.sample.encode()).digest()
        steps = [
            f"Step{n}: Move block with index {byte % 5 + 1}" for n, byte in enumerate(draw[:3], 1)
        ]
        body["choices"][0]["message"]["content"] = "\n".join(steps)
        return body


def prepare(workspace: Workspace, url: str, **fields: Any) -> None:
    (workspace.root / "brief.j2").write_text(BRIEF, encoding="utf-8")
    workspace.write_models(url, "alpha", transport="direct", seed="always")
    workspace.write_suite(models=["alpha", "random"], limit=SCENES, **fields)


def table(workspace: Workspace, name: str) -> list[Raw]:
    return list(csv.DictReader(io.StringIO(workspace.tables()[f"{name}.csv"].decode())))


def asked(server: OpenAIChat) -> list[str]:
    return [seen.sample for seen in server.seen]


def test_every_way_is_asked_once_and_what_is_kept_is_not_asked_again(workspace: Workspace) -> None:
    with Running(Moody()) as running:
        server = running.server
        assert isinstance(server, OpenAIChat)
        prepare(workspace, running.url, vary=VARY)
        dry = workspace.run("--dry-run")
        assert "16 conditions" in dry.out
        assert f"{WAYS * SCENES} calls" in dry.out
        done = workspace.run(page=True)
        assert (done.code, done.err) == (0, "")
        # A repeat is no question that the cache knows.
        assert len(set(asked(server))) == server.requests == WAYS * SCENES
        whole, lines = workspace.records(), (workspace.out / "records.jsonl").read_text()
        check_repeats(whole, server)
        check_scored_again(workspace)
        check_tables(workspace, whole)

        # Some records are left, no calls and no cache: what has a record is not asked again.
        kept = lines.splitlines(keepends=True)[: WAYS * SCENES // 2]
        (workspace.out / "records.jsonl").write_text("".join(kept) + lines[:40])
        (workspace.cache / "replies.sqlite").unlink()
        (workspace.out / "calls.jsonl").unlink()
        before, left = asked(server), {json.loads(line)["sample"] for line in kept}
        assert workspace.run("--no-report").code == 0
        again = asked(server)[len(before) :]
        lacking = [r for r in whole if r["sample"] not in left and r["model"] == "alpha"]
        assert len(set(again)) == len(again) == len(lacking)
        assert sorted([[r.get(k) for k in KNOWN] for r in workspace.records()], key=str) == sorted(
            [[r.get(k) for k in KNOWN] for r in whole], key=str
        )

        # The reference is what a suite asks that varies nothing, found in the cache.
        for path in workspace.cache.glob("replies*"):
            path.unlink()
        workspace.out = workspace.root / "anew"
        assert workspace.run("--no-report", "--models", "alpha").code == 0
        workspace.out = workspace.root / "plain"
        prepare(workspace, running.url, images={"size_px": 128, "background": "checkerboard"})
        requests = server.requests
        assert workspace.run("--models", "alpha").code == 0
        assert len(workspace.records()) == SCENES
        assert server.requests == requests
        assert all("variant" not in record for record in workspace.records())


def check_repeats(records: list[Raw], server: OpenAIChat) -> None:
    """Records say in what they differ from the reference; repeats were sent another seed."""
    mine = [record for record in records if record["model"] == "alpha"]
    assert len(mine) == WAYS * SCENES
    assert len({record["sample"] for record in records}) == len(records) == 2 * WAYS * SCENES
    seeds = [seen.seed for seen in server.seen]
    assert seeds.count(0) == len(mine) / 2
    assert len(set(seeds)) == 2
    for record in mine:
        variant = record.get("variant", {})
        key = ",".join(f"{name}={level}" for name, level in variant.items())
        end = f"/{key}" if key else ""
        assert record["sample"] == f"full_planning/alpha/{record['scene']}/s0{end}"
        assert record["prompt"]["template"] == variant.get("prompt", "default")
        assert ("shown" in record) == ("candidate_order" in variant)


def check_scored_again(workspace: Workspace) -> None:
    scored = workspace.root / "scored"
    assert workspace.phyblock("score", workspace.out, "--out", scored).code == 0
    first, again = ([r["scores"] for r in workspace.records(f)] for f in (workspace.out, scored))
    assert first == again
    asked = [r["prompt"] for r in workspace.records() if r["model"] == "alpha"]
    sent = {image["sha256"][:24] for prompt in asked for image in prompt["images"]}
    beside = {path.stem for path in (workspace.out / "report" / "pictures").glob("*.png")}
    assert beside == sent


def check_tables(workspace: Workspace, records: list[Raw]) -> None:
    """Headlines pool over variants."""
    (row,) = (r for r in table(workspace, "table1") if r["model"] == "alpha")
    assert float(row["overall_f1"]) == pytest.approx(100 * pooled(records), abs=0.05)
    factors = [r["factor"] for r in table(workspace, "sensitivity") if r["model"] == "alpha"]
    assert factors == ["prompt", "background", "candidate_order", "repeats", "items"]
    vary = yaml.safe_load((workspace.out / "run.yaml").read_text())["suite"]["vary"]
    assert {factor: vary[factor] for factor in VARY} == VARY


def pooled(records: list[Raw]) -> float:
    """F1 of the headline over a model's samples."""
    kept = [
        score
        for record in records
        if record["model"] == "alpha"
        for score in record["scores"]
        if (score["criterion"], score["matcher"], score["setting"]) == ("aov", "optimal", "A")
    ]
    sums = [sum(score[name] for score in kept) for name in ("tp", "fp", "fn")]
    return float(f1_of(np.array(sums, dtype=np.float64)))


def test_questions_and_episodes_vary_what_they_know(workspace: Workspace) -> None:
    """Episodes without a key; recordings were asked in one way."""
    workspace.write_suite(
        tracks=["step_planning"], levels=[4], vary={"view": ["oblique", "top"], "repeats": 2}
    )
    done = workspace.run()
    assert (done.code, done.err) == (0, "")
    records = workspace.records()
    assert len(records) == 2 * 4
    oracle = [r for r in records if r["model"] == "oracle"]
    assert {r["ending"] for r in oracle} == {"completed"}
    ways = yaml.safe_load((workspace.out / "run.yaml").read_text())["variants"]
    assert len({way["step_planning"]["pictures"] for way in ways.values()}) == 2
    assert len({turn["seed"] for r in oracle for turn in r["turns"]}) == 2
    assert {r["factor"] for r in table(workspace, "sensitivity")} == {"view", "repeats", "items"}
    scored = workspace.root / "scored"
    assert workspace.phyblock("score", workspace.out, "--out", scored).code == 0
    workspace.write_yaml("models.yaml", {"old": {"replay": "./out"}})
    refused = workspace.run("--models", "old", "--out", workspace.root / "other")
    assert refused.code == 2
    assert "was asked in one way" in refused.err
