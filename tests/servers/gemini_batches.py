"""A server that speaks Gemini's files and batches beside generateContent."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

from aiohttp import web

from tests.servers.batches import BatchServer, Made
from tests.servers.chassis import Seen
from tests.servers.gemini_generate import GeminiGenerate

_WORDS = {"running": "RUNNING", "ended": "SUCCEEDED", "refused": "FAILED"}
_CODES = {"400": 3, "429": 8, "500": 13, "cancelled": 1, "expired": 1}


class GeminiBatches(BatchServer, GeminiGenerate):
    """/upload/v1beta/files, :batchGenerateContent, /v1beta/batches, /download/v1beta/files."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.files: list[list[dict[str, Any]]] = []

    def add_routes(self, app: web.Application) -> None:
        app.router.add_post("/upload/v1beta/files", self._announce)
        app.router.add_post("/upload/v1beta/sent", self._upload)
        app.router.add_post("/v1beta/models/{name}:batchGenerateContent", self._create)
        app.router.add_get("/v1beta/batches", self._list)
        app.router.add_get("/v1beta/batches/{id}", self.look_at)
        app.router.add_get("/download/v1beta/files/{id}:download", self._results)
        super().add_routes(app)

    def key_of(self, request: web.Request) -> str:
        return request.headers["x-goog-api-key"]

    def line(self, custom_id: str, seen: Seen, ending: str) -> dict[str, Any]:
        if ending in _CODES:
            return {"key": custom_id, "error": {"code": _CODES[ending], "message": "went wrong"}}
        return {"response": self.reply(seen, ending), "key": custom_id}

    async def _announce(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            assert request.headers["X-Goog-Upload-Command"] == "start"
            size = request.headers["X-Goog-Upload-Header-Content-Length"]
            url = f"http://{request.host}/upload/v1beta/sent?bytes={size}"
            return web.json_response({}, headers={"X-Goog-Upload-URL": url})

        return await self.guarded("upload", request, work)

    async def _upload(self, request: web.Request) -> web.StreamResponse:
        assert request.headers["X-Goog-Upload-Command"] == "upload, finalize"
        data = await request.read()
        assert len(data) == int(request.query["bytes"])
        self.files.append([json.loads(line) for line in data.splitlines()])
        return web.json_response({"file": {"name": f"files/in-{len(self.files) - 1}"}})

    async def _create(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            batch = (await request.json())["batch"]
            number = int(batch["input_config"]["file_name"].rpartition("-")[2])
            requests = [(line["key"], line["request"]) for line in self.files[number]]
            return web.json_response(self.told(self.make(batch["display_name"], requests, request)))

        return await self.guarded("create", request, work)

    async def _list(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            start = int(request.query.get("pageToken", 0))
            rows, more = self.listed(start)
            body: dict[str, Any] = {"operations": rows}
            if more:
                body["nextPageToken"] = str(start + len(rows))
            return web.json_response(body)

        return await self.guarded("list", request, work)

    async def _results(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            assert request.query["alt"] == "media"
            lines = self.find(request.match_info["id"].removeprefix("out-")).lines
            return web.Response(text="\n".join(lines), content_type="application/jsonl")

        return await self.guarded("results", request, work)

    def told(self, made: Made) -> dict[str, Any]:
        state = _WORDS.get(made.state, made.state.upper())
        has_results = made.state in ("ended", "cancelled") and made.lines
        created = datetime.fromtimestamp(made.created_s, UTC).isoformat()
        output = {"responsesFile": f"files/out-{made.id}"}
        return {
            "name": f"batches/{made.id}",
            "metadata": {
                "displayName": made.token,
                "state": f"BATCH_STATE_{state}",
                "createTime": created.replace("+00:00", "123Z"),
                "batchStats": {
                    "requestCount": str(len(made.requests)),
                    "successfulRequestCount": str(sum('"response"' in line for line in made.lines)),
                },
                **({"output": output} if has_results else {}),
            },
            "done": made.state != "running",
            **({"response": output} if made.state == "ended" else {}),
        }
