"""Addresses of servers: what may be one, and what of one may be shown.

An address stands in run folders, in the reply cache and in messages. So it may hold nothing that is
worth hiding, and no fault of one is ever described by showing it.
"""

from __future__ import annotations

import ipaddress
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
    host = rest.partition("/")[0]
    if "@" in url:
        return AddressFault("holds a user name or a password", _BY_VARIABLE, may_hold_secret=True)
    if "?" in url or "#" in url:
        message = "holds a query or a fragment, where keys are often written"
        return AddressFault(message, _BY_VARIABLE, may_hold_secret=True)
    if not mark or scheme.lower() not in ("http", "https"):
        return AddressFault("is not the address of a server", _EXAMPLE, may_hold_secret=False)
    if len(url) > _LONGEST or "\\" in url or any(c.isspace() or not c.isprintable() for c in url):
        message = "is too long for an address, or holds spaces or control characters"
        return AddressFault(message, _EXAMPLE, may_hold_secret=True)
    if not _is_host(host):
        message = "names no host, or one that cannot be read"
        return AddressFault(message, _EXAMPLE, may_hold_secret=False)
    return None


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
