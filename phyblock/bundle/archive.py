"""The file of a bundle: a ZIP archive of three members, the same bytes for the same contents.

Whoever sends a bundle may mean harm. Members are known by name, each once; nothing is ever written
under a name or with a mode that the archive says, and no member is larger than its bound or than
what it is packed in can honestly hold.
"""

from __future__ import annotations

import io
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from phyblock.errors import Problem, StoreError, reason_of
from phyblock.files import open_regular
from phyblock.records.files import RECORDS
from phyblock.records.manifest import MANIFEST

__all__ = ["ABOUT", "MEMBERS", "pack", "unpack"]

ABOUT = "bundle.json"
_MB = 1024 * 1024
MEMBERS = {ABOUT: 4 * _MB, MANIFEST: 2 * _MB, RECORDS: 512 * _MB}
"""Members in their order, with their largest sizes [bytes]."""

_LARGEST_BYTES = 512 * _MB
_MOST_PACKED = 100
"""How many times smaller a member may be than what it holds, above `_FREE_BYTES`: records of rules,
which all read alike, are 26 times smaller.
"""
_FREE_BYTES = 16 * _MB
_DATE = (1980, 1, 1, 0, 0, 0)
_UNIX, _MODE = 3, 0o644
_LEVEL = 9
_ENCRYPTED = 0x1
_WAYS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_CHUNK_BYTES = _MB

_END = struct.Struct("<4s4H2LH")
"""The record at the end of an archive: where its list of members is, and how long."""
_END_MARK, _BIG_MARK, _BIG_BYTES = b"PK\5\6", b"PK\6\7", 20
_MOST_LISTED, _LONGEST_LIST_BYTES = 64, 64 * 1024

_NOT = "is no bundle"
_ALLOWED = f"a file that phyblock bundle wrote: {', '.join(MEMBERS)}"
_HINT = "ask for the bundle again, or make it again with phyblock bundle"


def pack(contents: Mapping[str, bytes]) -> bytes:
    """An archive of all `MEMBERS`; the bytes depend on the contents and zlib alone.

    Raises StoreError for a member that is too large to be read again.
    """
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", allowZip64=False) as archive:
        for name, most in MEMBERS.items():
            if len(contents[name]) > most:
                raise StoreError(Problem(name, f"is larger than {most // _MB:,} MB"))
            info = zipfile.ZipInfo(name, _DATE)
            info.compress_type, info.create_system = zipfile.ZIP_DEFLATED, _UNIX
            info.external_attr = (stat.S_IFREG | _MODE) << 16
            archive.writestr(info, contents[name], compresslevel=_LEVEL)
    return file.getvalue()


def unpack(path: Path, folder: Path) -> None:
    """Write the members of the bundle at `path` into `folder`.

    Raises StoreError, which says what is wrong, for anything that is not such an archive.
    """
    try:
        with open_regular(path) as file:
            _check_end(path, file)
            with zipfile.ZipFile(file) as archive:
                infos = archive.infolist()
                _check_members(path, infos)
                for info in infos:
                    _write(path, archive, info, folder / info.filename)
    except FileNotFoundError as error:
        raise StoreError(Problem(str(path), "is not there")) from error
    except (zipfile.BadZipFile, zlib.error, struct.error, EOFError) as error:
        raise _refused(path, f"{_NOT}, or it is damaged: {reason_of(error)}") from error
    except (OSError, ValueError, NotImplementedError, RuntimeError) as error:
        raise _refused(path, f"cannot be read: {reason_of(error)}") from error


def _check_end(path: Path, file: BinaryIO) -> None:
    """Bound what the archive says of its list of members, before anything reads that list."""
    size = file.seek(0, os.SEEK_END)
    if size > _LARGEST_BYTES:
        raise _refused(path, f"is larger than {_LARGEST_BYTES // _MB:,} MB")
    file.seek(max(0, size - _END.size - _BIG_BYTES))
    tail = file.read()
    if len(tail) < _END.size or not tail[-_END.size :].startswith(_END_MARK):
        message = f"{_NOT}, or it is cut short: it does not end as a ZIP archive of ours does"
        raise _refused(path, message)
    _, _, _, _, listed, list_bytes, _, _ = _END.unpack(tail[-_END.size :])
    if tail.startswith(_BIG_MARK) or listed > _MOST_LISTED or list_bytes > _LONGEST_LIST_BYTES:
        raise _refused(path, f"{_NOT}: it lists more members than a bundle has")
    file.seek(0)


def _check_members(path: Path, infos: list[zipfile.ZipInfo]) -> None:
    names = [info.filename for info in infos]
    for info in infos:
        where = info.filename
        mode = info.external_attr >> 16
        packed = max(info.compress_size, 1)
        if where not in MEMBERS:
            raise _refused(path, f"{_NOT}: it has a member of another name", where)
        if names.count(where) > 1:
            raise _refused(path, f"{_NOT}: it has a member twice", where)
        if mode and not stat.S_ISREG(mode):
            raise _refused(path, f"{_NOT}: a member is a link or the like", where)
        if info.flag_bits & _ENCRYPTED or info.compress_type not in _WAYS:
            raise _refused(path, f"{_NOT}: a member is packed in a way that is not taken", where)
        if info.file_size > MEMBERS[where]:
            most = f"at most {MEMBERS[where] // _MB:,} MB"
            raise _refused(path, f"has a member that is too large: {most} are taken", where)
        if info.file_size > _FREE_BYTES and info.file_size > _MOST_PACKED * packed:
            raise _refused(path, "has a member that would unpack to far more than it holds", where)
    if missing := [name for name in MEMBERS if name not in names]:
        raise _refused(path, f"{_NOT}: it lacks {', '.join(missing)}")


def _write(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, target: Path) -> None:
    # The sizes were said by the archive: no more is written, whatever comes.
    left = info.file_size
    with archive.open(info) as packed, target.open("xb") as out:
        while chunk := packed.read(_CHUNK_BYTES):
            left -= len(chunk)
            if left < 0:
                raise _refused(path, "has a member that is larger than it says", info.filename)
            out.write(chunk)
    if left:
        raise _refused(path, "has a member that is shorter than it says", info.filename)


def _refused(path: Path, message: str, found: str = "") -> StoreError:
    return StoreError(Problem(str(path), message, "", found, _ALLOWED, _HINT))
