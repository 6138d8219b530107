"""Whether two runs can be compared: asked and scored in the same way, about the same things."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from phyblock.errors import Problem, SpecError
from phyblock.tables.load import Run
from phyblock.tracks.vqa.answers import showing

__all__ = ["check_alike"]


def check_alike(run: Run, first: Run, parts: Sequence[str], track: str) -> None:
    """Raise SpecError where `run` cannot be compared with `first` in these parts of a track.

    It must have been scored in its headline setting (and for plans by its matcher and criteria),
    or have been asked the same questions and count them alike; scenes of a name must be the same.
    """
    if track == "vqa":
        _check_questions(run, first)
    else:
        _check_scores(run, first, parts, track)
    _check_scenes(run, first)


def _check_scores(run: Run, first: Run, parts: Sequence[str], track: str) -> None:
    suite, wanted = run.design.suite, first.design
    needed: list[tuple[str, Sequence[str], str]] = [("settings", suite.settings, wanted.setting)]
    if track == "full_planning":
        needed.append(("scoring.matchers", suite.scoring.matchers, wanted.matcher))
        known = ("aov", suite.scoring.level1)
        needed += [("scoring.level1", known, wanted.criterion(level)) for level in parts]
    for what, names, name in needed:
        if name not in names:
            hint = "phyblock score reads stored replies again under other rules"
            message = f"was not scored as {first.path} was, by {name}"
            raise SpecError(Problem(str(run.path), message, what, ", ".join(names), hint=hint))


def _check_questions(run: Run, first: Run) -> None:
    circular = [showing(one).circular for one in (run, first)]
    if circular[0] != circular[1]:
        found, allowed = (str(one).lower() for one in circular)
        message = f"counts right answers in another way than {first.path}"
        raise SpecError(Problem(str(run.path), message, "vqa.circular", found, allowed))
    # Digests of the sets that questions were chosen from.
    sets = [one.manifest.get("tracks", {}).get("vqa", {}).get("questions") for one in (run, first)]
    if sets[0] != sets[1]:
        message = f"asked questions of another set than {first.path}"
        raise SpecError(Problem(str(run.path), message, "questions", str(sets[0]), str(sets[1])))


def _check_scenes(run: Run, first: Run) -> None:
    blocks = [
        one.records.drop_duplicates("scene").set_index("scene")["n_blocks"] for one in (first, run)
    ]
    both = pd.concat(blocks, axis=1, join="inner", keys=["first", "other"])
    if len(differ := both[both["first"] != both["other"]]):
        message = f"is of other data than {first.path}"
        found = f"other blocks in {len(differ)} scenes, the first {differ.index[0]}"
        raise SpecError(Problem(str(run.path), message, "scenes", found))
