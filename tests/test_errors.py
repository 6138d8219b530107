"""What an error says."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import ModelError


@given(st.text())
def test_what_a_server_says_steers_no_terminal(message: str) -> None:
    assert str(ModelError(message)).isprintable()
