"""One module a track: what it asks, how replies are read and scored, its baselines and records.

`phyblock.registry` lists the tracks. Outside this package only verbs that belong to one name it.
"""

from phyblock.tracks.base import (
    AnyTrack,
    Episode,
    EpisodeTrack,
    Judgement,
    Opening,
    SceneTrack,
    SingleTrack,
    Track,
    kind_of,
    kinds,
    open_tracks,
)
from phyblock.tracks.items import Item
from phyblock.tracks.prompts import TemplatePrompt

__all__ = [
    "AnyTrack",
    "Episode",
    "EpisodeTrack",
    "Item",
    "Judgement",
    "Opening",
    "SceneTrack",
    "SingleTrack",
    "TemplatePrompt",
    "Track",
    "kind_of",
    "kinds",
    "open_tracks",
]
