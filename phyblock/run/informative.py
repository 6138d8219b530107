"""The scenes of a run that tell models apart best, for asking new models about these alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from phyblock.data import Dataset
from phyblock.data.version import read_version
from phyblock.errors import Problem, SpecError
from phyblock.records.manifest import Manifest, ManifestChoice
from phyblock.run.data import CHANGED, asked_about
from phyblock.scoring.counts import Floats, Metric
from phyblock.scoring.statistics import (
    LEAST_MODELS,
    discrimination,
    pairs_kept,
    pairs_kept_by_choice,
)
from phyblock.tables.load import Run, load_run
from phyblock.tracks.scenes import SceneCounts, scene_counts
from phyblock.tracks.selection import evenly, highest, select_tasks

__all__ = ["choose_informative", "most_informative", "ranks_kept"]


def most_informative(
    value: Metric, levels: Sequence[int], limit: int, counts: Floats
) -> tuple[int, ...]:
    """`limit` scenes, as many of each level as evenly spread ones, that discriminate best.

    `counts` has shape (models, scenes, columns); numbers of scenes are returned. A higher limit
    keeps all that a lower one keeps.
    """
    return tuple(highest(levels, discrimination(value(counts)).tolist(), limit))


def ranks_kept(known: SceneCounts, limit: int) -> tuple[float, float]:
    """Kendall's tau-a of the models' ranks on `limit` scenes and on all: of the most informative
    ones, cross-validated, and of evenly spread ones.

    Cross-validated: whether two models stand in their order is asked of the scenes that all other
    models choose.
    """
    value, counts = known.measure.value, known.counts
    choose = partial(most_informative, value, known.levels, limit)
    evenly_spread = pairs_kept(counts, value, evenly(known.levels, limit))
    return float(pairs_kept_by_choice(counts, value, choose).mean()), float(evenly_spread.mean())


def choose_informative(
    folder: Path, dataset: Dataset, levels: Sequence[int], limit: int | None
) -> ManifestChoice:
    """The `limit` scenes of these levels that discriminate best in the run in `folder`.

    Scenes that not all models of that run were asked about are left out. Raises SpecError without a
    limit, for a run about other data, of too few models or about too few scenes, StoreError for a
    folder that is no run.
    """
    if limit is None:
        hint = "say how many scenes to take: --limit N"
        raise SpecError(Problem("--informative", "needs a limit", hint=hint))
    run = load_run(folder, texts=False)
    _check_data(folder, run.manifest, dataset)
    track = _scene_track(run)
    known = scene_counts(run, track)
    wanted = {task.key for task in select_tasks(dataset.tasks, levels, None)}
    kept = [
        place
        for place, scene in enumerate(known.scenes)
        if scene in wanted and known.present[:, place].all()
    ]
    where = str(folder)
    if len(known.models) < LEAST_MODELS:
        found, allowed = f"{len(known.models)} that replied", f"at least {LEAST_MODELS}"
        message = "has too few models to say what scenes are worth"
        raise SpecError(Problem(where, message, "models", found, allowed))
    if len(kept) <= limit:
        found, allowed = f"{len(kept)}", f"more than {limit}, the limit"
        message = "has too few scenes of these levels that all its models were asked about"
        raise SpecError(Problem(where, message, "scenes", found, allowed))
    known = replace(
        known,
        scenes=tuple(known.scenes[place] for place in kept),
        levels=tuple(known.levels[place] for place in kept),
        n_blocks=tuple(known.n_blocks[place] for place in kept),
        counts=known.counts[:, kept],
        present=known.present[:, kept],
    )
    chosen = most_informative(known.measure.value, known.levels, limit, known.counts)
    tau, tau_even = ranks_kept(known, limit)
    return ManifestChoice(
        run=run.manifest.run,
        track=track,
        measure=known.measure.name,
        models=known.models,
        of=len(known.scenes),
        tau=round(tau, 6),
        tau_even=round(tau_even, 6),
        scenes=tuple(known.scenes[place] for place in chosen),
    )


def _scene_track(run: Run) -> str:
    """The first track of a run whose items are scenes."""
    by_scene = run.records["item"] == run.records["scene"]
    able = set(run.records.loc[by_scene, "track"]) - set(run.records.loc[~by_scene, "track"])
    tracks = run.design.suite.tracks
    for track in tracks:
        if track in able:
            return track
    message = "asked about no whole scenes"
    raise SpecError(Problem(str(run.path), message, "tracks", ", ".join(tracks)))


def _check_data(folder: Path, manifest: Manifest, dataset: Dataset) -> None:
    """Raise SpecError unless the run asked about scenes of this data set as they are now."""
    theirs, where = manifest.dataset, str(folder)
    version = read_version(dataset.root)
    if theirs is None or theirs.version != version:
        found = "none" if theirs is None else f"version {theirs.version} of {theirs.name}"
        allowed = f"version {version} of {dataset.name}"
        raise SpecError(Problem(where, "asked about other data", "dataset", found, allowed))
    digest = asked_about(manifest, manifest.suite.get("levels", ()), dataset).sha256
    if digest != theirs.sha256:
        raise SpecError(Problem(str(dataset.root), CHANGED, "sha256", digest, theirs.sha256))
