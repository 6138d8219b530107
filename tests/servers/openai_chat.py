"""A server that speaks the OpenAI chat protocol: `python -m tests.servers.openai_chat --port 0`."""

import hashlib
import json
from typing import Any

from aiohttp import web

from tests.servers.chassis import LocalServer, Seen, main, picture_part


class OpenAIChat(LocalServer):
    """POST /v1/chat/completions."""

    def add_routes(self, app: web.Application) -> None:
        app.router.add_post("/v1/chat/completions", self.handle)

    def read(self, body: dict[str, Any], request: web.Request) -> Seen:
        system, parts = "", []
        for message in body["messages"]:
            content = message["content"]
            if message["role"] == "system":
                system += content if isinstance(content, str) else content[0]["text"]
            else:
                parts += [content] if isinstance(content, str) else map(_part, content)
        params = {k: v for k, v in body.items() if k not in ("model", "messages", "seed")}
        key = self.key_of(request)
        return Seen(body["model"], system, tuple(parts), params, body.get("seed"), key, body)

    def key_of(self, request: web.Request) -> str:
        return request.headers.get("Authorization", "").removeprefix("Bearer ")

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        finish = {"length": "length", "filtered": "content_filter"}.get(ending, "stop")
        message = {"role": "assistant", "content": self.text(seen, ending)}
        message["reasoning_content"] = self.think(seen)
        prompt, completion = self.usage(seen)
        usage = {"prompt_tokens": prompt, "completion_tokens": completion}
        choice = {"index": 0, "message": message, "finish_reason": finish}
        return {
            "id": f"chatcmpl-{seen.sample}",
            "object": "chat.completion",
            "created": 1_700_000_000,
            "model": f"{seen.model}-served",
            "choices": [] if ending == "empty" else [choice],
            "usage": {**usage, "total_tokens": prompt + completion},
        }

    def error(self, status: int, ending: str, message: str) -> dict[str, Any]:
        code = {"policy": "content_policy_violation", "quota": "insufficient_quota"}.get(ending)
        kind = "invalid_request_error" if status == 400 else "api_error"
        return {"error": {"message": message, "type": kind, "param": None, "code": code}}


def _part(part: dict[str, Any]) -> str | tuple[str, str]:
    if part["type"] == "text":
        return part["text"]
    head, _, data = part["image_url"]["url"].partition(";base64,")
    return picture_part(head.removeprefix("data:"), data)


def answered(seen: Seen) -> str:
    """Return what the track asks for, by a digest of the messages: a letter, a move (now and then
    one that cannot be read), or a plan.
    """
    asked = str(seen.parts[-1])
    digest = hashlib.sha256(json.dumps([seen.system, seen.parts]).encode()).digest()
    if "Question:" in asked:
        return f"Answer: {'ABCD'[digest[0] % 4]}"
    if "Next plan:" not in asked:
        return seen.reply_text
    if digest[0] < 20:
        return "I would rather not say."
    return f"The base comes first.\nNext plan: Move({digest[1] % 5 + 1})"


if __name__ == "__main__":
    main(OpenAIChat)
