"""Golden runs are what they were; see tests/golden.py."""

import json

import pytest

from tests import golden
from tests.conftest import OFFICIAL_MISSING, official_root

GOLDEN = json.loads(golden.GOLDEN.read_text(encoding="utf-8"))


# A part of the longest runs is made each time.
WHOLE = ("quick", "pose")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in WHOLE else ()) for n in golden.RUNS]
)
def test_numbers_are_what_they_were(name, tmp_path, pictures_dir):
    if name == "paper-table1" and official_root() is None:
        pytest.skip(OFFICIAL_MISSING)
    now = golden.run_numbers(name, tmp_path, pictures_dir)
    assert golden.compare(GOLDEN[name], now, name) == []


@pytest.mark.parametrize("name", golden.SUITES)
def test_requests_are_what_they_were(name, tmp_path, pictures_dir):
    now = golden.request_digests(name, tmp_path, pictures_dir)
    assert golden.compare(GOLDEN["requests"][name], now, name) == []


def test_a_difference_is_named():
    moved = {"estimates.csv": {"random": "1", "oracle": "2"}}
    found = golden.compare({"estimates.csv": {"random": "1", "oracle": "3", "x": "4"}}, moved, "r")
    assert found == ["r: estimates.csv: oracle: differs", "r: estimates.csv: x: is missing"]
