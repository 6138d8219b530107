"""Files are read within bounds, written whole, and never over what the user made."""

import contextlib
import json
import os
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import PngImagePlugin

from phyblock import files
from phyblock.errors import DataError, StoreError
from phyblock.files import LIST, OutFolder, open_picture, read_bytes, read_picture
from tests.config.test_yaml import TEXT, values
from tests.fuzz.strategies import PICTURES, chunk, encoded, png_header
from tests.workspace import problem_of


@given(st.binary() | st.text())
def test_what_is_written_is_read(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("files")
    path = folder / "file"
    path.write_text("before")
    files.atomic_write(path, data)
    assert path.read_bytes() == (data if isinstance(data, bytes) else data.encode())
    assert list(folder.iterdir()) == [path]


def test_what_cannot_be_replaced_stays_and_nothing_is_left_beside_it(tmp_path):
    (tmp_path / "folder" / "inside").mkdir(parents=True)
    with pytest.raises(OSError, match="folder"):
        files.atomic_write(tmp_path / "folder", b"data")
    assert list(tmp_path.iterdir()) == [tmp_path / "folder"]


def test_a_named_file_replaces_one_of_its_kind_and_nothing_else(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")
    (tmp_path / "empty").touch()
    (tmp_path / "gif").write_bytes(b"GIF89a old")
    for name in ("link", "deep/new", "empty", "gif"):
        files.write_named(tmp_path / name, iter([b"GIF89a", b" new"]))
        assert (tmp_path / name).read_bytes() == b"GIF89a new"
    assert (tmp_path / "link").is_symlink()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "notes").write_bytes(b"GI")
    before = sorted(tmp_path.rglob("*"))
    for path in (tmp_path / "pipe", tmp_path, tmp_path / "notes"):
        with pytest.raises(StoreError, match="of another kind"):
            files.write_named(path, b"GIF89a new")
    assert sorted(tmp_path.rglob("*")) == before
    assert ((tmp_path / "pipe").is_fifo(), (tmp_path / "notes").read_bytes()) == (True, b"GI")


@given(values(TEXT))
def test_json_of_ordinary_size_is_read_as_json_reads_it(value):
    assert files.load_json(json.dumps(value)) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 66 + "]" * 66, "nested"),
        ("[" * 100_000, "nested"),
        ('{"a":' * 100_000, "nested"),
        ("NaN", "NaN"),
        ("[-Infinity]", "-Infinity"),
        ("[1e999]", "outside the range"),
        ("1" * 400, "400 digits"),
        ("1" * 100_000, "digits"),
        ("{", "Expecting"),
    ],
)
def test_json_beyond_the_bounds_is_a_value_error(text, message):
    with pytest.raises(ValueError, match=message):
        files.load_json(text)


def test_only_files_are_read_and_up_to_the_limit(tmp_path):
    path, pipe = tmp_path / "file", tmp_path / "pipe"
    path.write_bytes(b"x" * 100)
    assert read_bytes(path, 100) == b"x" * 100
    with pytest.raises(ValueError, match="larger than"):
        read_bytes(path, 99)
    os.mkfifo(pipe)
    for device in (pipe, Path("/dev/zero")):
        with pytest.raises(ValueError, match="regular file"):
            read_bytes(device)
    with pytest.raises(IsADirectoryError):
        read_bytes(tmp_path)


def with_chunk(png, name, body):
    """The PNG with another chunk behind its header."""
    return png[:33] + chunk(name, body) + png[33:]


BOMB = zlib.compress(b"x" * (PngImagePlugin.MAX_TEXT_CHUNK + 1))
GOOD = {name: encoded(name) for name in ("PNG", "JPEG", "GIF", "WEBP")}
UNREADABLE = "is not a readable picture: "
BAD = {
    "eps": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 90 90\nshowpage\n", UNREADABLE),
    "bmp": (encoded("BMP"), UNREADABLE),
    "tiff": (encoded("TIFF"), UNREADABLE),
    "text": (b"no picture", UNREADABLE),
    "nothing": (b"", "an empty file"),
    "dot": (encoded("PNG", (1, 1)), "1 x 1 pixels"),
    "thin": (encoded("PNG", (64, 1)), "64 x 1 pixels"),
    "wide": (png_header(10_001, 8), "10,001 x 8 pixels"),
    "large": (png_header(8_000, 8_000), "8,000 x 8,000 pixels"),
    "bomb": (png_header(30_000, 30_000), "900000000 pixels"),
    "warned": (png_header(10_000, 10_000), "10,000 x 10,000 pixels"),
    "no-size": (png_header(0, 0), "pic.png"),
    "cut-png": (GOOD["PNG"][:-40], UNREADABLE),
    "cut-jpeg": (GOOD["JPEG"][: len(GOOD["JPEG"]) // 2], UNREADABLE),
    "cut-webp": (GOOD["WEBP"][: len(GOOD["WEBP"]) // 2], "pic.png"),
    "empty-data": (png_header(64, 64), "is not a readable picture: "),
    "text-bomb": (with_chunk(GOOD["PNG"], b"zTXt", b"a\0\0" + BOMB), "is not a readable picture: "),
    "unicode": (with_chunk(GOOD["PNG"], b"iTXt", b"a\0\1\0\0\0" + BOMB), "pic.png"),
    "crc": (GOOD["PNG"][:30] + b"\0" + GOOD["PNG"][31:], "pic.png"),
}


@pytest.mark.parametrize("format_name", GOOD)
def test_four_formats_are_read(format_name, tmp_path):
    path = tmp_path / "any.name"
    path.write_bytes(GOOD[format_name])
    assert read_picture(path) == GOOD[format_name]
    assert open_picture(GOOD[format_name], "x").size == (64, 32)


@pytest.mark.parametrize(("data", "told"), BAD.values(), ids=BAD)
def test_a_bad_picture_is_refused(data, told, tmp_path):
    path = tmp_path / "pic.png"
    path.write_bytes(data)
    problem = problem_of(DataError, read_picture, path)
    assert problem.where == str(path)
    assert told in str(problem)
    assert problem.allowed


@given(PICTURES)
def test_any_bytes_are_a_picture_or_a_data_error(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "pic"
    path.write_bytes(data)
    with contextlib.suppress(DataError):
        picture = open_picture(read_picture(path), "pic")
        assert 8 <= min(picture.size) <= max(picture.size) <= 10_000


NAMES = ("a.csv", "b.md", "tables/c.csv", "tables/deep/d.csv", "figures/e.svg")
some = st.sets(st.sampled_from(NAMES))


def contents(folder):
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != LIST)
    return {str(path.relative_to(folder)): path.read_text() for path in files}


def put(folder, names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("theirs")


@given(theirs=some, first=some, later=some)
def test_what_we_never_wrote_is_never_written_over(tmp_path_factory, theirs, first, later):
    folder = tmp_path_factory.mktemp("out")
    put(folder, theirs)
    for round_, names in enumerate((first, later, first)):
        before = contents(folder)
        texts = dict.fromkeys(sorted(names), f"ours {round_}")
        if names & theirs:
            with pytest.raises(StoreError) as caught:
                OutFolder(folder).write(texts)
            assert len(caught.value.problems) == len(names & theirs)
            assert contents(folder) == before
        else:
            OutFolder(folder).write(texts)
            assert contents(folder) == before | texts


def test_links_are_neither_followed_nor_replaced(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "file").write_text("theirs")
    out = tmp_path / "out"
    OutFolder(out).write({"c.csv": "ours"})
    (out / "c.csv").unlink()
    (out / "c.csv").symlink_to(tmp_path / "elsewhere" / "file")
    (out / "tables").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    with pytest.raises(StoreError) as caught:
        OutFolder(out).write({"tables/file": "ours", "tables/deep/x": "ours", "c.csv": "ours"})
    where = [problem.where for problem in caught.value.problems]
    assert where == [str(out / "tables"), str(out / "c.csv")]
    (out / LIST).unlink()
    (out / LIST).symlink_to(tmp_path / "elsewhere" / "file")
    for name, said in {"a": "it is a link", "../mine": "leads out", "/mine": "leads out"}.items():
        folder = OutFolder(out if name == "a" else tmp_path / "new")
        with pytest.raises(StoreError, match=said):
            folder.write({name: "ours"})
    assert not (tmp_path / "new").exists()
    assert contents(tmp_path / "elsewhere") == {"file": "theirs"}


def test_a_list_that_was_cut_short_is_no_failure(tmp_path):
    OutFolder(tmp_path).write({"a.csv": "1", "b.md": "1"})
    listed = (tmp_path / LIST).read_bytes()
    os.truncate(tmp_path / LIST, len(listed) - 3)
    with pytest.raises(StoreError, match=r"b\.md"):
        OutFolder(tmp_path).write({"b.md": "2", "c": "2"})
    OutFolder(tmp_path).write({"a.csv": "2", "c": "2"})
    OutFolder(tmp_path).write({"c": "3"})
    assert contents(tmp_path) == {"a.csv": "2", "b.md": "1", "c": "3"}


def test_only_what_is_ours_is_removed_and_folders_that_are_empty_then(tmp_path):
    out = OutFolder(tmp_path / "out")
    out.write({"a/b/one": "ours", "a/two": "ours", "c/three": "ours", "d/four": "ours"})
    (out.path / "c" / "theirs").write_text("mine")
    (out.path / "d" / "four").unlink()
    (out.path / "d").rmdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "four").write_text("mine")
    (out.path / "d").symlink_to(tmp_path / "elsewhere")
    assert out.names("a/") == ["a/b/one", "a/two"]
    out.remove(["a/b/one", "a/two", "c/three", "c/theirs", "d/four", "gone"])
    left = {path.relative_to(out.path).as_posix() for path in out.path.rglob("*")}
    assert left == {LIST, "c", "c/theirs", "d"}
    assert (tmp_path / "elsewhere" / "four").read_text() == "mine"


def make(out, name, failure=None):
    with out.making("deep/") as folder:
        (folder / "b").write_text("ours")
        (folder / name).write_text("ours")
        if failure is not None:
            raise failure


def test_files_that_are_made_together_come_together_or_not_at_all(tmp_path):
    out = OutFolder(tmp_path / "out")
    make(out, "a")
    put(out.path, {"deep/mine"})
    held = {"deep/a": "ours", "deep/b": "ours", "deep/mine": "theirs"}
    with pytest.raises(ValueError, match="stop"):
        make(out, "c", ValueError("stop"))
    with pytest.raises(StoreError, match="mine"):
        make(out, "mine")
    assert contents(out.path) == held
    assert sorted(path.name for path in out.path.iterdir()) == [LIST, "deep"]
