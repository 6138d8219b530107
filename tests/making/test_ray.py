"""The same tasks on a Ray cluster; needs the extra `phyblock[ray]`."""

from __future__ import annotations

import importlib.util
import re
import time
from collections.abc import Iterator

import psutil
import pytest

from phyblock.errors import InputError
from phyblock.making.scenes.production import Order, Share, produce
from phyblock.making.workers import open_workers

ORDER = Order(3, "kit", (Share("1", 3, 1), Share("2", 4, 2), Share("3", 2, 1)))
_IDLE = re.compile("IDLE|Agent")
HAS_RAY = importlib.util.find_spec("ray") is not None


def ray_workers() -> list[psutil.Process]:
    """Worker processes of the cluster that this test started."""
    found = []
    for process in psutil.Process().children(recursive=True):
        try:
            if process.name().startswith("ray::") and not _IDLE.search(process.name()):
                found.append(process)
        except psutil.NoSuchProcess:
            continue
    return found


def squares(workers, killed: list[int]) -> Iterator[int]:
    def slowly(task: int) -> int:
        time.sleep(0.2)
        return task * task

    for count, answer in enumerate(workers.map(slowly, range(30))):
        if count == 5:
            busy = ray_workers()
            assert busy
            killed.append(busy[0].pid)
            busy[0].kill()
        yield answer


@pytest.mark.slow
@pytest.mark.skipif(not HAS_RAY, reason="Ray is not installed: pip install 'phyblock[ray]'")
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_and_doubles_nothing() -> None:
    with open_workers() as workers:
        expected = list(produce(ORDER, workers))
    killed: list[int] = []
    with open_workers(2, "local") as workers:
        assert list(squares(workers, killed)) == [n * n for n in range(30)]
        assert len(killed) == 1
        found = []
        for scene in produce(ORDER, workers):
            found.append(scene)
            if len(found) == 5 and (busy := ray_workers()):
                killed.append(busy[0].pid)
                busy[0].kill()
    assert found == expected


@pytest.mark.skipif(HAS_RAY, reason="Ray is installed")
def test_without_ray_the_extra_is_named() -> None:
    with pytest.raises(InputError, match=r"phyblock\[ray\]"), open_workers(2, "local"):
        pass
