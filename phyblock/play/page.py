"""The files that the page is made of, the same for a server and for a folder without one."""

from __future__ import annotations

from importlib.resources import files

__all__ = ["assets", "default_consent"]

_SHARED = (
    ("base.css", "phyblock.report.html"),
    ("dom.js", "phyblock.report.html"),
    ("play.css", "phyblock.play"),
    ("icon.svg", "phyblock.play"),
    ("picks.js", "phyblock.play"),
    ("fields.js", "phyblock.play"),
    ("picker.js", "phyblock.play"),
    ("results.js", "phyblock.play"),
    ("play.js", "phyblock.play"),
)
_KINDS = {"css": "text/css", "js": "text/javascript", "html": "text/html", "svg": "image/svg+xml"}


def assets(desk: str, name: str = "") -> dict[str, tuple[str, bytes]]:
    """Type and content of every file by name; `desk` is the script that brings questions and takes
    answers, the page itself is called `name`.
    """
    found = {one: _content(package, one) for one, package in _SHARED}
    found["desk.js"] = _content("phyblock.play", desk)
    found[name] = _content("phyblock.play", "page.html")
    return {
        one: (_KINDS[(one or "page.html").rpartition(".")[2]], data) for one, data in found.items()
    }


def default_consent(*, offline: bool) -> str:
    """The text that a person agrees to where a study brings none of its own.

    It says where answers are kept: by the server, or `offline` in the browser.
    """
    name = "consent-offline.txt" if offline else "consent.txt"
    return _content("phyblock.play", name).decode()


def _content(package: str, name: str) -> bytes:
    return (files(package) / "assets" / name).read_bytes()
