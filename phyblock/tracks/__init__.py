"""One folder a track: what it asks, how replies are read and scored, its baselines and measures.

`phyblock.registry` lists the tracks. Outside this package only verbs that belong to one name it.
"""

from phyblock.tracks.base import (
    AnyTrack,
    Episode,
    EpisodeTrack,
    Judgement,
    Opening,
    SingleTrack,
    Track,
    TrackKind,
    judgement_of,
    kind_of,
    kinds,
    open_tracks,
    shown_item,
)
from phyblock.tracks.items import Item
from phyblock.tracks.pictures import Drawing, PicturePolicy, Pictures, Studio
from phyblock.tracks.prompts import OfficialPrompt, Prompt, TemplatePrompt

__all__ = [
    "AnyTrack",
    "Drawing",
    "Episode",
    "EpisodeTrack",
    "Item",
    "Judgement",
    "OfficialPrompt",
    "Opening",
    "PicturePolicy",
    "Pictures",
    "Prompt",
    "SingleTrack",
    "Studio",
    "TemplatePrompt",
    "Track",
    "TrackKind",
    "judgement_of",
    "kind_of",
    "kinds",
    "open_tracks",
    "shown_item",
]
