"""Bad and nearly sound inputs of every kind a user gives, drawn for hypothesis.

Each strategy gives the bytes of one file, or a text for `--set`. Most begin with something sound
and break it in one or two places, as people and disks do; some are plain noise. The amount and the
seed of fuzzing are set by environment variables, as `make fuzz` does.
"""

import io
import json
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from typing import Any

from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from PIL import Image

from phyblock.types import BACKGROUNDS
from tests.data.broken import with_value, without
from tests.workspace import tower

SEED = int(os.environ.get("PHYBLOCK_FUZZ_SEED", "0"))
INPUTS = int(os.environ.get("PHYBLOCK_FUZZ_INPUTS", "60"))
"""Bad inputs that are tried, over all kinds."""
FAULTS = int(os.environ.get("PHYBLOCK_FUZZ_FAULTS", "40"))
"""Faults of servers that runs meet, over all tracks and transports."""
KILLS = int(os.environ.get("PHYBLOCK_FUZZ_KILLS", "6"))
"""Kills of runs, over all tracks."""


def fuzzed(percent: float) -> Callable[[Any], Any]:
    """Draw this share of all inputs for a test, the same ones for the same seed. Nothing is shrunk:
    a command that hangs would be tried again and again.
    """
    chosen = settings(
        max_examples=max(1, round(INPUTS * percent / 100)),
        deadline=None,
        database=None,
        derandomize=False,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )
    return lambda test: seed(SEED)(chosen(test))


_VALUES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)


def documents(*keys: str, leaves: st.SearchStrategy[Any] = _VALUES) -> st.SearchStrategy[Any]:
    """Documents of JSON whose objects have these keys; numbers may be infinite or none."""

    def grown(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
        objects = st.dictionaries(st.sampled_from(keys), inner, max_size=5)
        return st.lists(inner, max_size=3) | objects

    return st.recursive(leaves, grown, max_leaves=12)


# Texts that stand in JSON or YAML where a value belongs; not all of them are JSON or YAML.
JSON_TOKENS = (
    *("null", "true", "-1", "0", "1e308", "-1e308", "1e999", "NaN", "-Infinity", "-0.0", "5e-324"),
    *("9" * 25, "9" * 400, "9" * 6000, "-" + "9" * 6000, "0." + "3" * 5000),
    *('""', '"a"', '"\\u0000"', '"\\ud800"', '"\\u202e\\u001b[31m"', '"' + "x" * 5000 + '"'),
    *('"../../etc/passwd"', '"/dev/stdin"', '"' + "d/" * 3000 + '"', '"=1+1"', '"<img1>"'),
    *("[]", "{}", "[[[]]]", "[" * 80 + "]" * 80, "[" * 9000 + "]" * 9000, '{"a": 1, "a": 2}'),
    *("[" + "0, " * 3000 + "0]", "{" + ", ".join(f'"k{i}": 0' for i in range(3000)) + "}"),
    *("", "[", '"', "}", "\\", "\x00", "'x'", "1 2", "// no"),
)
NASTY_TOKENS = (
    *JSON_TOKENS,
    *("0x" + "f" * 6000, "0o" + "7" * 6000, "1:30:30", "190:20:30.15", ".nan", "-.inf", "~", "<<"),
    *("*none", "&a [*a]", "!!python/object:os.system x", "!mine x", "!!binary eA==", "!!set {a}"),
    *("[&a 1, *a, *a]", "{<<: 5}", "{? [a]: 1}", "|\n  x", ">-\n x", "%x", "@x", "`", "\t- 1"),
    *("$HOME", "~nobody/x", "$NOWHERE", "'" + "x" * 3000 + "'", "'\x85'", "---\na: 1", "...\n"),
)


def _places(value: object, path: tuple[str | int, ...] = ()) -> Iterator[tuple[Any, object]]:
    """Every value in a document, with its path."""
    yield path, value
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _places(inner, (*path, key))


@st.composite
def broken(draw: st.DrawFn, documents: st.SearchStrategy[Any], tokens: tuple[str, ...]) -> bytes:
    """A document as JSON text with one value replaced by a token, left out, renamed or cut."""
    document = draw(documents)
    places = list(_places(document))
    path, _ = draw(st.sampled_from(places))
    how = draw(st.sampled_from(["token", "token", "token", "gone", "key", "cut", "bytes", "sound"]))
    if how == "gone" and path:
        document = without(document, path)
    elif how == "key":
        if mappings := [path for path, value in places if isinstance(value, dict)]:
            name = draw(st.sampled_from(["no", "id ", "é", "a.b", "\x1b[1m", "<<", "x" * 2000]))
            document = with_value(document, (*draw(st.sampled_from(mappings)), name), 1)
    elif how == "token":
        document = with_value(document, path, "@@here@@")
    text = json.dumps(document)
    if how == "token":
        text = text.replace('"@@here@@"', draw(st.sampled_from(tokens)))
    data = text.encode("utf-8", "surrogatepass")
    if how == "cut":
        data = data[: draw(st.integers(0, len(data)))]
    elif how == "bytes":
        at = draw(st.integers(0, len(data)))
        data = data[:at] + draw(st.binary(min_size=1, max_size=4)) + data[at:]
    return data


NOISE = st.binary(max_size=200) | st.text(max_size=200).map(
    lambda text: text.encode("utf-8", "surrogatepass")
)

NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9._:+-]{0,20}", fullmatch=True)
LINES = st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufeff"))


def _some(*items: Any) -> st.SearchStrategy[list[Any]]:
    return st.lists(st.sampled_from(items), min_size=1, unique=True)


def _numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_subnormal=False)


SECTIONS: dict[str, dict[str, st.SearchStrategy[Any]]] = {
    "images": {
        "source": st.just("render"),
        "layout": st.sampled_from(["composite", "separate"]),
        "order": st.permutations(["goal", "candidates"]),
        "size_px": st.integers(128, 2048),
        "background": st.sampled_from(BACKGROUNDS),
    },
    "scoring": {
        "matchers": _some("optimal", "paper"),
        "level1": st.sampled_from(["selection", "membership", "aov"]),
        "missing": st.sampled_from(["count", "skip"]),
    },
    "sampling": {
        "temperature": st.none() | _numbers(0, 2) | st.integers(0, 2),
        "top_p": st.none() | _numbers(1e-9, 1),
        "max_tokens": st.none() | st.integers(1, 10**6),
    },
    "limits": {
        "max_concurrency": st.integers(1, 1000),
        "max_attempts": st.integers(1, 100),
        "retry_for_s": _numbers(0, 1e9),
        "timeout_s": _numbers(1e-3, 1e9),
        "max_cost_usd": st.none() | _numbers(0, 1e9),
    },
}
FIELDS: dict[str, st.SearchStrategy[Any]] = {
    "description": LINES,
    "tracks": st.just(["full_planning"]),
    "dataset": st.fixed_dictionaries(
        {}, optional={"format": st.just("builtin"), "path": st.sampled_from([None, "."])}
    ),
    "levels": _some(1, 2, 3, 4),
    "settings": _some("A", "B"),
    "seeds": st.lists(st.integers(0, 2**31 - 1), min_size=1, max_size=4, unique=True),
    "prompt": st.just("default"),
    "parser": st.sampled_from(["steps", "official"]),
    "answer_format": st.sampled_from(["text", "json_schema"]),
    **{name: st.fixed_dictionaries({}, optional=fields) for name, fields in SECTIONS.items()},
}
REQUIRED: dict[str, st.SearchStrategy[Any]] = {
    "name": st.from_regex(r"[a-z0-9][a-z0-9-]{0,20}", fullmatch=True),
    "models": st.lists(NAMES, min_size=1, max_size=4, unique=True),
}

SOUND_SUITES = st.fixed_dictionaries(REQUIRED, optional=FIELDS).map(
    lambda raw: raw if raw.get("answer_format") != "json_schema" else {**raw, "parser": "steps"}
)
"""Mappings that are valid suites with the built-in format."""

SUITES = broken(SOUND_SUITES, NASTY_TOKENS) | NOISE

_SOUND_MODELS = {
    "plain": "openai/gpt-4o-2024-08-06",
    "local": {
        "id": "hosted_vllm/qwen",
        "api_base": "http://localhost:8000/v1",
        "max_tokens": 512,
        "extra_body": {"top_k": 1, "deep": {"er": [1, 2.5, "x"]}},
        "price": {"input": 1.0, "output": 2.0},
        "timeout_s": 30,
    },
    "old": {"replay": "replies", "size_b": 7},
}
MODELS_FILES = broken(st.just(_SOUND_MODELS), NASTY_TOKENS) | NOISE

_SOUND_SCENE = tower("t1", [1, 2], ("red", "blue"))
SCENES = broken(st.just(_SOUND_SCENE), JSON_TOKENS) | NOISE

_SOUND_CANDIDATES = [{**one, "position": n} for n, one in enumerate(_SOUND_SCENE["candidates"], 1)]
CANDIDATES = broken(st.just(_SOUND_CANDIDATES), JSON_TOKENS) | NOISE


def sound_question(scene_id: str = "t1") -> dict[str, Any]:
    """A question about a scene of two blocks, every field of a recipe in it."""
    picture = {
        "label": "scene",
        "view": [45.0, 22.0],
        "without": [2],
        "poses": {"1": {"position": [0, 0, 0.02], "euler": [0, 0, 0]}},
        "swap": {"1": {"type": "cube", "color": "blue"}},
        "marks": [{"letter": "A", "position": [0, 0, 0.1]}],
        "framed": True,
    }
    return {
        "id": "q1",
        "subtask": "CO",
        "scene_id": scene_id,
        "wording": "plain",
        "question": "How many blocks are red?",
        "options": ["1", "2", "3", "4"],
        "answer": "A",
        "colors": {"1": "green"},
        "pictures": [picture],
        "evidence": {"count": 1, "orders": [1]},
    }


QUESTIONS = broken(st.just(sound_question()), JSON_TOKENS) | NOISE

_PIECES = (
    *("{{", "}}", "{%", "%}", "{#", "#}", "\n", " ", "x", "1", "'a'", "|", ".", "(", ")", "[", "]"),
    *("{% for i in range(9) %}", "{% endfor %}", "{% if n %}", "{% endif %}", "{{ i }}"),
    *("{% macro m(n) %}", "{{ m(n) }}", "{% endmacro %}", "{% set x = x ~ x %}", "{{ x * 9 }}"),
    *("{{ 'x'|center(9) }}", "{{ '%9d' % 1 }}", "{{ 9 ** 9 }}", "{{ '{:>9}'.format(1) }}"),
    *("{{ n_candidates }}", "{{ pictures | join(', ') }}"),
    *("{{ self.user() }}", "{% set x = [x, x] %}", "{{ x }}", "{% raw %}", "{% include 'x' %}"),
    *("{% set x = 'xxxxxxxxxx' %}", "{{ ''.join(x) }}", "{{ x.__class__ }}", "{{ 1 // 0 }}"),
)
TEMPLATES = (
    st.lists(st.sampled_from(_PIECES), max_size=12).map(
        lambda pieces: f"{{% block user %}}{''.join(pieces)}{{% endblock %}}".encode()
    )
    | NOISE
)


def png_header(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds next to nothing."""
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(b"\0" * 8)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(name, body) for name, body in chunks)


def chunk(name: bytes, body: bytes) -> bytes:
    """A chunk of a PNG."""
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def encoded(format_name: str, size: tuple[int, int] = (64, 32)) -> bytes:
    """A picture of this format."""
    buffer = io.BytesIO()
    Image.linear_gradient("L").resize(size).convert("RGB").save(buffer, format_name)
    return buffer.getvalue()


@st.composite
def _damaged(draw: st.DrawFn) -> bytes:
    data = bytearray(encoded(draw(st.sampled_from(["PNG", "JPEG", "GIF", "WEBP", "BMP", "TIFF"]))))
    for _ in range(draw(st.integers(0, 3))):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    return bytes(data[: draw(st.integers(1, len(data)))] if draw(st.booleans()) else data)


PICTURES = (
    _damaged()
    | st.builds(png_header, st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
    | st.sampled_from(
        [b"", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", b"<svg/>", b"GIF89a", b"RIFF"]
    )
    | NOISE
)

_KEYS = ("seeds", "images.size_px", "name", "limits.a.b", "", ".", "a" * 500, "x." * 200 + "x")
OVERRIDES = st.builds(
    lambda key, equals, value: f"{key}{equals}{value}".replace("\0", ""),
    st.sampled_from(_KEYS),
    st.sampled_from(["=", "=", "=", "", ":"]),
    st.sampled_from(NASTY_TOKENS) | st.text(st.characters(exclude_categories=["Cs"]), max_size=20),
)
