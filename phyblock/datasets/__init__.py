"""Readers of the data formats: the project's own and the official PhyBlock layout."""

from phyblock.datasets.base import AssemblyTask, Dataset
from phyblock.datasets.builtin import SCENES_FILE, read_builtin
from phyblock.datasets.official import official_prompt, read_official, recorded_models
from phyblock.datasets.salvage import Fault, Salvage, SalvagedTask, salvage

__all__ = [
    "SCENES_FILE",
    "AssemblyTask",
    "Dataset",
    "Fault",
    "Salvage",
    "SalvagedTask",
    "official_prompt",
    "read_builtin",
    "read_official",
    "recorded_models",
    "salvage",
]
