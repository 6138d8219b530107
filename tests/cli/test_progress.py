"""A run while it goes on: plain words, few lines, and no time before it can be known."""

from __future__ import annotations

import io
import itertools
import re

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from phyblock.cli.progress import ProgressView
from phyblock.models.model import ModelEvent
from phyblock.records.files import known_records
from phyblock.run.runner import ModelStopped, RunEvent, RunNotice, RunStarted, SampleDone
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
    with ProgressView(Console(file=screen, width=160), lambda: now_s) as view:
        expected = models or {"alpha": 10}
        view(RunStarted(expected, dict.fromkeys(expected, ())))
        for at_s, event in events:
            now_s = at_s
            view.tick() if event is None else view(event)
    return screen.getvalue().splitlines()


def test_a_log_tells_of_retries_servers_failures_and_models_that_are_stopped() -> None:
    lines = logged(
        (0.0, retry()),
        (1.0, RunNotice("http://host:1 cannot be reached [x] :b: no connection")),
        (2.0, retry(None, 9.0)),
        (11.0, done(outcome="api_error")),
        (12.0, ModelStopped("alpha", "HTTP 401: no")),
        (21.5, retry()),
    )
    assert lines == [
        "alpha: 1 call sent again; last: HTTP 429: busy; waiting 1 s",
        "http://host:1 cannot be reached [x] :b: no connection",
        "alpha: 1 call sent again; last: no connection to host; waiting 9 s",
        "1 of 10 samples after 11 s, 1 api error, 2 sent again",
        "alpha stopped: HTTP 401: no",
        "alpha: 1 call sent again; last: HTTP 429: busy; waiting 1 s",
        "1 of 1 sample after 22 s, 1 api error, 3 sent again",
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
            if found := re.match(r"(a|b): (\d+) calls? sent again", line):
                said[found[1]].append(now_s)
                counted += int(found[2])
        screen.seek(0)
        screen.truncate()

    with ProgressView(Console(file=screen, width=160), lambda: now_s) as view:
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
