from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.files import atomic_write


@given(st.binary() | st.text())
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, data: bytes | str
) -> None:
    folder = tmp_path_factory.mktemp("files")
    path = folder / "file"
    path.write_text("before")
    atomic_write(path, data)
    assert path.read_bytes() == (data if isinstance(data, bytes) else data.encode())
    assert list(folder.iterdir()) == [path]


def test_the_file_may_be_read_by_whom_other_files_may(tmp_path: Path) -> None:
    atomic_write(tmp_path / "ours", "text")
    (tmp_path / "other").write_text("text")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_what_cannot_be_replaced_stays_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    (tmp_path / "folder" / "inside").mkdir(parents=True)
    with pytest.raises(OSError, match="folder"):
        atomic_write(tmp_path / "folder", b"data")
    assert list(tmp_path.iterdir()) == [tmp_path / "folder"]


def test_a_full_disk_leaves_the_file_of_before(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("before")
    code = (
        "import sys; from pathlib import Path; from phyblock.files import atomic_write\n"
        "try: atomic_write(Path(sys.argv[1]), bytes(100_000))\n"
        "except OSError: sys.exit(7)"
    )

    def almost_full() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    done = subprocess.run(
        [sys.executable, "-B", "-c", code, str(path)],
        preexec_fn=almost_full,
        cwd=Path(__file__).parents[1],
        env=os.environ,
    )
    assert done.returncode == 7
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
