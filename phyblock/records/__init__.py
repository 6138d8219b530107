"""Every line and file of runs and data that is written and read again, each declared once.

A model of a line reads it, says what is wrong with it, writes it and documents itself.
"""

from phyblock.records.belonging import Belonging
from phyblock.records.line import Line
from phyblock.records.lines import (
    BATCHES,
    PROMPTS,
    RECORDS,
    TURNS,
    BatchLines,
    Lines,
    PromptLines,
    TurnLines,
)
from phyblock.records.manifest import FORMAT, MANIFEST, Manifest, read_manifest
from phyblock.records.others import BatchLine, PictureMark, Prompt, PromptMessage, Turn
from phyblock.records.record import (
    AskedTurn,
    Course,
    Extraction,
    Record,
    Recorded,
    Score,
    SentImage,
    SentPrompt,
    ShownScene,
)
from phyblock.records.record_lines import RecordedLines
from phyblock.records.reply import Reply, StoredError, Usage
from phyblock.records.stopped import STOPPED, Stopped, read_stopped

__all__ = [
    "BATCHES",
    "FORMAT",
    "MANIFEST",
    "PROMPTS",
    "RECORDS",
    "STOPPED",
    "TURNS",
    "AskedTurn",
    "BatchLine",
    "BatchLines",
    "Belonging",
    "Course",
    "Extraction",
    "Line",
    "Lines",
    "Manifest",
    "PictureMark",
    "Prompt",
    "PromptLines",
    "PromptMessage",
    "Record",
    "Recorded",
    "RecordedLines",
    "Reply",
    "Score",
    "SentImage",
    "SentPrompt",
    "ShownScene",
    "Stopped",
    "StoredError",
    "Turn",
    "TurnLines",
    "Usage",
    "read_manifest",
    "read_stopped",
]
