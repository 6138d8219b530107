"""Servers that count and bill as providers document it, written from their documents alone.

Pictures: OpenAI, guide to images and vision (patches of 32 pixels for its newest models, tiles of
512 for GPT-4o); Anthropic, vision guide (patches of 28 pixels, within 2576 pixels and 4,784
tokens); Google, media resolution guide (1,120 tokens a picture of Gemini 3). Texts: OpenAI by its
public vocabulary o200k and, of its cookbook, three tokens a message and three for the reply;
Anthropic by the vocabulary that litellm carries of it; Google by four characters a token.
"""

import base64
import functools
import importlib.util
import io
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import tiktoken
from PIL import Image
from tokenizers import Tokenizer

from tests.servers.chassis import LocalServer, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.servers.other_protocols import AnthropicMessages, GeminiGenerate

COMPLETION = 40
_LITELLM = importlib.util.find_spec("litellm")
_CARRIED = Path(str(_LITELLM.origin)).parent / "litellm_core_utils" / "tokenizers"


def tile_tokens(width: int, height: int) -> int:
    """A picture that is shown to GPT-4o: 85 tokens, and 170 for each tile of 512 pixels."""
    if max(width, height) > 2048:
        width, height = (side * 2048 // max(width, height) for side in (width, height))
    if min(width, height) > 768:
        width, height = (side * 768 // min(width, height) for side in (width, height))
    return 85 + 170 * (-(-width // 512)) * (-(-height // 512))


def patch_tokens(width: int, height: int) -> int:
    """A picture that is shown to GPT-5.6 in full: 1.2 tokens for each patch of 32 pixels."""
    patches = -(-width // 32) * -(-height // 32)
    assert patches <= 30_000, "the API would refuse it"
    return math.ceil(patches * 1.2)


def claude_tokens(width: int, height: int) -> int:
    """A picture that is shown to Claude: a token for each patch of 28 pixels, none to shrink."""
    assert max(width, height) <= 2576
    return -(-width // 28) * -(-height // 28)


@functools.cache
def _o200k() -> tiktoken.Encoding:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TIKTOKEN_CACHE_DIR", str(_CARRIED))
        return tiktoken.get_encoding("o200k_base")


@functools.cache
def _claude() -> Tokenizer:
    return Tokenizer.from_file(str(_CARRIED / "anthropic_tokenizer.json"))


def o200k_tokens(text: str) -> float:
    return len(_o200k().encode(text))


def _contents(body: object) -> Iterator[str | tuple[int, int]]:
    """Texts and sizes of pictures in a request body of any of the three protocols."""
    if isinstance(body, list):
        for item in body:
            yield from _contents(item)
    elif isinstance(body, dict):
        for name, value in body.items():
            if name in ("text", "content", "system") and isinstance(value, str):
                yield value
            elif name == "url":
                yield _size(value.partition(";base64,")[2])
            elif name == "data":
                yield _size(value)
            else:
                yield from _contents(value)


def _size(data: str) -> tuple[int, int]:
    return Image.open(io.BytesIO(base64.b64decode(data))).size


class Bill:
    """Counts every prompt as a provider does; `billed` has those of each sample."""

    def __init__(
        self,
        text_tokens: Callable[[str], float],
        picture_tokens: Callable[[int, int], int],
        a_message: int = 0,
    ) -> None:
        # Vocabularies are read here, not by the thread that serves: while it imports what reads
        # them, litellm finds that half imported.
        text_tokens("")
        self.billed: list[int] = []
        self._text_tokens, self._picture_tokens = text_tokens, picture_tokens
        self._a_message = a_message

    def __call__(self, seen: Seen) -> tuple[int, int]:
        parts = list(_contents({k: v for k, v in seen.raw.items() if k != "model"}))
        texts = sum(self._text_tokens(part) for part in parts if isinstance(part, str))
        pictures = sum(self._picture_tokens(*part) for part in parts if not isinstance(part, str))
        around = self._a_message * (len(seen.raw.get("messages", ())) + 1)
        self.billed.append(math.ceil(texts) + pictures + around)
        return self.billed[-1], COMPLETION


def _claude_texts(text: str) -> float:
    return len(_claude().encode(text).ids)


PROVIDERS: dict[str, tuple[type[LocalServer], Callable[[], Bill]]] = {
    "openai/gpt-4o-2024-08-06": (OpenAIChat, lambda: Bill(o200k_tokens, tile_tokens, 3)),
    "openai/gpt-5.6": (OpenAIChat, lambda: Bill(o200k_tokens, patch_tokens, 3)),
    "anthropic/claude-opus-5-5": (AnthropicMessages, lambda: Bill(_claude_texts, claude_tokens)),
    "gemini/gemini-3.8-flash": (
        GeminiGenerate,
        lambda: Bill(lambda text: len(text) / 4, lambda *_: 1120),
    ),
}
"""By model, a server of its protocol, and how its provider bills."""
