"""A session of a person: what it shows and keeps, the server that refuses others."""

import asyncio
import http.client
import json
import socket
import struct
import threading
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.suite import load_suite
from phyblock.errors import SpecError
from phyblock.models.request import HaltedError, Image, Message, Request
from phyblock.tracks.base import Choice, Pick, Picking
from phyblock.web.server import LARGEST_BODY_BYTES, Server
from phyblock.web.session import NotNowError, PlaySession, plan_session
from tests.workspace import SCENES, in_a_loop, until

PICTURE = Image(b"pixels", "candidates", 64, 64)
PICKING = Picking(
    (Choice("1", "", ("candidates",), 0), Choice("2", "", ("candidates",), 1)),
    least=1,
    most=3,
    repeats=True,
    noun="step",
    write=lambda picks: " ".join(str(pick.place) for pick in picks),
)


async def asked(clock=lambda: 0.0):
    """A session before its beginning, and its first question."""
    session = PlaySession(2, clock)
    session.welcome("ada")
    message = Message("user", ("Look:", PICTURE, "What comes first?"))
    request = Request("secret-scene", 0, (message,), {}, "v", {"answer": "secret-answer"})
    task = asyncio.create_task(session.ask(request, PICKING))
    await asyncio.sleep(0)
    return session, task


@in_a_loop
async def test_nothing_is_shown_before_the_beginning_and_no_name_or_answer_ever():
    session, task = await asked()
    told = session.state(-1)
    assert (told["phase"], "question" in told) == ("start", False)
    assert session.picture(told["change"], 0) is None
    session.begin()
    told = session.state(-1)
    parts = told["question"]["messages"][0]["parts"]
    assert [part.get("text") for part in parts] == ["Look:", None, "What comes first?"]
    assert "secret" not in json.dumps(told)
    assert session.picture(told["change"], 0) is PICTURE
    assert session.picture(told["change"], 1) is session.picture(told["change"] - 1, 0) is None
    session.close()
    with pytest.raises(HaltedError):
        await task


@in_a_loop
async def test_the_clock_runs_from_the_first_look_and_stands_still_in_pauses():
    now_s = [0.0]
    session, task = await asked(lambda: now_s[-1])
    look = partial(session.state, -1)
    acts = {100: session.begin, 200: look, 203: session.pause, 400: session.begin}
    for at_s, act in acts.items():
        now_s.append(at_s)
        act()
    now_s.append(401.0)
    assert session.state(-1)["elapsed_s"] == 3.0
    now_s.append(403.5)
    session.answer(session.state(-1)["change"], tuple(map(Pick, [1, 0, 1])))
    assert await task == ("1 0 1", 5.5)


@in_a_loop
async def test_an_answer_counts_once_and_only_for_what_lies_there():
    session, task = await asked()
    session.begin()
    change = session.state(-1)["change"]
    with pytest.raises(NotNowError):
        session.answer(change - 1, [Pick(0)])
    with pytest.raises(ValueError, match="make no answer"):
        session.answer(change, [])
    session.answer(change, [Pick(0)])
    for late in (change, change + 1):
        with pytest.raises(NotNowError):
            session.answer(late, [Pick(1)])
    assert (await task)[0] == "0"
    assert session.state(-1)["phase"] == "waiting"


def played(suite, picks):
    """Sit down, pick these one after another, and close the sitting; what was shown."""
    plan = plan_session(load_suite(suite), "ada", None)
    session = PlaySession(plan.samples_per_model)
    shown = []

    async def sat():
        left = list(picks)
        run = asyncio.create_task(session.run(plan, suite.parent / "out", lambda: None))
        while not run.done():
            await asyncio.sleep(0.01)
            told = session.state(-1)
            if told["phase"] in ("start", "warmed"):
                if "went" in told:
                    shown.append(json.dumps(told["went"]))
                session.begin()
            elif told["phase"] == "question" and left:
                shown.append(json.dumps(told["question"]))
                session.answer(told["change"], [Pick(left.pop(0))])
            elif told["phase"] == "question":
                session.close()
        return await run

    return asyncio.run(sat()), shown


def test_an_episode_goes_on_where_the_sitting_was_closed(inside):
    inside.write_scenes(SCENES[0])
    suite = inside.write_suite(tracks=["step_planning"], steps={"physics": "off"})
    red, blue = 0, 2
    asked = []
    for picks, settled in (([blue, red], 0), ([blue], 1)):
        result, shown = played(suite, picks)
        assert (result.settled, result.left) == (settled, 1 - settled)
        asked += shown
    assert all(f"This is step {n} of" in one for n, one in enumerate(asked, 1))
    (record,) = inside.records()
    assert record["outcomes"] == ["dependency_not_met", "placed", "placed"]
    moves = ["Next plan: Move(3)", "Next plan: Move(1)", "Next plan: Move(3)"]
    assert [turn["reply"]["text"] for turn in record["turns"]] == moves


def test_a_warm_up_on_another_scene_of_level_1_is_shown_how_it_went_and_not_kept(inside):
    inside.write_scenes(*SCENES[:2])
    suite = inside.write_suite(limit=1, baselines=["goal-blind", "random"])
    _, (warm_up, went, question) = played(suite, [0, 2])
    assert ['"number": 0' in warm_up, '"number": 1' in question] == [True, True]
    assert [step["name"] for step in json.loads(went)["steps"]] == ["1"]
    lines = inside.records()
    records = {one["model"]: one for one in lines}
    # Rules that never see the goal stand beside the person.
    assert records.keys() == {"human:ada", "goal-blind", "random"}
    assert len(lines) == len(records)
    assert records["human:ada"]["parse"]["plan"] == [3]


@pytest.fixture(scope="module")
def session():
    session = PlaySession(1)
    session.welcome("ada")
    return session


@pytest.fixture(scope="module")
def server(session):
    with Server(session) as running:
        yield running


def token(server):
    return server.address.rstrip("/").rpartition("/")[2]


def ask(server, method="GET", path="/{token}/state", body=None, **headers):
    """A request as a page of the server makes it, but for what is given; None leaves out."""
    usual = {"Host": server.hosts[0]}
    if method == "POST":
        usual["Origin"] = f"http://{server.hosts[0]}"
        usual["Content-Type"] = "application/json"
        usual["Content-Length"] = str(len(body or b""))
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.putrequest(method, path.format(token=token(server)), skip_host=True)
    for name, value in {**usual, **given}.items():
        if value is not None:
            connection.putheader(name, value.format(port=server.server_port))
    connection.endheaders(body)
    answer = connection.getresponse()
    answer.body = answer.read()
    connection.close()
    return answer


def test_it_listens_on_the_loopback_address_alone(server, session):
    assert server.address.startswith(f"http://127.0.0.1:{server.server_port}/")
    # The whole of 127/8 is this machine: another address of it is not answered.
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", server.server_port), timeout=5)
    with pytest.raises(SpecError, match="--port: cannot be used"):
        Server(session, server.server_port)


def test_a_page_of_its_own_is_answered_and_may_load_nothing_from_elsewhere(server):
    for host in server.hosts:
        assert ask(server, Host=host).status == 200
    answer = ask(server, path="/{token}/")
    assert answer.status == 200
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert "Access-Control-Allow-Origin" not in answer.headers


NOT_OURS = (
    *("/", "/state", "//state", "/wrong/state", "/{token}", "/{token}x/state", "/<script>"),
    *("/{token}/../../etc/passwd", "/{token}/%2e%2e/%2e%2e/etc/passwd", "/{token}//etc/passwd"),
    *("/{token}/picture/0/0", "/{token}/picture/-1/../0", "/{token}/records.jsonl"),
    *("/{token}/report.html", "/{token}/state?after=x", "http://evil.example/{token}/state"),
)


def get(**about):
    return "GET", None, about


def post(body=b"{}", path="/{token}/answer", **about):
    return "POST", body, {"path": path, **about}


ORIGINS = ("http://evil.example", "null", "https://127.0.0.1:{port}")
PICKED = b'{"change": 1, "picks": [0]}'
NUMBERS = (b'[["2.5"]]', b"[[true]]", b"[1]", b"[[1], [2]]", b"[[1" + b"0" * 300 + b"]]")
REFUSED = {
    421: [
        get(Host=host) for host in ("evil.example:{port}", "127.0.0.1", "[::1]:{port}", "", None)
    ],
    403: [
        *(get(Origin=origin) for origin in ORIGINS),
        *(post(path="/{token}/state", Origin=origin) for origin in ORIGINS),
        post(Origin=None),
    ],
    404: [*(get(path=path) for path in NOT_OURS), post(path="/{token}/shutdown")],
    501: [(method, None, {}) for method in ("PUT", "DELETE", "OPTIONS", "HEAD")],
    411: [
        post(None, Content_Length=None),
        post(Content_Length="-2"),
        post(Transfer_Encoding="chunked"),
    ],
    413: [post(None, Content_Length=n) for n in (str(LARGEST_BODY_BYTES + 1), "9" * 400)],
    415: [post(Content_Type="text/plain")],
    409: [post(PICKED)],
    400: [
        get(path="http://[x]/{token}/state"),
        *map(post, (b"{", b"[" * 5000, b"NaN", b"{}", b'{"change": true, "picks": []}')),
        post(PICKED.replace(b"0", b'"0"')),
        *(post(PICKED[:-1] + b', "numbers": ' + numbers + b"}") for numbers in NUMBERS),
    ],
}


@pytest.mark.parametrize(
    ("status", "method", "body", "headers"),
    [(status, *one) for status, cases in REFUSED.items() for one in cases],
)
def test_others_and_what_is_no_answer_are_refused_and_change_nothing(
    server, session, status, method, body, headers
):
    before = session.state(-1)
    answer = ask(server, method, body=body, **headers)
    assert answer.status == status
    assert bool(answer.body) == (status == 400 and method == "POST")
    assert session.state(-1) == before


def is_idle():
    """True if no thread of a server answers a request."""
    return not any("process_request_thread" in one.name for one in threading.enumerate())


def test_only_files_that_were_named_are_served_and_a_fault_of_ours_is_seen(server, tmp_path, capfd):
    for name in ("report.html", "run.yaml"):
        (tmp_path / name).write_text("secret", encoding="utf-8")
    server.files = {name: tmp_path / name for name in ("report.html", "gone.html")}
    assert ask(server, path="/{token}/report.html").status == 200
    assert ask(server, path="/{token}/run.yaml").status == 404
    with pytest.raises(http.client.RemoteDisconnected):
        ask(server, path="/{token}/gone.html")
    until(is_idle)
    server.files = {}
    assert "FileNotFoundError" in capfd.readouterr().err


def send(server, content):
    connection = socket.create_connection(("127.0.0.1", server.server_port), timeout=10)
    connection.sendall(content)
    return connection


ADDRESSES = ["http://[", "//[::1", "http://[x]/{token}/state", "/{token}/state?after=[", "*"]
TARGETS = st.one_of(
    st.sampled_from(ADDRESSES),
    st.text(st.characters(min_codepoint=33, max_codepoint=255), min_size=1, max_size=30),
)


@given(target=TARGETS, method=st.sampled_from(["GET", "POST"]))
def test_whatever_is_asked_for_is_answered_with_a_refusal(server, target, method):
    asked = target.replace("{token}", token(server))
    lines = f"{method} {asked} HTTP/1.1\r\nHost: {server.hosts[0]}\r\nConnection: close\r\n\r\n"
    with send(server, lines.encode("latin-1")) as connection, connection.makefile("rb") as answer:
        status, _, rest = answer.read().partition(b"\r\n")
    # Without a version there is no line of status, and nothing else.
    assert status == b"" or status.split()[1] in (b"400", b"403", b"404")
    assert rest.partition(b"\r\n\r\n")[2] == b""


@pytest.mark.parametrize("resets", [True, False])
def test_who_leaves_while_waiting_leaves_no_word_on_the_terminal(server, session, resets, capfd):
    # Threads of earlier requests may still be about to end, and would be taken for this one's.
    until(is_idle)
    path = f"/{token(server)}/state?after={session.state(-1)['change']}"
    lines = f"GET {path} HTTP/1.1\r\nHost: {server.hosts[0]}\r\n\r\n"
    # The second is asked for on the same connection, which is gone when it is read.
    connection = send(server, 2 * lines.encode())
    until(lambda: not is_idle())
    if resets:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()
    session.welcome("ada")
    until(is_idle)
    assert capfd.readouterr() == ("", "")


def test_the_address_for_a_browser_leads_on_once_and_does_not_tell_the_token(server):
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
    assert token(server) not in str(again)
