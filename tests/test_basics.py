"""Root modules: texts that steer nothing, sums that are alike, worker processes."""

import builtins
import csv
import functools
import io
import math
import operator
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import ModelError, PhyblockError, StoreError
from phyblock.making.questions.guesses import text_features
from phyblock.results.text import to_csv
from phyblock.scoring.pose import PoseFit, overlap_volume
from phyblock.text import csv_cell, one_line, plain_sum
from phyblock.tracks.pose_planning import FITS
from phyblock.workers import Shards, open_workers
from tests.shipped import built_in_questions
from tests.sim.structures import block

STARTS = tuple("=+-@\t\r\n")
risky = st.text(alphabet="'=+-@\t\r\n1.a") | st.text()


@given(risky)
def test_no_cell_begins_a_formula_and_what_it_held_can_be_had_back(text):
    cell = csv_cell(text)
    if cell.startswith(STARTS):
        float(cell)
    # Taken back as docs/results.md says.
    is_marked = cell.startswith("'") and cell.lstrip("'").startswith(STARTS)
    assert (cell[1:] if is_marked else cell) == text


@given(st.lists(risky, min_size=1))
def test_a_table_is_read_back_row_by_row(texts):
    table = to_csv(pd.DataFrame({"text": texts, "n": 1}))
    _, *rows = csv.reader(io.StringIO(table, newline=""))
    assert rows == [[csv_cell(text), "1"] for text in texts]


@given(st.integers() | st.floats() | st.none())
def test_numbers_stay_numbers(value):
    assert csv_cell(value) is value
    text = str(value)
    assert csv_cell(text) == text or text == "-inf"


@given(st.text(alphabet=st.characters()))
def test_one_line_is_one_line_that_can_be_written(text):
    shown = one_line(text)
    assert len(shown) == len(text)
    assert shown.isprintable()
    shown.encode()


@given(st.text())
def test_what_a_server_says_steers_no_terminal(message):
    assert str(ModelError(message)).isprintable()


def rounding(values, /, start=0):
    """`sum` as it is before Python 3.12."""
    return functools.reduce(operator.add, values, start)


def compensating(values, /, start=0):
    """`sum` as it is from Python 3.12 on: nothing is lost of floats."""
    listed = list(values)
    if any(type(value) is float for value in listed):
        return math.fsum([start, *listed])
    return rounding(listed, start)


@given(st.lists(st.floats(-1e6, 1e6) | st.integers(-9, 9)))
def test_values_are_added_one_after_another(values):
    total = 0
    for value in values:
        total += value
    assert (plain_sum(values), type(plain_sum(values))) == (total, type(total))


def texts():
    """Features of options' texts, by which drafts are kept and the text probe answers."""
    tasks = built_in_questions().tasks[::5]
    return [text_features(task.question.text, task.question.options) for task in tasks]


def solids():
    """The overlap of two arches, which are three pieces each or more."""
    turns = ((7.0 * n, 11.0 * n, 13.0 * n) for n in range(5))
    moved = (block(1, "arch", (0.003, 0.003, 0.003), turn) for turn in turns)
    return [overlap_volume(block(1, "arch", (0.0, 0.0, 0.0)), one) for one in moved]


def fits():
    """Counts of how steps lie to goal blocks, as records hold them."""
    off = [PoseFit(n, 0.1 * n, 0.0, 0.0, 0.7 * n, 1 / (n + 1)) for n in range(30)]
    return [list(FITS.of(SimpleNamespace(pose=SimpleNamespace(steps=off[:n])))) for n in range(30)]


@pytest.mark.parametrize("compute", [texts, solids, fits])
def test_results_are_those_of_either_sum(compute, monkeypatch):
    computed = []
    for either in (rounding, compensating):
        with monkeypatch.context() as patched:
            patched.setattr(builtins, "sum", either)
            computed.append(compute())
    assert computed[0] == computed[1]


def die(_):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_job_that_is_killed_ends_the_command_with_a_message():
    killed = pytest.raises(PhyblockError, match="a worker process was killed")
    with killed, open_workers(2) as workers:
        list(workers.map(die, range(3)))


def late(number):
    """Return the square of a number; every third one is slow."""
    time.sleep(0.02 * (number % 3 == 0))
    return number * number


SQUARES = [number * number for number in range(150)]


@pytest.mark.parametrize(("jobs", "size"), [(1, 1), (2, 1), (2, 16)])
def test_answers_come_in_the_order_of_tasks(jobs, size):
    with open_workers(jobs, size=size) as workers:
        assert list(workers.map(late, iter(range(150)))) == SQUARES
        assert list(workers.map(late, [])) == []
        some = workers.map(late, range(10**9))
        assert [next(some) for _ in range(20)] == SQUARES[:20]


@pytest.mark.parametrize("at_once", [True, False])
def test_shards_end_alike_at_once_or_one_after_another_and_go_on(tmp_path, at_once):
    done = []

    def counted_square(number):
        done.append(number)
        return late(number)

    def shard(number):
        with open_workers(shards=Shards(tmp_path / "all.shards", number, 4, "squares")) as workers:
            return [list(workers.map(counted_square, range(n))) for n in (150, 1, 40)]

    with ThreadPoolExecutor(4 if at_once else 1) as threads:
        found = list(threads.map(shard, (3, 1, 4, 2)))
    assert found == [[SQUARES, SQUARES[:1], SQUARES[:40]]] * 4
    assert len(done) == 191
    done.clear()
    (tmp_path / "all.shards" / "0000-000003.pickle").unlink()
    assert shard(2) == found[0]
    assert done == list(range(48, 64))
    with pytest.raises(StoreError, match="is about other work"):
        Shards(tmp_path / "all.shards", 1, 4, "cubes")


def test_a_shard_computes_what_a_killed_one_has_begun(tmp_path):
    first, second = (Shards(tmp_path / "shards", number, 2, "work") for number in (1, 2))
    work = partial(killed_once, tmp_path / "mark")
    with pytest.raises(PhyblockError), open_workers(2, shards=first) as workers:
        list(workers.map(work, range(40)))
    with open_workers(shards=second) as workers:
        assert list(workers.map(work, range(40))) == list(range(40))


def test_a_batch_that_could_not_be_started_can_be_computed_by_another_shard(tmp_path):
    def broken(path):
        raise PhyblockError(f"no worker for {path.name}")

    # The error that is kept holds the frames that began, and with them what they have open.
    with pytest.raises(PhyblockError) as kept:
        Shards(tmp_path / "shards", 1, 1, "work").batch(0, 0, broken)
    with open_workers(shards=Shards(tmp_path / "shards", 1, 1, "work")) as workers:
        assert list(workers.map(str, range(3))) == ["0", "1", "2"]
    assert "0000-000000.pickle" in str(kept.value)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_of_a_cluster_loses_and_doubles_nothing(tmp_path):
    pytest.importorskip("ray", reason="Ray is not installed: pip install 'phyblock[ray]'")
    with open_workers(2, "local") as workers:
        work = partial(killed_once, tmp_path / "mark")
        assert list(workers.map(work, range(40))) == list(range(40))
        assert list(workers.map(late, range(150))) == SQUARES


def killed_once(mark, number):
    """Return the number, but kill the process of the first call with 37."""
    if number == 37 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_workers_end_with_the_process_that_started_them(sent, tmp_path):
    (tmp_path / "work.py").write_text(WORK, encoding="utf-8")
    words = [sys.executable, str(tmp_path / "work.py")]
    pipes = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    with subprocess.Popen(words, start_new_session=True, **pipes) as process:
        assert int(process.stdout.readline()) != int(process.stdout.readline())
        # Ctrl-C reaches the whole group, a kill one process alone.
        (os.killpg if sent == signal.SIGINT else os.kill)(process.pid, sent)
        # The workers hold the pipe open: it ends when they have.
        _, errors = process.communicate(timeout=30)
    assert process.returncode == (130 if sent == signal.SIGINT else -signal.SIGKILL)
    assert b"Traceback" not in errors


WORK = """
import os, sys, time
from phyblock.workers import open_workers

def stay(n):
    os.write(1, f"{os.getpid()}\\n".encode())
    time.sleep(60)

if __name__ == "__main__":
    try:
        with open_workers(2) as workers:
            list(workers.map(stay, range(99)))
    except KeyboardInterrupt:
        sys.exit(130)
"""
