"""What an error says."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import ModelError


@given(st.text())
def test_what_a_server_says_steers_no_terminal(message: str) -> None:
    assert str(ModelError(message)).isprintable()


def test_words_stay_as_they_are() -> None:
    assert str(ModelError("HTTP 404: no model «ü模»")) == "HTTP 404: no model «ü模»"
    assert str(ModelError("a\x1b[2Jb\u202ec")) == "a [2Jb c"
