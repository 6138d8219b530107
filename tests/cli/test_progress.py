"""What a log says while calls go wrong: plain words, few lines."""

from __future__ import annotations

import io
import itertools

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from phyblock.cli.progress import ProgressView
from phyblock.cli.remarks import Remarks
from phyblock.records.files import known_records
from phyblock.run.events import (
    ModelNotice,
    ModelStopped,
    RunEvent,
    RunNotice,
    RunStarted,
    SampleDone,
)
from tests.report.factory import record


def retry(status: int | None = 429, wait_s: float = 1.0, model: str = "alpha") -> ModelNotice:
    text = f"HTTP {status}: said so" if status else "no connection to host"
    return ModelNotice(model, "retry", text, wait_s, status=status)


def test_the_first_trouble_is_said_at_once_and_what_follows_in_one_line() -> None:
    remarks = Remarks(10.0)
    (first,) = remarks.add(retry(), 100.0)
    assert first == (
        "alpha: asking again once (1 for HTTP 429 (too many requests)), waiting up to 1 s; "
        "last: HTTP 429: said so"
    )
    for number in range(30):
        assert remarks.add(retry(wait_s=number), 101.0) == []
    assert remarks.add(retry(500), 102.0) == []
    assert remarks.add(retry(None), 103.0) == []
    assert remarks.due(109.9) == []
    (line,) = remarks.due(110.0)
    assert "asking again 32 times" in line
    assert "30 for HTTP 429 (too many requests), 1 for HTTP 500, 1 for no answer" in line
    assert "waiting up to 29 s; last: no connection to host" in line
    assert remarks.due(200.0) == []


@given(
    st.lists(st.tuples(st.sampled_from("ab"), st.floats(0, 3), st.booleans()), max_size=200),
    st.floats(1, 20),
)
def test_no_model_has_more_than_a_line_a_while_and_every_retry_is_counted(
    steps: list[tuple[str, float, bool]], every_s: float
) -> None:
    remarks = Remarks(every_s)
    now_s = 0.0
    said: dict[str, list[float]] = {"a": [], "b": []}
    counted = 0
    for model, passes_s, is_retry in steps:
        now_s += passes_s
        lines = remarks.add(retry(model=model), now_s) if is_retry else remarks.due(now_s)
        for line in lines:
            said[line[0]].append(now_s)
            words = line.split("asking again ")[1]
            counted += 1 if words.startswith("once") else int(words.split()[0])
    # Sums of times are rounded: an interval later is not always an interval on the clock.
    for line in remarks.due(now_s + 2 * every_s):
        words = line.split("asking again ")[1]
        counted += 1 if words.startswith("once") else int(words.split()[0])
    assert counted == sum(is_retry for *_, is_retry in steps)
    for times in said.values():
        assert all(b - a >= every_s for a, b in itertools.pairwise(times))


def logged(*events: tuple[float, RunEvent]) -> list[str]:
    """The lines that a log gets, each event at its time [s]."""
    now_s = 0.0
    screen = io.StringIO()
    with ProgressView(Console(file=screen, width=160), "trial", lambda: now_s) as view:
        view(RunStarted({"alpha": 10}, {"alpha": ()}))
        for at_s, event in events:
            now_s = at_s
            view(event)
    return screen.getvalue().splitlines()


def test_a_log_tells_of_retries_servers_and_failures() -> None:
    lines = logged(
        (0.0, retry()),
        (1.0, RunNotice("http://host:1 cannot be reached [x] :b: no connection")),
        (11.0, retry(None)),
        (12.0, ModelNotice("alpha", "unavailable", "HTTP 401: no")),
        (12.0, ModelStopped("alpha", "HTTP 401: no")),
    )
    assert lines[0].startswith("alpha: asking again once (1 for HTTP 429")
    assert lines[1] == "http://host:1 cannot be reached [x] :b: no connection"
    assert lines[2].endswith("last: no connection to host")
    assert lines[3].startswith("0 of 10 samples")
    assert lines[4] == "alpha stopped: HTTP 401: no"
    assert len(lines) == 5


def test_a_log_counts_failures_and_ends_with_what_was_not_yet_said() -> None:
    failed = known_records().validate_python(record(outcome="api_error"))
    lines = logged(
        (0.0, retry()),
        (10.0, SampleDone(failed)),
        (11.0, SampleDone(failed)),
        (12.0, retry()),
        (13.0, retry()),
        (20.5, SampleDone(failed)),
        (21.0, retry()),
    )
    assert lines[1].startswith("1 of 10 samples")
    assert lines[1].endswith(" · 1 api error · 1 sent again")
    assert lines[-2].endswith(" · 3 api error · 3 sent again")
    assert lines[-1].startswith("alpha: asking again 2 times")


def test_no_time_is_told_before_every_model_has_answered_and_stopped_samples_leave() -> None:
    def done(model: str, outcome: str = "ok") -> SampleDone:
        return SampleDone(known_records().validate_python(record(model=model, outcome=outcome)))

    now_s = 0.0
    screen = io.StringIO()
    with ProgressView(Console(file=screen, width=160), "trial", lambda: now_s) as view:
        view(RunStarted({"alpha": 100, "random": 100}, {"alpha": (), "random": ()}))
        for at_s, event in (
            (10.0, done("random")),
            (20.0, done("alpha", outcome="api_error")),
            (30.0, done("alpha")),
            (31.0, ModelStopped("random", "HTTP 401: no")),
            (40.0, done("alpha")),
        ):
            now_s = at_s
            view(event)
    lines = [line for line in screen.getvalue().splitlines() if "samples" in line]
    assert [" left" in line for line in lines] == [False, False, True, True]
    assert lines[2].startswith("3 of 200 samples")
    # 99 of random at one in 30 s; 97 of alpha at two in 40 s, of 101 that can still come.
    assert "49 min 30 s left" in lines[2]
    assert lines[3].startswith("4 of 101 samples")
    assert "32 min 20 s left" in lines[3]
