"""Addresses of servers: what may be one, and what of one may be shown.

An address stands in run folders, in the reply cache and in messages. So it may hold nothing that is
worth hiding, and no fault of one is ever described by showing it.
"""

from __future__ import annotations

import ipaddress
import re
import urllib.parse
from dataclasses import dataclass

__all__ = ["AddressFault", "address_fault", "host_of"]

_LONGEST = 1_000
_EXAMPLE = "for example http://localhost:8000/v1"
_BY_VARIABLE = "put the key alone into an environment variable and name that in api_key_env"


@dataclass(frozen=True)
class AddressFault:
    """Why an address is refused, what to do about it, and whether a secret may stand in it."""

    message: str
    hint: str
    may_hold_secret: bool


def address_fault(url: str) -> AddressFault | None:
    """Why this is no address that a model can be called at; None when it is one."""
    scheme, mark, rest = url.partition("://")
    host = re.split(r"[/?#\\]", rest if mark else url, maxsplit=1)[0]
    if "@" in host:
        return AddressFault("holds a user name or a password", _BY_VARIABLE, may_hold_secret=True)
    if "?" in url or "#" in url:
        message = "holds a query or a fragment, where keys are often written"
        return AddressFault(message, _BY_VARIABLE, may_hold_secret=True)
    if not mark or scheme.lower() not in ("http", "https"):
        message = "is not the address of a server"
    elif len(url) > _LONGEST or "\\" in url or any(not "!" <= c <= "~" for c in rest[len(host) :]):
        message = "is too long, or holds characters that must be escaped in an address"
    elif not _is_host(host):
        message = "names no host, or one that cannot be read"
    else:
        return None
    return AddressFault(message, _EXAMPLE, may_hold_secret="@" in url)


def host_of(url: str) -> str:
    """Host and port alone; "an unreadable address" where there are none."""
    try:
        parts = urllib.parse.urlsplit(url)
        host, port = parts.hostname or "", parts.port
    except ValueError:
        return "an unreadable address"
    if not host:
        return "an unreadable address"
    shown = f"[{host}]" if ":" in host else host
    return shown if port is None else f"{shown}:{port}"


def _is_host(host: str) -> bool:
    """Whether `host` is a name or an IP address, with or without a port."""
    if any(character.isspace() or not character.isprintable() for character in host):
        return False
    try:
        parts = urllib.parse.urlsplit(f"//{host}")
        name = parts.hostname or ""
        if parts.port == 0:
            return False
        if host.startswith("[") or ":" in name:
            return ipaddress.ip_address(name.partition("%")[0]).version == 6
        return len(name.encode("idna")) > 0
    except ValueError:  # UnicodeError, of a label that is empty or too long, is one
        return False
