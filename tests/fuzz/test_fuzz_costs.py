"""Costs under whatever usage a server reports: what is spent stays within what the docs promise."""

from __future__ import annotations

import json
import random
from collections import Counter
from typing import Any

import pytest

from tests.fuzz.sizes import FAULTS, SEED
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

PRICE = {"input": 10.0, "output": 100.0}
_ROUNDS = -(-FAULTS // 40)


class Moody(OpenAIChat):
    """Counts up to ninety times the tokens that are expected, and knows what it billed."""

    def __init__(self, draw: random.Random) -> None:
        super().__init__()
        self._draw = draw
        self.billed_usd = 0.0

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        prompt, completion = (int(10 ** self._draw.uniform(1, most)) for most in (4.4, 4.9))
        self.billed_usd += (prompt * PRICE["input"] + completion * PRICE["output"]) / 1e6
        usage = {"prompt_tokens": prompt, "completion_tokens": completion}
        return {**super().reply(seen, ending), "usage": usage}


@pytest.mark.fuzz
@pytest.mark.parametrize("number", range(_ROUNDS))
def test_no_more_is_spent_than_the_limit_and_what_was_under_way(
    workspace: Workspace, tallies: dict[str, Counter[str]], number: int
) -> None:
    draw = random.Random(f"{SEED} costs {number}")
    limit = 10 ** draw.uniform(-1, 2)
    with Running(Moody(draw)) as running:
        server = running.server
        workspace.write_models(running.url, "alpha", price=PRICE, max_tokens=999)
        workspace.write_suite(models=["alpha"], seeds=list(range(8)))
        done = workspace.run("--set", f"limits.max_cost_usd={limit}")
        assert done.code in (0, 1), done.err
    ended: dict[int, float] = {}
    sent: set[int] = set()
    spent_at_last = 0.0
    for line in (workspace.out / "calls.jsonl").read_text(encoding="utf-8").splitlines():
        call = json.loads(line)
        if call.get("ended"):
            ended[call["call"]] = call["billed_usd"]
        else:
            sent.add(call["call"])
            spent_at_last = sum(ended.values())
            assert len(sent) - len(ended) <= 1 + len(ended), "more at once than were answered"
    assert spent_at_last <= limit + 1e-9, "a call was sent beyond the limit"
    assert sum(ended.values()) == pytest.approx(server.billed_usd), "spend is not what was billed"
    tallies.setdefault("costs", Counter()).update({"calls": len(sent), "stopped": done.code})
