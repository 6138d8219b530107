"""The server of a session's page: only on the loopback address, behind a token, for its own pages.

Hosts other than 127.0.0.1 and localhost are refused, so that foreign names of this machine have no
access; changes must come from a page of this address. It serves memory and given files, and writes
nothing. A browser gets an address that works once: others can read command lines.
"""

from __future__ import annotations

import json
import mimetypes
import os
import re
import secrets
import sys
import threading
from collections.abc import Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer
from typing import Any
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict

from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import load_json
from phyblock.tracks.base import Pick
from phyblock.web.pack import asset
from phyblock.web.session import NotNowError, PlaySession

_PAGE = {
    "": ("play.html", "text/html"),
    "style.css": ("style.css", "text/css"),
    "icon.svg": ("icon.svg", "image/svg+xml"),
    **{name: (name, "text/javascript") for name in ("dom.js", "picker.js", "play.js")},
}
"""Files of the page and their types, by their names below the address."""
HOST = "127.0.0.1"
LARGEST_BODY_BYTES = 16 * 1024  # Limit of a request; an answer has a few hundred bytes.
_WAIT_S = 15.0
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
_USED = (
    b"This address opens the page once, and was opened already. Open the one in the terminal. "
    b"If it was not you who opened it, end the session with Ctrl-C and give the command again."
)
_STATE = re.compile(r"(?:after=(\d{1,9}))?")
_PICTURE = re.compile(r"picture/(\d{1,9})/(\d{1,3})")


class Server(ThreadingHTTPServer):
    """A server of one session until it is closed; a context manager.

    `address` is for a browser, with a token that nobody can guess; `one_time_address` redirects to
    it the first time it is opened, and never again. `files` are served too, by their names below
    it. The page sets `finished` when the person is done. Raises SpecError for a taken port.
    """

    daemon_threads = True
    # The same command can reuse the port at once; on Windows, two servers could then share one.
    allow_reuse_address = os.name == "posix"

    def __init__(self, session: PlaySession, port: int = 0) -> None:
        self.session, self.finished = session, threading.Event()
        self.files: Mapping[str, Path] = {}
        self.page, self.once = (f"/{secrets.token_urlsafe(24)}/" for _ in range(2))
        self.is_once_used = threading.Lock()
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            problem = Problem("--port", f"cannot be used: {reason_of(error)}", found=str(port))
            raise SpecError(problem) from error
        self.hosts = (f"{HOST}:{self.server_port}", f"localhost:{self.server_port}")
        self.address = f"http://{self.hosts[0]}{self.page}"
        self.one_time_address = f"http://{self.hosts[0]}{self.once}"

    def __enter__(self) -> Server:
        threading.Thread(target=self.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self.server_close()

    def server_bind(self) -> None:
        """Bind without a lookup of the machine's name, which may take long."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self.server_address[:2]  # type: ignore[assignment]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a page that was closed or reloaded during an answer."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


class _Answer(BaseModel):
    """An answer from the page: picks, and the numbers of each if they have some."""

    model_config = ConfigDict(strict=True)
    change: int
    picks: list[int]
    numbers: list[list[int | float]] = []


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = 30.0
    protocol_version = "HTTP/1.1"
    server_version = "phyblock"
    sys_version = ""

    def do_GET(self) -> None:
        """Send a file of the page, the state, a picture, or one of `files`."""
        if (asked := self._admitted(changes=False)) is None:
            return
        (name, query), session, files = asked, self.server.session, self.server.files
        if name in _PAGE:
            file, kind = _PAGE[name]
            self._send(200, kind, asset(file))
        elif name == "state" and (after := _STATE.fullmatch(query)):
            state = session.state(int(after[1] or -1), _WAIT_S)
            self._send(200, "application/json", json.dumps(state).encode())
        elif (at := _PICTURE.fullmatch(name)) and (
            shown := session.picture(*map(int, at.groups()))
        ):
            self._send(200, "image/png", shown.data)
        elif drawn := session.drawn(name):
            self._send(200, "image/png", drawn)
        elif name in files:
            kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
            # These have their own policy.
            self._send(200, kind, files[name].read_bytes(), "frame-ancestors 'none'")
        else:
            self._refuse(404)

    def do_POST(self) -> None:
        """Receive an answer, a pause, a beginning or an end."""
        if (asked := self._admitted(changes=True)) is None:
            return
        length, session = self.headers.get("Content-Length", ""), self.server.session
        actions = {"begin": session.begin, "pause": session.pause}
        actions["finish"] = self.server.finished.set
        if not length.isascii() or not length.isdigit():
            self._refuse(411)
        elif len(length) > 9 or int(length) > LARGEST_BODY_BYTES:
            self._refuse(413)
        elif (name := asked[0]) != "answer" and name not in actions:
            self._refuse(404)
        else:
            try:
                body = load_json(self.rfile.read(int(length)))
                if name in actions:
                    actions[name]()
                else:
                    given = _Answer.model_validate(body)
                    numbers = given.numbers or [[] for _ in given.picks]
                    pairs = zip(given.picks, map(tuple, numbers), strict=True)
                    session.answer(given.change, [Pick(*pair) for pair in pairs])
            except NotNowError:
                self._refuse(409)
            except ValueError as error:
                self._refuse(400, str(error).encode())
            else:
                self._send(200, "application/json", b"{}")

    def _admitted(self, *, changes: bool) -> tuple[str, str] | None:
        """Return the requested name and its query, or None if the request was refused."""
        try:
            split = urlsplit(self.path)
        except ValueError:
            self._refuse(400)
            return None
        hosts, origin = self.headers.get_all("Host", []), self.headers.get("Origin")
        origins = [f"http://{host}" for host in self.server.hosts]
        path, page, once = map(str.encode, (split.path, self.server.page, self.server.once))
        if split.netloc:
            # Full addresses are for proxies, and Python versions differ in which hosts they accept.
            self._refuse(404)
        elif len(hosts) != 1 or hosts[0] not in self.server.hosts:
            self._refuse(421)
        elif (origin is None and changes) or (origin is not None and origin not in origins):
            self._refuse(403)
        elif not changes and secrets.compare_digest(path, once):
            if self.server.is_once_used.acquire(blocking=False):
                self._send(303, "text/plain", b"", Location=self.server.page)
            else:
                self._refuse(410, _USED)
        elif not secrets.compare_digest(path[: len(page)], page):
            self._refuse(404)
        elif changes and self.headers.get("Content-Type") != "application/json":
            self._refuse(415)
        elif self.headers.get("Transfer-Encoding") is not None:
            self._refuse(411)
        else:
            return split.path[len(page) :], split.query
        return None

    def _refuse(self, status: int, why: bytes = b"") -> None:
        self.close_connection = True
        self._send(status, "text/plain", why)

    def _send(
        self, status: int, kind: str, content: bytes, policy: str = _POLICY, **more: str
    ) -> None:
        self.send_response(status)
        is_text = kind.startswith("text/") or kind.endswith(("json", "javascript"))
        more |= {"Content-Type": f"{kind}; charset=utf-8" if is_text else kind}
        more |= {"Content-Length": str(len(content)), "Content-Security-Policy": policy}
        if self.close_connection:
            more["Connection"] = "close"
        for name, value in {**_HEADERS, **more}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def send_error(self, code: int, *_: object, **__: object) -> None:
        """Refuse a malformed request like any other, without repeating any of it."""
        self._refuse(code)

    def log_message(self, *_: object) -> None:
        """Log nothing: the terminal belongs to the run."""
