"""Whether two runs can be compared: asked and scored in the same way, about the same things."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from phyblock.errors import Problem, SpecError
from phyblock.records.manifest import ManifestDataset, ManifestQuestions
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.text import counted
from phyblock.tracks.kind import kind_of

__all__ = ["check_alike"]


def check_alike(run: Run, first: Run, cells: Sequence[str], track: str, measure: Measure) -> None:
    """Raise SpecError where `run` cannot be compared with `first` by a measure in these cells.

    The track says what must agree in how the two were asked and scored; scenes of a name must be
    the same.
    """
    _check_version(run, first)
    _check_variants(run, first)
    check = kind_of(track).report().check_alike
    if check is not None:
        check(run, first, cells, measure)
    _check_scenes(run, first)


def _check_version(run: Run, first: Run) -> None:
    """Scenes and questions of two versions of a set may share a name and nothing else."""
    for field in ("dataset", "questions"):
        found, wanted = (getattr(one.manifest, field) for one in (run, first))
        if found is None or wanted is None or _name(found) != _name(wanted):
            continue
        if found.version != wanted.version:
            message = f"is of another version of {_name(found)} than {first.path}"
            versions = str(found.version), str(wanted.version)
            hint = "run the suite again on the newer version"
            raise SpecError(Problem(str(run.path), message, f"{field}.version", *versions, hint))


def _check_variants(run: Run, first: Run) -> None:
    """What a run varies is told from its reference: two that vary otherwise mean other things."""
    found, wanted = (one.design.suite.vary for one in (run, first))
    if found != wanted:
        message = f"asks in other ways than {first.path}"
        said, allowed = (", ".join(vary.factors) or "nothing" for vary in (found, wanted))
        hint = "compare runs that vary the same, in the same order"
        raise SpecError(Problem(str(run.path), message, "vary", said, allowed, hint))


def _name(data: ManifestDataset | ManifestQuestions) -> str:
    return data.name if isinstance(data, ManifestDataset) else Path(data.root).name


def _check_scenes(run: Run, first: Run) -> None:
    blocks = [
        one.records.drop_duplicates("scene").set_index("scene")["n_blocks"] for one in (first, run)
    ]
    both = pd.concat(blocks, axis=1, join="inner", keys=["first", "other"])
    if len(differ := both[both["first"] != both["other"]]):
        message = f"is of other data than {first.path}"
        found = f"other blocks in {counted(len(differ), 'scene')}, the first {differ.index[0]}"
        raise SpecError(Problem(str(run.path), message, "scenes", found))
