"""The prompt of a suite: a word, or the path of a template."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from phyblock.specs.fields import refuse

__all__ = ["PROMPT_WORDS", "Prompt"]

PROMPT_WORDS = ("default", "official")


def _check_prompt(prompt: str) -> str:
    if prompt in PROMPT_WORDS or prompt.endswith(".j2"):
        return prompt
    raise refuse(
        "is neither a known prompt nor a template",
        allowed="default, official, or the path of a .j2 file",
        words=PROMPT_WORDS,
    )


Prompt = Annotated[
    str,
    AfterValidator(_check_prompt),
    Field(json_schema_extra={"pattern": r"^(default|official|.*\.j2)$"}),
]
