"""Servers of batches in three protocols, with faults and moments to break off. A batch answers each
of its requests as the server would answer it alone, and counts it as asked.
"""

import json
from collections import Counter
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from aiohttp import web

from tests.servers.chassis import LocalServer, Seen
from tests.servers.faults import reset_connection
from tests.servers.openai_chat import OpenAIChat
from tests.servers.other_protocols import AnthropicMessages, GeminiGenerate

NEVER_ASKED = ("expired", "cancelled")
ODD = ("broken", "twice", "stranger")
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(frozen=True)
class BatchFaults:
    """Faults of batches and calls; batches are counted from 0.

    `lines` gives by batch the places whose line is not "ok": a status ("500", "400"), an ending of
    LocalServer.reply ("length"), "expired", "cancelled", "missing", "broken", "twice" or "stranger"
    (an answer to nothing besides). `ends` gives by batch another state than an ordinary end:
    "expired", "cancelled" or "refused". `calls` gives by kind of call ("upload", "create", "look",
    "results") what the first ones meet: a status, "reset" (before anything), or
    "done-reset" (it is done, and the answer lost). A batch ends at look number `looks`.
    """

    lines: Mapping[int, Mapping[int, str]] = field(default_factory=dict)
    ends: Mapping[int, str] = field(default_factory=dict)
    calls: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    looks: int = 2


@dataclass
class Made:
    """A batch, with lines of requests that were answered, and of those that were not."""

    token: str
    requests: list[tuple[str, dict[str, Any]]]
    ordinal: int
    created: datetime
    looks: int = 0
    state: str = "running"
    seen: list[Seen] = field(default_factory=list)
    good: list[str] = field(default_factory=list)
    bad: list[str] = field(default_factory=list)

    @property
    def id(self) -> str:
        return f"batch-{self.ordinal}"


@dataclass(eq=False, kw_only=True)
class BatchServer(LocalServer):
    """One protocol's batches; `asked` counts each request that was worked on, by sample. The class
    of a protocol gives it `line`, a line of the results, and `told`, what it says of a batch.
    """

    batch: BatchFaults = BatchFaults()
    made: list[Made] = field(default_factory=list)
    files: list[list[dict[str, Any]]] = field(default_factory=list)
    asked: Counter[str] = field(default_factory=Counter)
    calls: list[str] = field(default_factory=list)
    under_way: int = 0
    keys: set[str] = field(default_factory=set)
    moment: Callable[[str], None] = lambda _: None

    def call(self, kind: str, work: Callable[[web.Request], Awaitable[Any]]) -> Handler:
        """A handler that does a call's work, or what it meets; moments lie before and after."""

        async def answer(request: web.Request) -> web.StreamResponse:
            faults = self.batch.calls.get(kind, ())
            fault = dict(enumerate(faults)).get(self.calls.count(kind), "")
            self.calls.append(kind)
            self.keys.add(self.key_of(request))
            self.moment(f"{kind} arrived")
            if fault == "reset":
                return reset_connection(request)
            if fault.isdigit():
                error = self.error(int(fault), fault, "went wrong")
                return web.json_response(error, status=int(fault))
            done = await work(request)
            self.moment(f"{kind} done")
            if fault == "done-reset":
                return reset_connection(request)
            return done if isinstance(done, web.StreamResponse) else web.json_response(done)

        async def handle(request: web.Request) -> web.StreamResponse:
            self.under_way += 1
            try:
                return await answer(request)
            finally:
                self.under_way -= 1

        return handle

    async def look(self, request: web.Request) -> dict[str, Any]:
        """A call that looks at a batch, and brings it nearer to its end."""
        made = self.find(request)
        made.looks += 1
        if made.state == "running" and made.looks >= self.batch.looks:
            made.state = self.batch.ends.get(made.ordinal, "ended")
            if made.state != "refused":
                self._answer(made)
        return self.told(made)

    def make(self, token: str, requests: list[Any], call: web.Request) -> dict[str, Any]:
        """Begin a batch, which works on its requests whether it is looked at or not."""
        made = Made(token, requests, len(self.made), datetime.now(UTC))
        self.made.append(made)
        made.seen = [self.read(body, call) for _, body in requests]
        self.seen += made.seen
        if self.batch.ends.get(made.ordinal) != "refused":
            faults = self.batch.lines.get(made.ordinal, {})
            for place, seen in enumerate(made.seen):
                self.asked[seen.sample] += faults.get(place) not in NEVER_ASKED
        return self.told(made)

    def id_of(self, token: str) -> str | None:
        """The id of the batch with this name."""
        told = next((self.told(made) for made in self.made if made.token == token), {})
        return told.get("id") or told.get("name")

    def find(self, request: web.Request) -> Made:
        wanted = request.match_info["id"].removeprefix("out-").partition(".")[0]
        return next(made for made in self.made if made.id == wanted)

    def _answer(self, made: Made) -> None:
        faults = self.batch.lines.get(made.ordinal, {})
        for place, ((custom_id, _), seen) in enumerate(zip(made.requests, made.seen, strict=True)):
            ending = faults.get(place, "ok")
            if ending == "missing":
                continue
            whole = json.dumps(self.line(custom_id, seen, "ok" if ending in ODD else ending))
            if ending == "broken":
                whole = whole[: len(whole) // 2]
            lines = made.bad if ending.isdigit() or ending in NEVER_ASKED else made.good
            lines += [whole, whole] if ending == "twice" else [whole]
            if ending == "stranger":
                lines.append(json.dumps(self.line("nobody-7", seen, "ok")))


class OpenAIBatches(BatchServer, OpenAIChat):
    """/v1/files and /v1/batches."""

    def add_routes(self, app: web.Application) -> None:
        super().add_routes(app)
        app.router.add_post("/v1/files", self.call("upload", self._upload))
        app.router.add_get("/v1/files/{id}/content", self.call("results", self._content))
        app.router.add_post("/v1/batches", self.call("create", self._create))
        app.router.add_get("/v1/batches/{id}", self.call("look", self.look))

    def line(self, custom_id: str, seen: Seen, ending: str) -> dict[str, Any]:
        response, error = None, None
        if ending in NEVER_ASKED:
            error = {"code": f"batch_{ending}", "message": "This request could not be executed"}
        elif ending.isdigit():
            body = self.error(int(ending), ending, "went wrong")
            response = {"status_code": int(ending), "request_id": "r", "body": body}
        else:
            response = {"status_code": 200, "request_id": "r", "body": self.reply(seen, ending)}
        return {"id": "l", "custom_id": custom_id, "response": response, "error": error}

    async def _upload(self, request: web.Request) -> dict[str, Any]:
        form = await request.post()
        assert form["purpose"] == "batch"
        self.files.append([json.loads(line) for line in form["file"].file.read().splitlines()])
        return {"id": f"file-{len(self.files) - 1}", "object": "file", "purpose": "batch"}

    async def _create(self, request: web.Request) -> dict[str, Any]:
        body = await request.json()
        assert (body["endpoint"], body["completion_window"]) == ("/v1/chat/completions", "24h")
        lines = self.files[int(body["input_file_id"].removeprefix("file-"))]
        assert {(line["method"], line["url"]) for line in lines} == {("POST", body["endpoint"])}
        requests = [(line["custom_id"], line["body"]) for line in lines]
        return self.make(body["metadata"]["phyblock"], requests, request)

    async def _content(self, request: web.Request) -> web.Response:
        made = self.find(request)
        lines = made.bad if request.match_info["id"].endswith(".bad") else made.good
        return web.Response(text="\n".join(lines), content_type="application/jsonl")

    def told(self, made: Made) -> dict[str, Any]:
        words = {"running": "in_progress", "ended": "completed", "refused": "failed"}
        errors = {"data": [{"code": "token_limit_exceeded", "message": "Enqueued token limit"}]}
        counts = {"total": len(made.requests), "completed": len(made.good), "failed": len(made.bad)}
        return {
            "id": made.id,
            "object": "batch",
            "status": words.get(made.state, made.state),
            "metadata": {"phyblock": made.token},
            "request_counts": counts,
            "created_at": int(made.created.timestamp()),
            "errors": errors if made.state == "refused" else None,
            "output_file_id": f"{made.id}.good" if made.good else None,
            "error_file_id": f"{made.id}.bad" if made.bad else None,
        }


class AnthropicBatches(BatchServer, AnthropicMessages):
    """/v1/messages/batches."""

    def add_routes(self, app: web.Application) -> None:
        super().add_routes(app)
        path = "/v1/messages/batches"
        app.router.add_post(path, self.call("create", self._create))
        app.router.add_get(path + "/{id}", self.call("look", self.look))
        app.router.add_get(path + "/{id}/results", self.call("results", self._results))

    def key_of(self, request: web.Request) -> str:
        assert request.headers["anthropic-version"] == "2023-06-01"
        return super().key_of(request)

    def line(self, custom_id: str, seen: Seen, ending: str) -> dict[str, Any]:
        kinds = {"400": "invalid_request_error", "500": "api_error", "429": "rate_limit_error"}
        if ending in NEVER_ASKED:
            result: dict[str, Any] = {"type": ending.replace("ll", "l")}
        elif ending.isdigit():
            error = {"type": kinds[ending], "message": "went wrong"}
            result = {"type": "errored", "error": {"type": "error", "error": error}}
        else:
            result = {"type": "succeeded", "message": self.reply(seen, ending)}
        return {"custom_id": custom_id, "result": result}

    async def _create(self, request: web.Request) -> dict[str, Any]:
        body = await request.json()
        requests = [(one["custom_id"], one["params"]) for one in body["requests"]]
        assert all(len(name) <= 64 for name, _ in requests)
        return self.make(requests[0][0].rpartition("-")[0], requests, request)

    async def _results(self, request: web.Request) -> web.Response:
        # In no order of the requests.
        made = self.find(request)
        text = "".join(f"{line}\n" for line in reversed(made.good + made.bad))
        return web.Response(text=text, content_type="application/x-jsonl")

    def told(self, made: Made) -> dict[str, Any]:
        has_ended = made.state != "running"
        kinds = [json.loads(line)["result"]["type"] for line in made.bad]
        counts = {name: kinds.count(name) for name in ("errored", "canceled", "expired")}
        counts["succeeded"] = len(made.good)
        counts["processing"] = len(made.requests) - sum(counts.values())
        # The provider names its own address, whichever gateway it was asked through.
        own = f"https://api.anthropic.com/v1/messages/batches/{made.id}/results"
        return {
            "id": made.id,
            "type": "message_batch",
            "processing_status": "ended" if has_ended else "in_progress",
            "request_counts": counts,
            "archived_at": None,
            "created_at": made.created.isoformat().replace("+00:00", "Z"),
            "results_url": own if has_ended else None,
        }


class GeminiBatches(BatchServer, GeminiGenerate):
    """/upload/v1beta/files, :batchGenerateContent, /v1beta/batches, /download/v1beta/files."""

    def add_routes(self, app: web.Application) -> None:
        create = self.call("create", self._create)
        app.router.add_post("/upload/v1beta/files", self.call("upload", self._announce))
        app.router.add_post("/upload/v1beta/sent", self._upload)
        app.router.add_post("/v1beta/models/{name}:batchGenerateContent", create)
        app.router.add_get("/v1beta/batches/{id}", self.call("look", self.look))
        results = self.call("results", self._results)
        app.router.add_get("/download/v1beta/files/{id}:download", results)
        super().add_routes(app)

    def line(self, custom_id: str, seen: Seen, ending: str) -> dict[str, Any]:
        codes = {"400": 3, "429": 8, "500": 13, "cancelled": 1, "expired": 1}
        if ending in codes:
            return {"key": custom_id, "error": {"code": codes[ending], "message": "went wrong"}}
        return {"response": self.reply(seen, ending), "key": custom_id}

    async def _announce(self, request: web.Request) -> web.Response:
        assert request.headers["X-Goog-Upload-Command"] == "start"
        size = request.headers["X-Goog-Upload-Header-Content-Length"]
        url = f"http://{request.host}/upload/v1beta/sent?bytes={size}"
        return web.json_response({}, headers={"X-Goog-Upload-URL": url})

    async def _upload(self, request: web.Request) -> web.StreamResponse:
        assert request.headers["X-Goog-Upload-Command"] == "upload, finalize"
        data = await request.read()
        assert len(data) == int(request.query["bytes"])
        self.files.append([json.loads(line) for line in data.splitlines()])
        return web.json_response({"file": {"name": f"files/in-{len(self.files) - 1}"}})

    async def _create(self, request: web.Request) -> dict[str, Any]:
        batch = (await request.json())["batch"]
        number = int(batch["input_config"]["file_name"].rpartition("-")[2])
        requests = [(line["key"], line["request"]) for line in self.files[number]]
        return self.make(batch["display_name"], requests, request)

    async def _results(self, request: web.Request) -> web.Response:
        assert request.query["alt"] == "media"
        made = self.find(request)
        text = "\n".join(made.bad + made.good)
        return web.Response(text=text, content_type="application/jsonl")

    def told(self, made: Made) -> dict[str, Any]:
        words = {"running": "RUNNING", "ended": "SUCCEEDED", "refused": "FAILED"}
        output = {"responsesFile": f"files/out-{made.id}"}
        metadata = {
            "displayName": made.token,
            "state": f"BATCH_STATE_{words.get(made.state, made.state.upper())}",
            "createTime": made.created.isoformat().replace("+00:00", "123Z"),
            "batchStats": {
                "requestCount": str(len(made.requests)),
                "successfulRequestCount": str(len(made.good)),
            },
        }
        if made.state in ("ended", "cancelled") and made.good + made.bad:
            metadata["output"] = output
        done = {"name": f"batches/{made.id}", "metadata": metadata, "done": made.state != "running"}
        return done | ({"response": output} if made.state == "ended" else {})
