"""A run while it goes on: plain words, few lines, and no time before it can be known."""

from __future__ import annotations

import io
import itertools
import re

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from phyblock.cli.progress import ProgressView
from phyblock.models import ModelEvent
from phyblock.records.files import known_records
from phyblock.run.events import (
    ModelStopped,
    RunEvent,
    RunNotice,
    RunStarted,
    SampleDone,
)
from tests.web.factory import record


def retry(status: int | None = 429, wait_s: float = 1.0, model: str = "alpha") -> ModelEvent:
    text = f"HTTP {status}: busy" if status else "no connection to host"
    return ModelEvent(model, "retry", text, wait_s, status=status)


def done(model: str = "alpha", outcome: str = "ok") -> SampleDone:
    return SampleDone(known_records().validate_python(record(model=model, outcome=outcome)))


def logged(*events: tuple[float, RunEvent | None], **models: int) -> list[str]:
    """The lines that a log gets, each event at its time [s]; None is a tick of the clock."""
    now_s = 0.0
    screen = io.StringIO()
    with ProgressView(Console(file=screen, width=160), "trial", lambda: now_s) as view:
        expected = models or {"alpha": 10}
        view(RunStarted(expected, dict.fromkeys(expected, ())))
        for at_s, event in events:
            now_s = at_s
            view.tick() if event is None else view(event)
    return screen.getvalue().splitlines()


def test_a_log_tells_of_retries_servers_and_models_that_are_stopped() -> None:
    lines = logged(
        (0.0, retry()),
        (1.0, RunNotice("http://host:1 cannot be reached [x] :b: no connection")),
        (2.0, retry(None, 9.0)),
        (11.0, retry(None)),
        (12.0, ModelEvent("alpha", "unavailable", "HTTP 401: no")),
        (12.0, ModelStopped("alpha", "HTTP 401: no")),
    )
    assert lines == [
        "alpha: asking again once (1 for HTTP 429 (too many requests)), waiting up to 1 s; "
        "last: HTTP 429: busy",
        "http://host:1 cannot be reached [x] :b: no connection",
        "alpha: asking again 2 times (2 for no answer), waiting up to 9 s; "
        "last: no connection to host",
        "Waiting for the first answer ... (11 s) · 3 sent again",
        "alpha stopped: HTTP 401: no",
    ]


@given(
    st.lists(st.tuples(st.sampled_from("ab"), st.floats(0, 3), st.booleans()), max_size=100),
)
def test_no_model_has_more_than_a_line_in_ten_seconds_and_every_retry_is_counted(
    steps: list[tuple[str, float, bool]],
) -> None:
    now_s, said = 0.0, dict[str, list[float]](a=[], b=[])
    counted = 0
    screen = io.StringIO()

    def read() -> None:
        nonlocal counted
        for line in screen.getvalue().splitlines():
            if found := re.match(r"(a|b): asking again (once|\d+)", line):
                said[found[1]].append(now_s)
                counted += 1 if found[2] == "once" else int(found[2])
        screen.seek(0)
        screen.truncate()

    with ProgressView(Console(file=screen, width=160), "trial", lambda: now_s) as view:
        view(RunStarted({"a": 9, "b": 9}, {"a": (), "b": ()}))
        for model, passes_s, is_retry in steps:
            now_s += passes_s
            view(retry(model=model)) if is_retry else view.tick()
            read()
    for times in said.values():
        assert all(b - a >= 10 for a, b in itertools.pairwise(times))
    # The rest is told at the end, whenever that is.
    read()
    assert counted == sum(is_retry for *_, is_retry in steps)


def test_a_log_counts_failures_and_ends_with_what_was_not_yet_told() -> None:
    failed = done(outcome="api_error")
    lines = logged((0.0, retry()), (10.0, failed), (11.0, failed), (20.5, failed), (21.0, retry()))
    assert "1 of 10 samples · 1 api error · 1 sent again" in lines
    assert "3 of 10 samples · 3 api error · 1 sent again" in lines
    assert lines[-1].startswith("alpha: asking again once")


def test_waiting_is_told_while_nothing_is_answered() -> None:
    lines = logged((9.0, None), (10.0, None), (15.0, None), (75.0, None))
    assert lines == [
        "Waiting for the first answer ... (10 s)",
        "Waiting for the first answer ... (1 min 15 s)",
    ]


def test_no_time_is_told_before_every_model_has_given_enough_answers() -> None:
    """Two models of 100 samples: alpha answers every second, beta every ten from 100 s on."""
    events = [(float(second), done("alpha")) for second in range(1, 101)]
    events += [(100.0 + 10 * n, done("beta")) for n in range(1, 31)]
    lines = logged(*events, alpha=100, beta=100)
    told = [line for line in lines if " left" in line]
    (first, *_) = told
    # The first answer of beta came at 110 s, and the twentieth at 300 s.
    assert lines.index(first) == lines.index("119 of 200 samples") + 1
    assert re.fullmatch(r"120 of 200 samples · 12 min \d\d s left", first)
    stopped = logged(
        *events, (401.0, ModelStopped("beta", "HTTP 401: no")), (411.0, None), alpha=100, beta=100
    )
    # Samples that nobody will ask about are no part of the whole.
    assert stopped[-1] == "130 of 130 samples"
