"""The session: one question at a time, nothing before consent, time without pauses."""

from __future__ import annotations

import asyncio
import json

import pytest

from phyblock.models import HaltedError, Image, Message, Request
from phyblock.tracks.baselines import Choice, Picking, Spot, picks_of
from phyblock.web.session import Given, NotNowError, PlaySession

PICTURE = Image(b"pixels", "candidates", 64, 64)
PICKING = Picking(
    (Choice("1", "", (Spot("candidates", 0),)), Choice("2", "", (Spot("candidates", 1),))),
    least=1,
    most=3,
    repeats=True,
    noun="step",
    write=lambda picks: " ".join(str(pick.place) for pick in picks),
)


def request(key: str = "secret-scene") -> Request:
    message = Message("user", ("Look:", PICTURE, "What comes first?"))
    return Request(key, 0, (message,), {}, "v", {"answer": "secret-answer"})


class Clock:
    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def session_at(clock: Clock) -> PlaySession:
    session = PlaySession(2, clock)
    session.welcome({"name": "ada", "consent": "May we?", "done": 0, "of": 2})
    return session


async def asked(session: PlaySession) -> asyncio.Task[Given]:
    task = asyncio.create_task(session.ask(request(), PICKING))
    await asyncio.sleep(0)
    return task


def test_nothing_is_shown_before_consent_and_no_name_or_answer_ever() -> None:
    async def play() -> None:
        session = session_at(Clock())
        task = await asked(session)
        told = session.state(-1)
        assert told["phase"] == "consent"
        assert "question" not in told
        assert session.picture(told["change"], 0) is None
        session.agree()
        told = session.state(-1)
        parts = told["question"]["messages"][0]["parts"]
        assert [part.get("text") for part in parts] == ["Look:", None, "What comes first?"]
        assert "secret" not in json.dumps(told)
        assert session.picture(told["change"], 0) is PICTURE
        assert session.picture(told["change"], 1) is session.picture(told["change"] - 1, 0) is None
        session.close()
        with pytest.raises(HaltedError):
            await task

    asyncio.run(play())


def test_the_clock_runs_from_the_first_look_and_stands_still_in_pauses() -> None:
    async def play() -> Given:
        clock = Clock()
        session = session_at(clock)
        task = await asked(session)
        clock.now = 100.0
        session.agree()
        clock.now = 200.0
        session.state(-1)
        clock.now = 203.0
        session.pause()
        assert "question" not in session.state(-1)
        clock.now = 400.0
        session.resume()
        clock.now = 401.0
        assert session.state(-1)["elapsed_s"] == 3.0
        clock.now = 403.5
        session.answer(session.state(-1)["change"], picks_of([1, 0, 1]))
        return await task

    assert asyncio.run(play()) == Given(picks_of([1, 0, 1]), 5.5)


def test_an_answer_counts_once_and_only_for_what_lies_there() -> None:
    async def play() -> None:
        session = session_at(Clock())
        task = await asked(session)
        session.agree()
        change = session.state(-1)["change"]
        with pytest.raises(NotNowError):
            session.answer(change - 1, picks_of([0]))
        with pytest.raises(ValueError, match="holds 0 picks"):
            session.answer(change, [])
        session.answer(change, picks_of([0]))
        for late in (change, change + 1):
            with pytest.raises(NotNowError):
                session.answer(late, picks_of([1]))
        assert (await task).picks == picks_of([0])
        assert session.state(-1)["phase"] == "waiting"
        with pytest.raises(NotNowError):
            session.pause()

    asyncio.run(play())
