"""When providers end their models, as far as litellm's map of the locked version knows."""

from __future__ import annotations

from datetime import date

from phyblock.config.models import ModelConfig
from phyblock.models.keys import KEYLESS
from phyblock.models.price_map import map_entry

__all__ = ["ends_on", "is_unlisted"]


def ends_on(config: ModelConfig) -> date | None:
    """The day from which a model no longer answers; None where the map names none."""
    said = map_entry(config).get("deprecation_date")
    try:
        return date.fromisoformat(str(said))
    except ValueError:
        return None


def is_unlisted(config: ModelConfig) -> bool:
    """Whether a provider's model is not in the map: retired already, or newer than the map."""
    is_hosted = config.kind == "litellm" and not config.has_address
    return is_hosted and config.provider not in KEYLESS and not map_entry(config)
