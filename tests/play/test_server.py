"""The server: who may ask, what is refused, and that a refusal changes nothing."""

from __future__ import annotations

import http.client
import socket
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import SpecError
from phyblock.web.server import LARGEST_BODY_BYTES, Server
from phyblock.web.session import PlaySession


@pytest.fixture(scope="module")
def session() -> PlaySession:
    session = PlaySession(1)
    session.welcome({"name": "ada", "consent": "May we?", "done": 0, "of": 1})
    return session


@pytest.fixture(scope="module")
def server(session: PlaySession) -> Iterator[Server]:
    with Server(session) as running:
        yield running


def token(server: Server) -> str:
    return server.address.rstrip("/").rpartition("/")[2]


class Answer(NamedTuple):
    status: int
    headers: dict[str, str]
    body: bytes


def ask(
    server: Server,
    method: str = "GET",
    path: str = "/{token}/state",
    body: bytes | None = None,
    **headers: str | None,
) -> Answer:
    """A request as a page of the server makes it, but for what is given; None leaves out."""
    usual: dict[str, str | None] = {"Host": server.hosts[0]}
    if method == "POST":
        usual["Origin"] = f"http://{server.hosts[0]}"
        usual["Content-Type"] = "application/json"
        usual["Content-Length"] = str(len(body or b""))
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.putrequest(method, path.format(token=token(server)), skip_host=True)
    for name, value in {**usual, **given}.items():
        if value is not None:
            connection.putheader(name, value.format(port=server.port))
    connection.endheaders(body)
    answer = connection.getresponse()
    found = Answer(answer.status, dict(answer.headers), answer.read())
    connection.close()
    return found


def test_it_listens_on_the_loopback_address_alone(server: Server) -> None:
    assert server.address.startswith(f"http://127.0.0.1:{server.port}/")
    socket.create_connection(("127.0.0.1", server.port)).close()
    # The whole of 127/8 is this machine: another address of it is not answered.
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", server.port), timeout=5)


def test_a_page_of_its_own_is_answered_and_may_load_nothing_from_elsewhere(server: Server) -> None:
    for host in server.hosts:
        assert ask(server, Host=host).status == 200
    answer = ask(server, path="/{token}/")
    assert answer.status == 200
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert "Access-Control-Allow-Origin" not in answer.headers


@pytest.mark.parametrize("host", ["evil.example:{port}", "127.0.0.1", "[::1]:{port}", "", None])
def test_other_names_of_this_machine_are_refused(server: Server, host: str | None) -> None:
    assert ask(server, Host=host).status == 421


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:{port}"])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_other_origins_are_refused(server: Server, method: str, origin: str) -> None:
    assert ask(server, method, "/{token}/agree", b"{}", Origin=origin).status == 403


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/state",
        "//state",
        "/wrong/state",
        "/{token}",
        "/{token}x/state",
        "/{token}/../../etc/passwd",
        "/{token}/%2e%2e/%2e%2e/etc/passwd",
        "/{token}//etc/passwd",
        "/{token}/picture/0/0",
        "/{token}/picture/-1/../0",
        "/{token}/records.jsonl",
        "/{token}/report.html",
        "/{token}/state?after=x",
        "http://evil.example/{token}/records.jsonl",
    ],
)
def test_other_paths_hold_nothing(server: Server, path: str) -> None:
    assert ask(server, path=path).status == 404


@pytest.mark.parametrize(
    ("status", "body", "headers"),
    [
        (403, b"{}", {"Origin": None}),
        (411, None, {"Content_Length": None}),
        (411, b"{}", {"Content_Length": "-2"}),
        (411, b"{}", {"Transfer_Encoding": "chunked"}),
        (413, None, {"Content_Length": str(LARGEST_BODY_BYTES + 1)}),
        (413, None, {"Content_Length": "9" * 400}),
        (415, b"{}", {"Content_Type": "text/plain"}),
        (400, b"{", {}),
        (400, b"[" * 5000, {}),
        (400, b"NaN", {}),
        (400, b"{}", {}),
        (400, b'{"change": true, "picks": []}', {}),
        (400, b'{"change": 1, "picks": ["0"]}', {}),
        (400, b'{"change": 1, "picks": [0], "numbers": [["2.5"]]}', {}),
        (400, b'{"change": 1, "picks": [0], "numbers": [[true]]}', {}),
        (400, b'{"change": 1, "picks": [0], "numbers": [1]}', {}),
        (400, b'{"change": 1, "picks": [0], "numbers": [[1], [2]]}', {}),
        (400, b'{"change": 1, "picks": [0], "numbers": [[1' + b"0" * 300 + b"]]}", {}),
        (409, b'{"change": 1, "picks": [0]}', {}),
    ],
)
def test_what_is_no_answer_is_refused_and_changes_nothing(
    server: Server,
    session: PlaySession,
    status: int,
    body: bytes | None,
    headers: dict[str, str | None],
) -> None:
    before = session.state(-1)
    answer = ask(server, "POST", "/{token}/answer", body, **headers)
    assert answer.status == status
    assert bool(answer.body) == (status == 400)
    assert session.state(-1) == before


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "HEAD"])
def test_other_methods_are_refused(server: Server, method: str) -> None:
    assert ask(server, method).status == 501
    assert ask(server, "POST", "/{token}/shutdown", b"{}").status == 404


def test_only_files_that_were_named_are_served(server: Server, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("<p>done", encoding="utf-8")
    (tmp_path / "run.yaml").write_text("secret", encoding="utf-8")
    server.show_files({"report.html": tmp_path / "report.html"})
    assert ask(server, path="/{token}/report.html").status == 200
    assert ask(server, path="/{token}/run.yaml").status == 404
    server.show_files({})


def test_a_port_that_is_taken_is_a_clear_error(server: Server, session: PlaySession) -> None:
    with pytest.raises(SpecError, match="--port: cannot be used"):
        Server(session, server.port)


def test_no_path_shows_up_in_an_answer(server: Server) -> None:
    answer = ask(server, path="/<script>alert(1)</script>")
    assert (answer.status, answer.body) == (404, b"")


def send(server: Server, content: bytes) -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", server.port), timeout=10)
    connection.sendall(content)
    return connection


def until_idle(threads: int) -> None:
    """Wait until no more than so many threads run: every request is through."""
    end = time.monotonic() + 10
    while threading.active_count() > threads:
        assert time.monotonic() < end
        time.sleep(0.005)


TARGETS = st.one_of(
    st.sampled_from(
        ["http://[", "//[::1", "http://[x]/{token}/state", "/{token}/state?after=[", "*"]
    ),
    st.text(st.characters(min_codepoint=33, max_codepoint=255), min_size=1, max_size=30),
)


@given(target=TARGETS, method=st.sampled_from(["GET", "POST"]))
def test_whatever_is_asked_for_is_answered_with_a_refusal(
    server: Server, target: str, method: str
) -> None:
    asked = target.replace("{token}", token(server))
    lines = f"{method} {asked} HTTP/1.1\r\nHost: {server.hosts[0]}\r\nConnection: close\r\n\r\n"
    with send(server, lines.encode("latin-1")) as connection, connection.makefile("rb") as answer:
        status, _, rest = answer.read().partition(b"\r\n")
    # Without a version there is no line of status, and nothing else.
    assert status == b"" or status.split()[1] in (b"400", b"403", b"404")
    assert rest.partition(b"\r\n\r\n")[2] == b""


@pytest.mark.parametrize("resets", [True, False])
def test_who_leaves_while_waiting_leaves_no_word_on_the_terminal(
    server: Server, session: PlaySession, resets: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    before = threading.active_count()
    path = f"/{token(server)}/state?after={session.state(-1)['change']}"
    lines = f"GET {path} HTTP/1.1\r\nHost: {server.hosts[0]}\r\n\r\n"
    # The second is asked for on the same connection, which is gone when it is read.
    connection = send(server, 2 * lines.encode())
    while threading.active_count() == before:
        time.sleep(0.005)
    if resets:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()
    session.welcome(session.state(-1)["about"])
    until_idle(before)
    assert capfd.readouterr() == ("", "")


def test_a_fault_of_ours_is_still_seen(
    server: Server, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    server.show_files({"gone.html": tmp_path / "gone.html"})
    before = threading.active_count()
    with pytest.raises(http.client.RemoteDisconnected):
        ask(server, path="/{token}/gone.html")
    until_idle(before)
    server.show_files({})
    assert "FileNotFoundError" in capfd.readouterr().err


def test_the_address_for_a_browser_leads_on_once_and_does_not_tell_the_token(
    server: Server,
) -> None:
    origin, code = server.one_time_address.rstrip("/").rsplit("/", 1)
    assert origin == f"http://{server.hosts[0]}"
    assert code != token(server)
    assert ask(server, path=f"/{code}/state").status == 404
    assert ask(server, "POST", f"/{code}/", b"{}").status == 404
    assert ask(server, path=f"/{code}/", Host="evil.example").status == 421
    assert ask(server, path=f"/{code}/", Origin="http://evil.example").status == 403
    first = ask(server, path=f"/{code}/")
    assert (first.status, first.headers["Location"]) == (303, f"/{token(server)}/")
    again = ask(server, path=f"/{code}/")
    assert again.status == 410
    assert b"Open the one in the terminal" in again.body
    assert token(server) not in str(again)
