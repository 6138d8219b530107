"""The key of every model here."""

from __future__ import annotations

import pytest

from tests.models.factory import KEY, KEY_VARIABLE


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, KEY)
