"""A run as Inspect AI logs, one a track and model, which `inspect view` opens."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from phyblock.records.record import PromptMessage, Record
from phyblock.records.record import Score as StoredScore
from phyblock.records.reply import Reply
from phyblock.report.export.rows import newest_records, prompt_text
from phyblock.resources import needs
from phyblock.run.store import read_prompts
from phyblock.scoring.counts import Counts
from phyblock.stable import hex_digest
from phyblock.tables.load import Run
from phyblock.tables.measures import SCORED_BY
from phyblock.tracks.estimates import numbers_of, stored_counts, track_estimates, track_measures

if TYPE_CHECKING:
    from inspect_ai.log import EvalLog, EvalMetric, EvalSample
    from inspect_ai.scorer import Score

__all__ = ["inspect_log", "to_inspect"]

_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


def to_inspect(run: Run, folder: Path) -> tuple[Path, ...]:
    """Write TRACK_MODEL.eval for each track and model that has a record.

    Raises SpecError where the `inspect_ai` package is not installed.
    """
    needs("inspect_ai.log", "inspect", "inspect")
    from inspect_ai.log import write_eval_log

    prompts = read_prompts(run.path)
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in newest_records(run):
        groups.setdefault((record.track, record.model), []).append(record)
    files = []
    for (track, model), records in groups.items():
        files.append(folder / f"{track}_{_UNSAFE.sub('-', model)}.eval")
        write_eval_log(inspect_log(run, records, prompts), str(files[-1]))
    return tuple(files)


def inspect_log(
    run: Run, records: Sequence[Record], prompts: Mapping[str, Sequence[PromptMessage]]
) -> EvalLog:
    """The log of one track and model: a sample a record, its seed the epoch.

    Scores are named SETTING-MATCHER-CRITERION and hold tp, fp, fn and f1. A question's score is
    `answer`: C or I. The metrics of the log are the estimates of the tables, each of the last cell
    (overall, where its criterion is counted there) that has it.
    """
    from inspect_ai.log import EvalConfig, EvalDataset, EvalLog, EvalResults, EvalSpec

    track, model = records[0].track, records[0].model
    seeds = run.design.suite.seeds
    name = f"phyblock/{track}"
    digest = hex_digest(f"{run.manifest.identity} {track} {model}")[:22]
    data = run.manifest.dataset
    samples = [_sample(record, prompts, seeds) for record in records]
    keys = sorted({str(sample.id) for sample in samples})
    return EvalLog(
        status="success",
        eval=EvalSpec(
            eval_id=digest,
            run_id=digest,
            task_id=digest,
            created=min(record.time for record in records),
            task=name,
            dataset=EvalDataset(
                name=(data.name if data else "") or run.design.suite.name,
                samples=len(keys),
                sample_ids=list(keys),
            ),
            model=model,
            config=EvalConfig(epochs=len(seeds)),
            metadata={"suite": run.design.suite.name, "run": run.manifest.identity},
        ),
        results=EvalResults(
            total_samples=len(samples),
            completed_samples=sum(record.reply is not None for record in records),
            scores=_results(run, track, model),
        ),
        samples=samples,
    )


def _sample(
    record: Record, prompts: Mapping[str, Sequence[PromptMessage]], seeds: Sequence[int]
) -> EvalSample:
    from inspect_ai.log import EvalError, EvalSample
    from inspect_ai.model import ChatMessageAssistant, ChatMessageUser, ModelOutput

    text = prompt_text(record, prompts) or ""
    reply, error = record.reply, record.error
    output = ModelOutput(model=record.model)
    messages: list[Any] = [ChatMessageUser(content=text)]
    if reply is not None:
        output = ModelOutput.from_content(record.model, reply.text)
        output.usage = _usage(reply)
        messages.append(ChatMessageAssistant(content=reply.text, model=record.model))
    kept = (
        "sample",
        "key",
        "scene",
        "levels",
        "parents",
        "n_blocks",
        "outcome",
        "parse",
        "question",
        "variant",
        "turns",
        "ending",
        "progress",
    )
    fields = record.fields()
    about = {name: fields[name] for name in kept if name in fields}
    return EvalSample(
        # The key tells rotations of one question apart; older records have none.
        id="/".join(filter(None, (record.item, record.way.key))),
        epoch=list(seeds).index(record.seed) + 1 if record.seed in seeds else 1,
        input=text,
        target=record.target,
        messages=messages,
        output=output,
        scores=_scores(record),
        metadata=about,
        total_time=None if reply is None else reply.latency_s,
        error=None
        if error is None
        else EvalError(message=error.message, traceback="", traceback_ansi=""),
    )


def _usage(reply: Reply) -> Any:
    from inspect_ai.model import ModelUsage

    sent, said = reply.usage.prompt_tokens or 0, reply.usage.completion_tokens or 0
    return ModelUsage(
        input_tokens=sent,
        output_tokens=said,
        total_tokens=sent + said,
        reasoning_tokens=reply.usage.reasoning_tokens,
        total_cost=reply.cost_usd,
    )


def _name(score: StoredScore) -> str:
    parts = (score.setting, score.matcher or "", score.criterion)
    return "-".join(part for part in parts if part)


def _scores(record: Record) -> dict[str, Score]:
    from inspect_ai.scorer import CORRECT, INCORRECT, Score

    found = {}
    for score in record.scores:
        counts = Counts(score.tp, score.fp, score.fn)
        value = {"tp": counts.tp, "fp": counts.fp, "fn": counts.fn, "f1": counts.f1 or 0.0}
        found[_name(score)] = Score(value=value, answer=record.said)
    if record.is_correct is not None:
        value_of = CORRECT if record.is_correct else INCORRECT
        found["answer"] = Score(value=value_of, answer=record.said)
    for counted in stored_counts(record.track):
        if numbers := numbers_of(counted, record.counts, record.sample):
            counts_of = dict(zip(counted.columns, numbers, strict=True))
            found[counted.name] = Score(value=counts_of, answer=record.said)
    return found


def _results(run: Run, track: str, model: str) -> list[Any]:
    from inspect_ai.log import EvalScore

    found = track_estimates(run, track)
    found = found[found["model"] == model]
    last = found.drop_duplicates(["measure", *SCORED_BY], keep="last").dropna(subset=["value"])
    counts = {measure.name: measure.counted.name for measure in track_measures(track)}
    metrics: dict[str, dict[str, float]] = {}
    sizes: dict[str, int] = {}
    for row in last.to_dict("records"):
        way = "-".join(row[name] for name in SCORED_BY if row[name])
        name = way or counts[row["measure"]]
        metrics.setdefault(name, {})[row["measure"]] = float(row["value"])
        sizes[name] = max(sizes.get(name, 0), row["n"])
    return [
        EvalScore(name=name, scorer=name, scored_samples=sizes[name], metrics=_metrics(values))
        for name, values in metrics.items()
    ]


def _metrics(values: Mapping[str, float]) -> dict[str, EvalMetric]:
    from inspect_ai.log import EvalMetric

    return {name: EvalMetric(name=name, value=value) for name, value in values.items()}
