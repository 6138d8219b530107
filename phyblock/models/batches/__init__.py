"""Asking in the batches of providers: slower, cheaper where the provider says so, and never twice.

`protocol` says what a provider's batches are, with a module for each; `ledger` what is on disk;
`sending`, `following` and `results` are a batch's way; `model` is what a run asks.
"""

from phyblock.models.batches.choice import batch_protocol
from phyblock.models.batches.ledger import BatchFiles, remove_unfinished, under_way
from phyblock.models.batches.model import BatchModel, BatchParts
from phyblock.models.batches.waiting import waiting_keys

__all__ = [
    "BatchFiles",
    "BatchModel",
    "BatchParts",
    "batch_protocol",
    "remove_unfinished",
    "under_way",
    "waiting_keys",
]
