"""One tiny call to a model: does it answer, does it see a picture, what does that cost."""

from __future__ import annotations

import io

from PIL import Image as PillowImage

from phyblock.config.models import ModelConfig
from phyblock.models import (
    Image,
    Message,
    Reply,
    Request,
    RetryPolicy,
    build_model,
)

__all__ = ["check_model"]

_SIDE_PX = 64
_QUESTION = "What color is this picture? Answer with one word."


async def check_model(config: ModelConfig) -> Reply:
    """Show the model a small red square and ask for its color; one attempt, nothing cached.

    Raises the ModelError that the call met, SpecError or DataError when the model cannot be built.
    """
    buffer = io.BytesIO()
    PillowImage.new("RGB", (_SIDE_PX, _SIDE_PX), (216, 49, 49)).save(buffer, "PNG")
    picture = Image(buffer.getvalue(), "check", _SIDE_PX, _SIDE_PX)
    messages = (Message("user", (picture, _QUESTION)),)
    request = Request("check", 0, messages, {}, "", None)
    model = build_model(
        config.model_copy(update={"seed": "never", "batch": False}),
        cache=None,
        policy=RetryPolicy(attempts=1, retry_for_s=0.0),
    )
    try:
        reply = await model.ask(request)
    finally:
        await model.aclose()
    return reply or Reply(text="")
