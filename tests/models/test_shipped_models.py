"""The models that come with the project: known to litellm's map, in groups, asked as they want."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from phyblock.config.models import ModelConfig, group_names, load_models
from phyblock.config.suite import Suite
from phyblock.models import ends_on
from phyblock.models.costs import map_entry
from phyblock.models.keys import KEYLESS
from phyblock.run.plan import to_config
from tests.models.factory import ROUTES, make_model, make_request, reply_of
from tests.servers.chassis import Running

AS_OF = date(2026, 11, 22)
"""The day of which models.yaml speaks."""
MODELS = load_models(Path(__file__).parents[2] / "models.yaml")
SUITE = Suite(name="s", models=("m",))

MAKERS = {
    "frontier": {
        *("openai", "anthropic", "gemini", "xai", "mistral", "dashscope", "zai", "moonshot"),
        *("meta", "novita/meta-llama"),
    },
    "open": {"Qwen", "OpenGVLab", "zai-org", "google", "allenai", "meta-llama"},
}


def config(name: str, spec: ModelConfig) -> ModelConfig:
    return to_config(name, spec, SUITE)


def of_group(group: str) -> dict[str, ModelConfig]:
    return {name: spec for name, spec in MODELS.items() if group in spec.groups}


def faults(models: Mapping[str, ModelConfig]) -> Iterator[str]:
    """Return objections of litellm's map to models that their providers serve.

    Servers of one's own serve what they like: the map knows none of them.
    """
    for name, spec in models.items():
        asked = config(name, spec)
        if asked.provider in KEYLESS:
            continue
        entry, end = map_entry(asked), ends_on(asked)
        if not entry:
            yield f"{name} ({asked.id}) is unknown"
        elif end is not None and end <= AS_OF:
            yield f"{name} ({asked.id}) is retired since {end}"
        elif not entry.get("supports_vision") or entry.get("mode") != "chat":
            yield f"{name} ({asked.id}) is shown no pictures, or does not chat"


def test_current_models_are_served_and_look_at_pictures() -> None:
    assert list(faults(of_group("frontier") | of_group("open"))) == []


def test_every_model_is_in_a_group_and_every_line_is_there() -> None:
    assert group_names(MODELS) == ("paper", "frontier", "open")
    assert all(len(spec.groups) == 1 for spec in MODELS.values())
    assert {name for name, spec in MODELS.items() if spec.published} == set(of_group("paper"))
    ids = {group: [str(spec.id) for spec in of_group(group).values()] for group in MAKERS}
    ids["open"] = [model_id.partition("/")[2] for model_id in ids["open"]]
    for group, makers in MAKERS.items():
        assert {m for m in makers if not any(i.startswith(f"{m}/") for i in ids[group])} == set()


def test_what_thinks_has_room_for_it() -> None:
    for name, spec in of_group("frontier").items():
        thinks = map_entry(config(name, spec)).get("supports_reasoning")
        assert not thinks or (spec.max_tokens or 0) > 8192


@pytest.mark.parametrize("name", of_group("frontier"))
def test_each_is_asked_through_litellm_with_what_it_takes(name: str) -> None:
    shipped = config(name, MODELS[name])
    route = ROUTES.get(shipped.provider, ROUTES["openai"])
    server = route.server()
    with Running(server) as running:
        given = shipped.model_dump(
            include=shipped.model_fields_set - {"addresses", "api_key_env"}, by_alias=True
        )
        at = route.config(running.url, **{**given, "transport": "litellm"})
        request = replace(make_request(), params={})
        reply_of(make_model(at), request)
    (seen,) = server.seen
    limits = ("max_tokens", "max_completion_tokens", "max_output_tokens")
    assert [seen.params[key] for key in limits if key in seen.params] == [
        MODELS[name].with_defaults(SUITE.sampling.model_dump()).params["max_tokens"]
    ]
    if map_entry(shipped).get("supports_sampling_params") is False:
        assert not {"temperature", "top_p"} & shipped.params.keys()
        # litellm sends Gemini the temperature that it has anyway.
        assert seen.params.get("temperature", 1.0) == 1.0
