from __future__ import annotations

from typing import Any

import pandas as pd
from hypothesis import given

from phyblock.cli.progress import Tally
from phyblock.records.files import known_records
from phyblock.report import coverage_frame
from phyblock.run.events import Summary
from phyblock.tables.coverage import coverage_view
from phyblock.tables.outcomes import HEADINGS, OUTCOMES
from phyblock.tables.text_table import NO_VALUE
from tests.report.factory import laws, manifest, record, record_lists, run_of


@laws
@given(record_lists())
def test_outcomes_split_what_was_expected(records: list[dict[str, Any]]) -> None:
    table = coverage_frame(run_of(records, manifest()))
    assert table["model"].tolist() == ["alpha", "beta"]
    assert (table["recorded"] + table["not_run"] == table["expected"]).all()
    assert (table[list(OUTCOMES)].sum(axis=1) == table["recorded"]).all()
    assert (table["replies"] == table["recorded"] - table["api_error"] - table["missing"]).all()


def test_sums_are_of_what_is_known_and_say_how_much_is_not() -> None:
    records = [
        record(scene="000", prompt_tokens=10, completion_tokens=5, cost_usd=0.5, latency_s=1.0),
        record(scene="001", prompt_tokens=20, completion_tokens=7, cost_usd=0.25, latency_s=2.0),
        record(scene="002", cached=True, latency_s=9.0, attempts=0),
        record(scene="003", outcome="api_error"),
        record("beta", scene="000", prompt_tokens=0, completion_tokens=0, cost_usd=0.0, attempts=3),
    ]
    table = coverage_frame(run_of(records, manifest())).set_index("model")
    alpha = table.loc["alpha"]
    assert (alpha["prompt_tokens"], alpha["completion_tokens"]) == (30, 12)
    assert (alpha["tokens_unknown"], alpha["cost_unknown"]) == (1, 0)
    assert alpha["cost_usd"] == 0.75
    assert alpha["latency_s"] == 1.5
    assert (alpha["cached"], alpha["attempts"], alpha["replies"]) == (1, 2, 3)
    assert alpha["reasoning_tokens"] is pd.NA
    beta = table.loc["beta"]
    assert (beta["cost_usd"], beta["prompt_tokens"], beta["attempts"]) == (0, 0, 3)


def test_an_unknown_cost_is_never_shown_as_zero() -> None:
    facts = manifest(models=["partly", "unknown", "free", "dear", "unasked"])
    records = [
        record("partly", scene="000", cost_usd=0.0123),
        record("partly", scene="001"),
        record("unknown"),
        record("free", cost_usd=0.0),
        record("dear", cost_usd=1234.5),
    ]
    run = run_of(records, facts)
    view = coverage_view(coverage_frame(run), run)
    place = [column.name for column in view.columns].index("Cost")
    assert {row[0]: row[place] for row in view.rows} == {
        "partly": "$0.0123 + 1 unknown",
        "unknown": "unknown",
        "free": "$0.00",
        "dear": "$1,234.50",
        "unasked": NO_VALUE,
    }


def test_an_episode_that_is_partly_from_the_cache_cost_what_was_asked_anew() -> None:
    facts = manifest(models=["alpha"])
    one = record("alpha", cost_usd=0.75)
    priced = [(0.5, True), (0.25, False)]
    parse = {"rule": "move", "move": 1, "problem": None}
    turns = [
        {
            "n": n,
            "reply": {**one["reply"], "cost_usd": usd, "cached": old},
            "step": n,
            "parse": parse,
        }
        for n, (usd, old) in enumerate(priced, 1)
    ]
    facts["suite"]["tracks"] = ["step_planning"]
    episode = {**one, "track": "step_planning", "turns": turns}
    run = run_of([episode], facts)
    assert coverage_frame(run)[["cost_usd", "cost_unknown"]].values.tolist() == [[0.25, 0]]
    assert run.records["cost_usd"].tolist() == [0.75]
    tally = Tally(1)
    tally.add(Summary.of(known_records().validate_python(episode)))
    assert (tally.cost_usd, tally.unpriced) == (0.25, 0)


def test_replies_from_the_cache_cost_this_run_nothing() -> None:
    facts = manifest(models=["mixed", "cached", "unpriced"])
    records = [
        record("mixed", scene="000", cost_usd=0.5),
        record("mixed", scene="001", cost_usd=0.25, cached=True, attempts=0),
        record("cached", cost_usd=0.25, cached=True, attempts=0),
        record("unpriced", scene="000", cached=True, attempts=0),
        record("unpriced", scene="001"),
    ]
    run = run_of(records, facts)
    table = coverage_frame(run)
    costs = table.set_index("model")[["cost_usd", "cost_unknown"]]
    assert costs.loc["mixed"].tolist() == [0.5, 0]
    assert costs.loc["cached"].tolist() == [0.0, 0]
    assert costs["cost_usd"].isna().tolist() == [False, False, True]
    assert costs.loc["unpriced", "cost_unknown"] == 1
    assert "Cost is what this run paid; replies from the cache cost it nothing." in (
        coverage_view(table, run).notes
    )


def test_requests_say_which_they_are_where_some_led_to_no_reply() -> None:
    note = "Requests are those that led to a reply, with their retries."
    for outcome, said in (("ok", False), ("missing", False), ("api_error", True)):
        run = run_of([record(scene="000", attempts=2), record("beta", outcome=outcome)], manifest())
        assert (note in coverage_view(coverage_frame(run), run).notes) == said


def test_every_outcome_has_a_heading() -> None:
    assert tuple(HEADINGS) == OUTCOMES


def test_columns_that_tell_nothing_are_not_shown() -> None:
    run = run_of([record("alpha", attempts=0, latency_s=0.0)], manifest())
    bare = coverage_view(coverage_frame(run), run)
    always = ["Model", "Expected", "Not run", "OK", "Unparsed", "Refusal", "Truncated"]
    always += ["API error", "Missing", "Cost"]
    assert [column.name for column in bare.columns] == always
    assert bare.notes == ()
    run = run_of([record("alpha", prompt_tokens=1200, latency_s=0.25)], manifest())
    full = coverage_view(coverage_frame(run), run)
    assert [column.name for column in full.columns] == [
        *always,
        "Tokens in",
        "Latency (s)",
        "Requests",
    ]
    assert full.rows[0][-3:] == ("1,200", "0.25", "1")
    assert full.rows[1][-3:] == (NO_VALUE, NO_VALUE, "0")
