"""Golden runs are what they were; see tests/golden.py."""

import json

import pytest

from tests import golden
from tests.conftest import OFFICIAL_MISSING, official_root

GOLDEN = json.loads(golden.GOLDEN.read_text(encoding="utf-8"))
# A part of the longest runs is made each time.
SLOW = {name: pytest.param(name, marks=pytest.mark.slow) for name in ("quick", "pose")}


@pytest.mark.parametrize("name", [SLOW.get(name, name) for name in golden.RUNS])
def test_numbers_are_what_they_were(name, tmp_path, pictures_dir):
    if name == "paper-table1" and official_root() is None:
        pytest.skip(OFFICIAL_MISSING)
    now = golden.run_numbers(name, tmp_path, pictures_dir)
    # What a run has beyond its golden one is no difference.
    moved = {file: rows.items() - now[file].items() for file, rows in GOLDEN[name].items()}
    assert not any(moved.values()), moved


@pytest.mark.parametrize("name", golden.SUITES)
def test_requests_are_what_they_were(name, tmp_path, pictures_dir):
    assert golden.request_digests(name, tmp_path, pictures_dir) == GOLDEN["requests"][name]
