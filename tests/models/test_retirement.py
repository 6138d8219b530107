"""What is known of the ends of models."""

from __future__ import annotations

from datetime import date

import pytest

from phyblock.config.models import ModelConfig
from phyblock.models import ends_on, is_unlisted
from phyblock.models.cost import map_entry


def config(model_id: str, **fields: object) -> ModelConfig:
    return ModelConfig(name="m", id=model_id, **fields)  # type: ignore[arg-type]


def test_a_day_that_the_map_names_is_read() -> None:
    dated = config("openai/gpt-4o-2024-08-06")
    said = map_entry(dated)["deprecation_date"]
    assert ends_on(dated) == date.fromisoformat(said)
    assert not is_unlisted(dated)


@pytest.mark.parametrize(
    ("asked", "unlisted"),
    [
        (config("openai/no-such-model"), True),
        (config("openai/no-such-model", api_base="http://localhost:1/v1"), False),
        (config("hosted_vllm/no-such-model"), False),
        (ModelConfig(name="oracle"), False),
    ],
)
def test_models_that_the_map_does_not_know_have_no_day(asked: ModelConfig, unlisted: bool) -> None:
    assert ends_on(asked) is None
    assert is_unlisted(asked) == unlisted
