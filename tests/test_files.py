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

from phyblock.errors import StoreError
from phyblock.files import atomic_write, write_named, writing


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


def test_what_the_disk_refuses_is_one_of_our_errors(tmp_path: Path) -> None:
    long = tmp_path / ("x" * 300)
    for path, said in ((long, "File name too long"), (tmp_path / "\ud800", "surrogates")):
        with pytest.raises(StoreError, match=f"cannot be written: .*{said}"), writing(path):
            path.write_text("text")
    with pytest.raises(StoreError, match="no words"), writing(tmp_path):
        raise OSError("no words")


def test_halves_of_characters_are_no_failure(tmp_path: Path) -> None:
    atomic_write(tmp_path / "file", "a\ud83db")
    assert (tmp_path / "file").read_text() == "a?b"


def test_a_named_file_is_written_through_the_link_that_a_person_made(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_named(tmp_path / "link", "text")
    write_named(tmp_path / "deep" / "file", "text")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == (tmp_path / "deep" / "file").read_text() == "text"


def test_a_device_is_never_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, said in ((tmp_path / "pipe", "no regular file"), (tmp_path, "a folder")):
        with pytest.raises(StoreError, match=said):
            write_named(path, "text")
    assert list(tmp_path.iterdir()) == [tmp_path / "pipe"]
    assert (tmp_path / "pipe").is_fifo()
