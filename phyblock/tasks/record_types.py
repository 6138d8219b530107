"""The record of every track: add a track's here, and all that reads records knows it."""

from __future__ import annotations

from phyblock.records import Record, record_adapter
from phyblock.tasks.choice_record import ChoiceRecord
from phyblock.tasks.episode_record import EpisodeRecord
from phyblock.tasks.plan_record import PlanRecord

__all__ = ["RECORD_ADAPTER", "RECORD_TYPES"]

RECORD_TYPES: tuple[type[Record], ...] = (PlanRecord, EpisodeRecord, ChoiceRecord)
RECORD_ADAPTER = record_adapter(RECORD_TYPES)
