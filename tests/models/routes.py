"""The ways to a local server: which protocol it speaks, and by which id and transport."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from phyblock.config.models import ModelConfig
from tests.servers.anthropic_messages import AnthropicMessages
from tests.servers.chassis import LocalServer
from tests.servers.gemini_generate import GeminiGenerate
from tests.servers.openai_chat import OpenAIChat

KEY_VARIABLE = "PHYBLOCK_TEST_KEY"
KEY = "sk-not-a-real-key-1234"


@dataclass(frozen=True)
class Route:
    """A protocol, the model id that leads to it, the path of its API, and a transport."""

    server: type[LocalServer]
    model_id: str
    path: str
    transport: str

    def config(self, url: str, **fields: Any) -> ModelConfig:
        """A model at the server with this address, its key in `KEY_VARIABLE`."""
        known: dict[str, Any] = {"id": self.model_id, "transport": self.transport, **fields}
        base = url + self.path
        return ModelConfig(name="m", api_base=base, api_key_env=KEY_VARIABLE, **known)


ROUTES = {
    "direct": Route(OpenAIChat, "openai/m", "/v1", "direct"),
    "openai": Route(OpenAIChat, "openai/m", "/v1", "litellm"),
    "vllm": Route(OpenAIChat, "hosted_vllm/m", "/v1", "litellm"),
    "anthropic": Route(AnthropicMessages, "anthropic/claude-3-7-sonnet-20250219", "", "litellm"),
    "gemini": Route(GeminiGenerate, "gemini/gemini-2.5-flash", "", "litellm"),
}
