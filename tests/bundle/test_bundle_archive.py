"""The archive of a bundle, as a sender may have made it."""

from __future__ import annotations

import io
import random
import stat
import struct
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.bundle import MEMBERS, pack, unpack
from phyblock.errors import StoreError

CONTENTS = {name: f"{name} holds this\n".encode() * 50 for name in MEMBERS}
LESS = [(name, data) for name, data in CONTENTS.items() if name != "records.jsonl"]


def packed(contents: Mapping[str, bytes]) -> bytes:
    """A bundle of these members."""
    file = io.BytesIO()
    pack(file, {name: [data] for name, data in contents.items()})
    return file.getvalue()


SOUND = packed(CONTENTS)


def archive(*members: tuple[str | zipfile.ZipInfo, bytes]) -> bytes:
    file = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        warnings.simplefilter("ignore")
        for name, data in members:
            made.writestr(name, data)
    return file.getvalue()


def with_more(*members: tuple[str | zipfile.ZipInfo, bytes]) -> bytes:
    return archive(*CONTENTS.items(), *members)


def linked() -> bytes:
    info = zipfile.ZipInfo("run.yaml")
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    rest = [(name, data) for name, data in CONTENTS.items() if name != "run.yaml"]
    return archive(*rest, (info, b"/etc/passwd"))


def patched(data: bytes, old: bytes, new: bytes) -> bytes:
    assert old in data
    return data.replace(old, new)


def smaller_than_it_is() -> bytes:
    """The list of members says that one holds less than it does."""
    size = struct.pack("<L", len(CONTENTS["records.jsonl"]))
    return patched(SOUND, size, struct.pack("<L", 7))


def dense(size: int) -> bytes:
    """Bytes that are packed some 140 times smaller."""
    draws = random.Random(0)
    block = bytes(20_000)
    return b"".join(draws.randbytes(120) + block for _ in range(size // len(block)))


def encrypted() -> bytes:
    data = bytearray(SOUND)
    at = data.index(b"PK\1\2")
    data[at + 8] |= 1
    return bytes(data)


def listed(count: int) -> bytes:
    return archive(*((f"{n}", b"") for n in range(count)))


HOSTILE: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "text": lambda: b"hello\n" * 100,
    "out of the folder": lambda: with_more(("../../evil", b"x")),
    "absolute": lambda: with_more(("/tmp/evil", b"x")),
    "other name": lambda: with_more(("evil.py", b"x")),
    "folder": lambda: with_more(("run.yaml/", b"")),
    "twice": lambda: with_more(("records.jsonl", b"x")),
    "link": linked,
    "bomb": lambda: archive(*LESS, ("records.jsonl", bytes(40 * 2**20))),
    "dense": lambda: archive(*LESS, ("records.jsonl", dense(20 * 2**20))),
    "manifest too large": lambda: archive(("run.yaml", b"x" * (3 * 2**20))),
    "larger than it says": smaller_than_it_is,
    "encrypted": encrypted,
    "lacks one": lambda: archive(*LESS),
    "thousands": lambda: listed(70),
    "comment": lambda: SOUND[:-2] + b"\5\0hello",
    "lists too much": lambda: SOUND[:-10] + struct.pack("<L", 2**31) + SOUND[-6:],
    "large archive": lambda: SOUND[:-22] + b"PK\6\7" + bytes(16) + SOUND[-22:],
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_archive_is_refused_and_writes_nothing_elsewhere(
    tmp_path: Path, kind: str
) -> None:
    path, folder = tmp_path / "b.zip", tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    path.write_bytes(HOSTILE[kind]())
    with pytest.raises(StoreError) as caught:
        unpack(path, folder)
    assert str(path) in str(caught.value)
    written = {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()}
    assert written <= {"b.zip", *(f"a/b/c/{name}" for name in MEMBERS)}
    assert all(p.stat().st_size < 2**21 and not p.is_symlink() for p in folder.iterdir())


@settings(max_examples=30, deadline=None)
@given(length=st.integers(0, len(SOUND) - 1))
def test_a_bundle_that_was_cut_short_is_refused(
    tmp_path_factory: pytest.TempPathFactory, length: int
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    (folder / "b.zip").write_bytes(SOUND[:length])
    with pytest.raises(StoreError, match=r"b\.zip"):
        unpack(folder / "b.zip", folder)


@settings(max_examples=60, deadline=None)
@given(at=st.integers(0, len(SOUND) - 1), byte=st.integers(0, 255))
def test_a_byte_that_was_changed_is_refused_or_changes_nothing(
    tmp_path_factory: pytest.TempPathFactory, at: int, byte: int
) -> None:
    folder = tmp_path_factory.mktemp("changed")
    (folder / "b.zip").write_bytes(SOUND[:at] + bytes([byte]) + SOUND[at + 1 :])
    try:
        unpack(folder / "b.zip", folder)
    except StoreError:
        return
    assert {name: (folder / name).read_bytes() for name in MEMBERS} == CONTENTS


def test_what_is_packed_is_unpacked_and_is_the_same_whatever_the_order(tmp_path: Path) -> None:
    assert packed(dict(reversed(CONTENTS.items()))) == SOUND
    (tmp_path / "b.zip").write_bytes(SOUND)
    unpack(tmp_path / "b.zip", tmp_path)
    assert {name: (tmp_path / name).read_bytes() for name in MEMBERS} == CONTENTS


def test_what_another_program_packed_is_unpacked(tmp_path: Path) -> None:
    """Python's zipfile gives members no kind of file."""
    held = {name: name.encode() * 9 for name in MEMBERS}
    (tmp_path / "b.zip").write_bytes(archive(*held.items()))
    unpack(tmp_path / "b.zip", tmp_path)
    assert {name: (tmp_path / name).read_bytes() for name in MEMBERS} == held
