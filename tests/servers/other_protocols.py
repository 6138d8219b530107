"""Servers that speak the Anthropic Messages protocol, and the Gemini generateContent protocol."""

from typing import Any

from aiohttp import web

from tests.servers.chassis import LocalServer, Seen, picture_part


class AnthropicMessages(LocalServer):
    """POST /v1/messages; there is no seed in this protocol."""

    def add_routes(self, app: web.Application) -> None:
        app.router.add_post("/v1/messages", self.handle)

    def read(self, body: dict[str, Any], request: web.Request) -> Seen:
        system = body.get("system", "")
        if not isinstance(system, str):
            system = "".join(block["text"] for block in system)
        parts: list[str | tuple[str, str]] = []
        for message in body["messages"]:
            content = message["content"]
            parts += [content] if isinstance(content, str) else map(_block, content)
        params = {k: v for k, v in body.items() if k not in ("model", "messages", "system")}
        key = self.key_of(request)
        return Seen(body["model"], system, tuple(parts), params, body.get("seed"), key, body)

    def key_of(self, request: web.Request) -> str:
        return request.headers.get("x-api-key", "")

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        stop = {"length": "max_tokens", "filtered": "refusal"}.get(ending, "end_turn")
        prompt, completion = self.usage(seen)
        body = {
            "id": f"msg_{seen.sample}",
            "type": "message",
            "role": "assistant",
            "model": seen.model,
            "content": [
                {"type": "thinking", "thinking": self.think(seen), "signature": "c2ln"},
                {"type": "text", "text": self.text(seen, ending)},
            ],
            "stop_reason": stop,
            "stop_sequence": None,
            "usage": {"input_tokens": prompt, "output_tokens": completion},
        }
        return {"type": "message"} if ending == "empty" else body

    def error(self, status: int, ending: str, message: str) -> dict[str, Any]:
        kinds = {429: "rate_limit_error", 500: "api_error", 401: "authentication_error"}
        kind = kinds.get(status, "invalid_request_error")
        if ending == "policy":
            message = "Output blocked by content filtering policy"
        return {"type": "error", "error": {"type": kind, "message": message}}


def _block(part: dict[str, Any]) -> str | tuple[str, str]:
    if part["type"] == "text":
        return part["text"]
    source = part["source"]
    return picture_part(source["media_type"], source["data"])


class GeminiGenerate(LocalServer):
    """POST /v1beta/models/<model>:generateContent."""

    def add_routes(self, app: web.Application) -> None:
        app.router.add_post("/{tail:.*}", self.handle)

    def read(self, body: dict[str, Any], request: web.Request) -> Seen:
        instruction = body.get("system_instruction") or body.get("systemInstruction") or {}
        system = "".join(part["text"] for part in instruction.get("parts", []))
        parts = tuple(_part(part) for content in body["contents"] for part in content["parts"])
        params = dict(body.get("generationConfig", {}))
        seed = params.pop("seed", None)
        model = request.path.rpartition("/")[2].partition(":")[0]
        return Seen(model, system, parts, params, seed, self.key_of(request), body)

    def key_of(self, request: web.Request) -> str:
        return request.headers.get("x-goog-api-key") or request.query.get("key", "")

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        finish = {"length": "MAX_TOKENS", "filtered": "SAFETY"}.get(ending, "STOP")
        parts = [{"text": self.think(seen), "thought": True}, {"text": self.text(seen, ending)}]
        content = {"role": "model", "parts": parts}
        candidate = {"content": content, "finishReason": finish, "index": 0}
        prompt, completion = self.usage(seen)
        usage = {"promptTokenCount": prompt, "totalTokenCount": prompt + completion}
        usage |= {"candidatesTokenCount": completion - 10, "thoughtsTokenCount": 10}
        body = {"candidates": [candidate], "usageMetadata": usage, "modelVersion": seen.model}
        return {} if ending == "empty" else body

    def error(self, status: int, ending: str, message: str) -> dict[str, Any]:  # noqa: ARG002
        names = {429: "RESOURCE_EXHAUSTED", 500: "INTERNAL", 401: "UNAUTHENTICATED"}
        name = names.get(status, "INVALID_ARGUMENT")
        return {"error": {"code": status, "message": message, "status": name}}


def _part(part: dict[str, Any]) -> str | tuple[str, str]:
    if "text" in part:
        return part["text"]
    data = part.get("inline_data") or part["inlineData"]
    return picture_part(data.get("mime_type") or data["mimeType"], data["data"])
