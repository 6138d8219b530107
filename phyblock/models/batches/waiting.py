"""Which requests of a model are not to be asked again, as batches of earlier commands have them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from phyblock.config.models import ModelConfig
from phyblock.models.batches.choice import batch_protocol
from phyblock.models.batches.ledger import Batch, BatchFiles, Ledger
from phyblock.models.batches.results import Results
from phyblock.models.client import Answer
from phyblock.records.record import BatchLine

__all__ = ["waiting_keys"]


def waiting_keys(
    config: ModelConfig, lines: Sequence[BatchLine], run_folder: Path
) -> frozenset[str]:
    """Requests by their keys in the reply cache: of batches that have not ended all, of others
    those that were answered. What failed in them is asked again.
    """
    files = BatchFiles(tuple(lines), _write_nothing, run_folder)
    batches = Ledger(config.name, files).batches.values()
    return frozenset(key for batch in batches for key in _waiting(batch, config, files))


def _waiting(batch: Batch, config: ModelConfig, files: BatchFiles) -> Iterator[str]:
    path = files.answers(batch.token)
    # Without its answers a batch stops its model: nothing of it is asked again.
    if batch.event != "ended" or not path.is_file():
        yield from batch.places
        return
    results = Results(path, batch_protocol(config, ()), batch.token, len(batch.places))
    for key, place in batch.places.items():
        line = results.of(place)
        if line is not None and isinstance(line.answer, Answer) and line.answer.is_success:
            yield key


async def _write_nothing(line: BatchLine) -> None:
    raise AssertionError(f"only read here: {line.event}")
