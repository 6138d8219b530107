"""The server of a session's page: on the loopback address alone, behind a token, for its own pages.

Names other than 127.0.0.1 and localhost are refused as hosts, so that no foreign name that is made
to mean this machine gets in; what changes anything must come from a page of this address. It reads
from memory and from files that were named to it, and writes nothing. A browser is started with an
address that leads on once: what stands on a command line can be read by others on the machine.
"""

from __future__ import annotations

import json
import mimetypes
import os
import re
import secrets
import sys
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer
from typing import Any
from urllib.parse import urlsplit

from pydantic import BaseModel, ConfigDict

from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import load_json
from phyblock.tracks.picking import Pick
from phyblock.web.pack import asset
from phyblock.web.session import NotNowError, PlaySession

_FILES = ("style.css", "icon.svg", "dom.js", "picker.js", "play.js")
_KINDS = {"css": "text/css", "js": "text/javascript", "html": "text/html", "svg": "image/svg+xml"}
HOST = "127.0.0.1"
LARGEST_BODY_BYTES = 16 * 1024
"""Of a request; an answer is some hundred bytes long."""
_WAIT_S = 15.0
_TIMEOUT_S = 30.0
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


def assets() -> dict[str, tuple[str, bytes]]:
    """Return type and content of every file of the page by name; the page itself has none."""
    found = {"": asset("play.html"), **{one: asset(one) for one in _FILES}}
    return {
        one: (_KINDS[(one or "play.html").rpartition(".")[2]], data) for one, data in found.items()
    }


class Server:
    """A server of one session until it is closed; a context manager.

    `address` is what a browser opens, with a token that nobody can guess; `one_time_address` leads
    on to it when it is opened first, and never again. `finished` is set by the page when the person
    is through. Raises SpecError for a port that is taken.
    """

    def __init__(self, session: PlaySession, port: int = 0) -> None:
        self.finished = threading.Event()
        self._session = session
        self._token, self._code = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
        self._code_used = threading.Lock()
        self._assets = assets()
        self._files: Mapping[str, Path] = {}
        handler = type("Handler", (_Handler,), {"server_of": self})
        try:
            self._http = _Listener((HOST, port), handler)
        except OSError as error:
            problem = Problem("--port", f"cannot be used: {reason_of(error)}", found=str(port))
            raise SpecError(problem) from error
        self.port = int(self._http.server_address[1])
        self.hosts = (f"{HOST}:{self.port}", f"localhost:{self.port}")
        self.address = f"http://{self.hosts[0]}/{self._token}/"
        self.one_time_address = f"http://{self.hosts[0]}/{self._code}/"
        self._thread = threading.Thread(target=self._http.serve_forever, daemon=True)

    def __enter__(self) -> Server:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._http.shutdown()
        self._http.server_close()

    def show_files(self, files: Mapping[str, Path]) -> None:
        """Serve these files too, by their names below the address."""
        self._files = dict(files)

    def below(self, path: str) -> str | None:
        """Return the rest of a path that begins with the token; None for any other."""
        token, slash, rest = path.removeprefix("/").partition("/")
        is_ours = secrets.compare_digest(token.encode(), self._token.encode()) and slash
        return rest if is_ours else None

    def is_code(self, path: str) -> bool:
        """True if this is the path of the one-time address."""
        return secrets.compare_digest(path.encode(), f"/{self._code}/".encode())

    def use_code(self) -> str | None:
        """Return the path of the page; None for all but the first who asks."""
        return f"/{self._token}/" if self._code_used.acquire(blocking=False) else None

    def get(self, name: str, query: str) -> tuple[str, bytes, str] | None:
        """Return type, content and policy of what stands under a name; None where nothing does."""
        if name in self._assets:
            return *self._assets[name], _POLICY
        if name == "state" and (asked := _STATE.fullmatch(query)):
            told = self._session.state(int(asked[1] or -1), _WAIT_S)
            return "application/json", json.dumps(told).encode(), _POLICY
        if asked := _PICTURE.fullmatch(name):
            picture = self._session.picture(int(asked[1]), int(asked[2]))
            return None if picture is None else ("image/png", picture.data, _POLICY)
        if drawn := self._session.drawn(name):
            return "image/png", drawn, _POLICY
        if name in self._files:
            kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
            # These bring a policy of their own.
            return kind, self._files[name].read_bytes(), "frame-ancestors 'none'"
        return None

    def post(self, name: str, body: Mapping[str, Any]) -> bool:
        """Do what a page asks for; False for what there is not. Raises as the session does."""
        actions: dict[str, Callable[[], None]] = {
            "begin": self._session.begin,
            "pause": self._session.pause,
            "resume": self._session.resume,
            "finish": self.finished.set,
            "answer": lambda: self._answer(_Answer.model_validate(body)),
        }
        if name in actions:
            actions[name]()
        return name in actions

    def _answer(self, answer: _Answer) -> None:
        self._session.answer(answer.change, answer.given())


class _Answer(BaseModel):
    """An answer as the page sends it: picks, and the numbers of each where they have some."""

    model_config = ConfigDict(strict=True)
    change: int
    picks: list[int]
    numbers: list[list[int | float]] = []

    def given(self) -> tuple[Pick, ...]:
        """Return the picks; ValueError for numbers of other picks."""
        numbers = self.numbers or [[] for _ in self.picks]
        return tuple(Pick(pick, tuple(own)) for pick, own in zip(self.picks, numbers, strict=True))


class _Listener(ThreadingHTTPServer):
    daemon_threads = True
    # The same command goes on at the same port at once; on Windows two could then share one.
    allow_reuse_address = os.name == "posix"

    def server_bind(self) -> None:
        """Bind without asking the network for the machine's name, which may take long."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self.server_address[:2]  # type: ignore[assignment]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that was closed or reloaded while it was answered."""
        if not isinstance(sys.exc_info()[1], ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server_of: Server
    timeout = _TIMEOUT_S
    protocol_version = "HTTP/1.1"
    server_version = "phyblock"
    sys_version = ""

    def do_GET(self) -> None:
        """Give a file of the page, the state, or a picture."""
        if (asked := self._admitted(changes=False)) is not None:
            found = self.server_of.get(*asked)
            if found is None:
                self._refuse(404)
            else:
                self._send(200, *found)

    def do_POST(self) -> None:
        """Take an answer, a pause, a beginning, an end."""
        if (asked := self._admitted(changes=True)) is None:
            return
        length = self.headers.get("Content-Length", "")
        if not length.isascii() or not length.isdigit():
            self._refuse(411)
            return
        if len(length) > 9 or int(length) > LARGEST_BODY_BYTES:
            self._refuse(413)
            return
        try:
            body = load_json(self.rfile.read(int(length)))
            is_known = self.server_of.post(asked[0], body if isinstance(body, dict) else {})
        except NotNowError:
            self._refuse(409)
        except ValueError as error:
            self._refuse(400, str(error).encode())
        else:
            if is_known:
                self._send(200, "application/json", b"{}")
            else:
                self._refuse(404)

    def _admitted(self, *, changes: bool) -> tuple[str, str] | None:
        """Return the name that is asked for and its query; None where the request was refused."""
        try:
            split = urlsplit(self.path)
        except ValueError:
            self._refuse(400)
            return None
        hosts, origin = self.headers.get_all("Host", []), self.headers.get("Origin")
        origins = [f"http://{host}" for host in self.server_of.hosts]
        name = self.server_of.below(split.path)
        if split.netloc:
            # A whole address is for proxies, and Pythons differ in which hosts they take.
            self._refuse(404)
        elif len(hosts) != 1 or hosts[0] not in self.server_of.hosts:
            self._refuse(421)
        elif (origin is None and changes) or (origin is not None and origin not in origins):
            self._refuse(403)
        elif not changes and self.server_of.is_code(split.path):
            page = self.server_of.use_code()
            if page is None:
                self._refuse(410, _USED)
            else:
                self._send(303, "text/plain", b"", Location=page)
        elif name is None:
            self._refuse(404)
        elif changes and self.headers.get("Content-Type") != "application/json":
            self._refuse(415)
        elif self.headers.get("Transfer-Encoding") is not None:
            self._refuse(411)
        else:
            return name, split.query
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

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse what is no request at all as everything else, with nothing of it repeated."""
        del message, explain
        self._refuse(code)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the terminal is the run's."""
