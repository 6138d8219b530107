"""Texts without what is of one machine: paths by their last part, no addresses of servers."""

from __future__ import annotations

import re
import urllib.parse
from collections.abc import Collection, Mapping
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

__all__ = ["Cleaner", "model_name", "without_paths"]

_SERVER = "SERVER"
_SENT = frozenset({"params", "sampling"})
"""Keys of what is sent to a model as it stands, where `/no_think` is a word."""
_PREFIX = re.compile(r"[\w.-]+/(?=/|~/|[A-Za-z]:[\\/])")
"""A provider before a model that is called by its path."""
_URL = re.compile(r"\b[A-Za-z][\w+.-]*://[^\s'\"<>)\]}]+")
_PLACE = re.compile(
    r"(?<![\w.-])(?:\d{1,3}(?:\.\d{1,3}){3}(?::\d+)?|\[[0-9A-Fa-f:]+\](?::\d+)?"
    r"|[A-Za-z][\w.-]*:\d{4,5})(?![\w.])"
)
"""An IP address, or any host with the port of a server."""
_PATH = re.compile(
    r"(?:(?<![\w.:/~])~?|(?<=\w/))/(?:[^\s/'\"]+/)+[^\s/'\":,;)\]]*"
    r"|(?<!\w)[A-Za-z]:\\(?:[^\s\\'\"]+\\)+[^\s\\'\":,;)\]]*"
)


def without_paths(value: Any) -> Any:
    """A JSON-able value with the last part of every text that is a path, but for what is sent."""
    if isinstance(value, str):
        return model_name(value)
    if isinstance(value, Mapping):
        return {
            key: below if key in _SENT else without_paths(below) for key, below in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [without_paths(below) for below in value]
    return value


def model_name(text: str) -> str:
    """A name, of a path its last part: `hosted_vllm//srv/models/Qwen` is `hosted_vllm/Qwen`."""
    prefix = match[0] if (match := _PREFIX.match(text)) else ""
    rest = text[len(prefix) :]
    return prefix + _last_part(rest) if _is_path(rest) else text


class Cleaner:
    """Takes paths and addresses out of what was said of a fault.

    `roots` are paths that may have blanks in them, `addresses` those of known servers.
    """

    def __init__(self, roots: Collection[str], addresses: Collection[str]) -> None:
        hosts = {urllib.parse.urlsplit(address).hostname or "" for address in addresses}
        self._hosts = sorted(hosts - {""}, key=len, reverse=True)
        self._roots = sorted(roots, key=len, reverse=True)

    def clean(self, text: str) -> str:
        """The text with `SERVER` for addresses, and the last part of every path."""
        text = _URL.sub(_SERVER, text)
        for root in self._roots:
            text = text.replace(root, _last_part(root))
        for host in self._hosts:
            text = re.sub(rf"(?<![\w.-]){re.escape(host)}(?::\d+)?(?![\w-])", _SERVER, text)
        text = _PLACE.sub(_SERVER, text)
        return _PATH.sub(lambda match: _last_part(match[0]), text)


def _is_path(text: str) -> bool:
    """Whether a text is a path below the root of a machine, or below somebody's home."""
    if "\n" in text:
        return False
    if text.startswith("/"):
        return len(PurePosixPath(text).parts) > len(("/", "name"))
    return text.startswith("~/") or PureWindowsPath(text).is_absolute()


def _last_part(text: str) -> str:
    return (PurePosixPath(text) if "/" in text else PureWindowsPath(text)).name
