"""A server that speaks OpenAI's files and batches beside its chat protocol."""

from __future__ import annotations

import json
from typing import Any

from aiohttp import web

from tests.servers.batches import NEVER_ASKED, BatchServer, Made
from tests.servers.chassis import Seen
from tests.servers.openai_chat import OpenAIChat

_WORDS = {"running": "in_progress", "ended": "completed", "refused": "failed"}


class OpenAIBatches(BatchServer, OpenAIChat):
    """/v1/files and /v1/batches; with `forgets_names` it keeps no metadata, with `is_late` the
    files of a batch come one look after its end.
    """

    forgets_names = False
    is_late = False

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.files: dict[str, list[dict[str, Any]]] = {}

    def add_routes(self, app: web.Application) -> None:
        super().add_routes(app)
        app.router.add_post("/v1/files", self._upload)
        app.router.add_get("/v1/files/{id}/content", self._content)
        app.router.add_post("/v1/batches", self._create)
        app.router.add_get("/v1/batches", self._list)
        app.router.add_get("/v1/batches/{id}", self.look_at)

    def key_of(self, request: web.Request) -> str:
        return request.headers.get("Authorization", "").removeprefix("Bearer ")

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

    async def _upload(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            form = await request.post()
            assert form["purpose"] == "batch"
            file = form["file"]
            assert isinstance(file, web.FileField)
            lines = [json.loads(line) for line in file.file.read().splitlines()]
            name = f"file-{len(self.files)}"
            self.files[name] = lines
            return web.json_response({"id": name, "object": "file", "purpose": "batch"})

        return await self.guarded("upload", request, work)

    async def _create(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            body = await request.json()
            assert body["endpoint"] == "/v1/chat/completions"
            assert body["completion_window"] == "24h"
            lines = self.files[body["input_file_id"]]
            assert {(line["method"], line["url"]) for line in lines} == {
                ("POST", "/v1/chat/completions")
            }
            requests = [(line["custom_id"], line["body"]) for line in lines]
            made = self.make(body["metadata"]["phyblock"], requests, request)
            return web.json_response(self.told(made))

        return await self.guarded("create", request, work)

    async def _list(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            rows, more = self.listed(self.after(request.query.get("after")))
            return web.json_response({"object": "list", "data": rows, "has_more": more})

        return await self.guarded("list", request, work)

    async def _content(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            name, _, kind = request.match_info["id"].rpartition(".")
            lines = [line for line in self.find(name).lines if (_failed(line)) == (kind == "bad")]
            return web.Response(text="\n".join(lines), content_type="application/jsonl")

        return await self.guarded("results", request, work)

    def told(self, made: Made) -> dict[str, Any]:
        has_ended = made.state not in ("running", "refused")
        has_ended = has_ended and made.looks >= self.batch_faults.looks + self.is_late
        done = len(made.lines)
        bad = sum(map(_failed, made.lines))
        errors = {"data": [{"code": "token_limit_exceeded", "message": "Enqueued token limit"}]}
        return {
            "id": made.id,
            "object": "batch",
            "status": _WORDS.get(made.state, made.state),
            "metadata": None if self.forgets_names else {"phyblock": made.token},
            "request_counts": {
                "total": len(made.requests),
                "completed": done - bad,
                "failed": bad,
            },
            "created_at": int(made.created_s),
            "errors": errors if made.state == "refused" else None,
            "output_file_id": f"{made.id}.good" if has_ended and done > bad else None,
            "error_file_id": f"{made.id}.bad" if has_ended and bad else None,
        }


def _failed(line: str) -> bool:
    try:
        read = json.loads(line)
    except ValueError:
        return False
    response = read["response"]
    return response is None or response["status_code"] != 200
