"""Bodies in pieces: read whole where they are in order, never beyond the limit, else refused."""

from __future__ import annotations

import gzip
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.models.unpacking import BodyReader


def raw_deflate(data: bytes) -> bytes:
    packer = zlib.compressobj(wbits=-zlib.MAX_WBITS)
    return packer.compress(data) + packer.flush()


PACKERS = {
    "": lambda data: data,
    "identity": lambda data: data,
    "gzip": gzip.compress,
    "x-gzip": lambda data: gzip.compress(data[:7]) + gzip.compress(data[7:]),
    "deflate": zlib.compress,
    " Deflate ": raw_deflate,
}


def read(encoding: str, body: bytes, sizes: list[int], most_bytes: int) -> bytes:
    reader = BodyReader(encoding, most_bytes)
    for size in sizes:
        reader.add(body[:size])
        body = body[size:]
    reader.add(body)
    return reader.body()


@given(
    st.sampled_from(sorted(PACKERS)),
    st.binary(max_size=300).map(lambda data: data * 7),
    st.lists(st.integers(0, 50), max_size=20),
)
def test_a_body_is_the_same_however_it_arrives(
    encoding: str, data: bytes, sizes: list[int]
) -> None:
    assert read(encoding, PACKERS[encoding](data), sizes, 10_000) == data


@given(st.sampled_from(sorted(PACKERS)), st.integers(1_000, 3_000), st.integers(1, 4_000))
def test_no_more_than_the_limit_is_unpacked(encoding: str, most_bytes: int, extra: int) -> None:
    body = PACKERS[encoding](bytes(most_bytes))
    assert len(read(encoding, body, [500], max(most_bytes, len(body)))) == most_bytes
    with pytest.raises(ValueError, match="is larger than"):
        read(encoding, PACKERS[encoding](bytes(most_bytes + extra)), [500], most_bytes)


@given(st.sampled_from(["gzip", "deflate", ""]), st.binary(max_size=300))
def test_any_bytes_are_a_body_or_refused_in_words(encoding: str, data: bytes) -> None:
    try:
        body = read(encoding, data, [], 1_000)
    except ValueError as error:
        words = str(error)
    else:
        words = "is whole"
        assert len(body) <= 1_000
    assert words.startswith(("is ", "breaks "))


@pytest.mark.parametrize("encoding", ["br", "zstd", "gzip, gzip", "compress", "\ud800"])
def test_an_encoding_that_was_not_asked_for_is_refused(encoding: str) -> None:
    with pytest.raises(ValueError, match="not asked for"):
        BodyReader(encoding, 1_000)
