"""Calls to OpenAI-compatible servers straight over HTTP: one request, no library in between.

Puts the same JSON on the wire as litellm does, at a tenth of its CPU time.
"""

from __future__ import annotations

import time

from phyblock.config.models import ModelConfig
from phyblock.errors import Problem, SpecError
from phyblock.models.client import Client, HttpClient, read_completion, read_json
from phyblock.models.keys import api_key
from phyblock.models.request import Request, json_body, wire_params
from phyblock.records.reply import Reply

OPENAI_API_BASE = "https://api.openai.com/v1"


class OpenAIClient(Client):
    """`POST {api_base}/chat/completions`."""

    def __init__(self, config: ModelConfig, http: HttpClient | None = None) -> None:
        """Raise SpecError where no address is given and the provider is not OpenAI.

        Without an address the request, with another provider's key, would go to OpenAI.
        """
        if config.api_base is None and config.provider != "openai":
            message = "needs an api_base to be called directly"
            raise SpecError(Problem(f"model {config.name}", message, "api_base", config.id))
        super().__init__(config, http)
        self._url = f"{(config.api_base or OPENAI_API_BASE).rstrip('/')}/chat/completions"

    async def _complete(self, request: Request, *, with_seed: bool) -> Reply:
        params = wire_params(self.config, request)
        extra_body = params.pop("extra_body", {})
        headers = {
            "Authorization": f"Bearer {api_key(self.config)}",
            "Content-Type": "application/json",
            **params.pop("extra_headers", {}),
        }
        fields = {"model": self.config.provider_model, **params}
        if with_seed:
            fields["seed"] = request.seed
        fields |= extra_body
        body = json_body(fields, request.messages, self.config.image_detail)
        started_s = time.perf_counter()
        answer = await self.http.send(self._url, body, headers)
        return read_completion(read_json(answer), time.perf_counter() - started_s, answer.status)
