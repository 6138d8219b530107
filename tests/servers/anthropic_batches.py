"""A server that speaks Anthropic's message batches beside its messages."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from aiohttp import web

from tests.servers.anthropic_messages import AnthropicMessages
from tests.servers.batches import BatchServer, Made
from tests.servers.chassis import Seen

_KINDS = {"400": "invalid_request_error", "500": "api_error", "429": "rate_limit_error"}
_OWN = "https://api.anthropic.com/v1/messages/batches"
"""What the provider names, whichever gateway it was asked through."""


class AnthropicBatches(BatchServer, AnthropicMessages):
    """/v1/messages/batches."""

    is_archived = False

    def add_routes(self, app: web.Application) -> None:
        super().add_routes(app)
        path = "/v1/messages/batches"
        app.router.add_post(path, self._create)
        app.router.add_get(path, self._list)
        app.router.add_get(path + "/{id}", self.look_at)
        app.router.add_get(path + "/{id}/results", self._results)

    def key_of(self, request: web.Request) -> str:
        assert request.headers["anthropic-version"] == "2023-06-01"
        return request.headers["x-api-key"]

    def line(self, custom_id: str, seen: Seen, ending: str) -> dict[str, Any]:
        if ending in ("expired", "cancelled"):
            result: dict[str, Any] = {"type": ending.replace("ll", "l")}
        elif ending.isdigit():
            error = {"type": _KINDS[ending], "message": "went wrong"}
            result = {"type": "errored", "error": {"type": "error", "error": error}}
        else:
            result = {"type": "succeeded", "message": self.reply(seen, ending)}
        return {"custom_id": custom_id, "result": result}

    async def _create(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            body = await request.json()
            requests = [(one["custom_id"], one["params"]) for one in body["requests"]]
            assert all(len(name) <= 64 for name, _ in requests)
            token = requests[0][0].rpartition("-")[0]
            return web.json_response(self.told(self.make(token, requests, request)))

        return await self.guarded("create", request, work)

    async def _list(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            rows, more = self.listed(self.after(request.query.get("after_id")))
            return web.json_response({"data": rows, "has_more": more, "last_id": ""})

        return await self.guarded("list", request, work)

    async def _results(self, request: web.Request) -> web.StreamResponse:
        async def work() -> web.Response:
            lines = self.find(request.match_info["id"]).lines
            # In no order of the requests.
            text = "".join(f"{line}\n" for line in reversed(lines))
            return web.Response(text=text, content_type="application/x-jsonl")

        return await self.guarded("results", request, work)

    def told(self, made: Made) -> dict[str, Any]:
        has_ended = made.state != "running"
        kinds = [line.split('"type": "', 1)[-1].split('"', 1)[0] for line in made.lines]
        counts = {
            name: kinds.count(name) for name in ("succeeded", "errored", "canceled", "expired")
        }
        counts["processing"] = len(made.requests) - sum(counts.values())
        created = datetime.fromtimestamp(made.created_s, UTC)
        return {
            "id": made.id,
            "type": "message_batch",
            "processing_status": "ended" if has_ended else "in_progress",
            "request_counts": counts,
            "archived_at": "2026-01-01T00:00:00Z" if self.is_archived else None,
            "created_at": created.isoformat().replace("+00:00", "Z"),
            "results_url": f"{_OWN}/{made.id}/results" if has_ended else None,
        }
