"""One module a track: what it asks, how replies are read and scored, its baselines and records.

`phyblock.registry` lists the tracks. Outside this package only verbs that belong to one name it.
"""

from phyblock.tracks.base import Episode, Judgement, SceneTrack, Track, kind_of, kinds, open_tracks
from phyblock.tracks.items import Item
from phyblock.tracks.prompts import TemplatePrompt

__all__ = [
    "Episode",
    "Item",
    "Judgement",
    "SceneTrack",
    "TemplatePrompt",
    "Track",
    "kind_of",
    "kinds",
    "open_tracks",
]
