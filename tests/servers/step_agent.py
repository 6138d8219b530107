"""A served model that plans step by step: what it says depends on what it is shown alone."""

from __future__ import annotations

import hashlib
import json
import re
from typing import Any

from tests.servers.chassis import Seen
from tests.servers.openai_chat import OpenAIChat

_HISTORY = re.compile(r"^\d+\. (?P<operation>.+?)(?:: .*)?$", re.MULTILINE)


class StepAgent(OpenAIChat):
    """Answers `Next plan: Move(N)`, N by a digest of the messages; now and then not readably.

    The digest of a request stands in the reply's reasoning, so that it is found again on disk.
    """

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        if ending == "ok":
            message = body["choices"][0]["message"]
            message["content"] = said(seen)
            message["reasoning_content"] = seen.sample
        return body


def said(seen: Seen) -> str:
    """Return the agent's answer."""
    digest = hashlib.sha256(json.dumps([seen.system, seen.parts]).encode()).digest()
    if digest[0] < 20:
        return "I would rather not say."
    return f"The base comes first.\nNext plan: Move({digest[1] % 5 + 1})"


def told_history(seen: Seen) -> list[str]:
    """The operations of the history as it stands in the text of a request."""
    (text,) = [part for part in seen.parts if isinstance(part, str)]
    return [match["operation"] for match in _HISTORY.finditer(text)]
