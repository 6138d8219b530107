"""A sitting as a folder that any browser opens without a server, and that gives a file of answers.

It holds what a person is shown, and nothing that tells what is right: no scene, no name of one, no
answer. Files are numbered in the order of the sitting.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.play.answers import ANSWERS_FORMAT
from phyblock.play.page import assets
from phyblock.play.person import Person, picking_of
from phyblock.play.shown import Place, pictures_of, shown
from phyblock.records.manifest import MANIFEST
from phyblock.run.plan import RunPlan
from phyblock.tracks import SingleTrack
from phyblock.tracks.base import shown_item

__all__ = ["check_folder", "check_offline", "export_sitting"]

_PAGE = "index.html"
_PICTURES = "pictures"


def check_offline(plan: RunPlan) -> None:
    """Raise SpecError for tracks whose next request depends on the answer to the last."""
    turned = [track.name for track in plan.tracks if not isinstance(track, SingleTrack)]
    if turned:
        message = "goes turn by turn, which needs the server"
        hint = "leave it out: --set tracks=[...]"
        raise SpecError(Problem("--export", message, "tracks", ", ".join(turned), hint=hint))


def check_folder(folder: Path, runs: Path) -> None:
    """Raise SpecError where the folder holds runs, or is where they are put: who is given the
    folder would be given what is in them.
    """
    places = [folder, *folder.iterdir()] if folder.is_dir() else []
    if folder.resolve() == runs.resolve() or any((one / MANIFEST).exists() for one in places):
        message = "is a folder of runs, which would be handed out with it"
        hint = "name one of its own"
        raise SpecError(Problem("--export", message, found=str(folder), hint=hint))


async def export_sitting(
    plan: RunPlan, person: Person, folder: Path, done: Callable[[int], object]
) -> Path:
    """Write the folder of a plan that passed `check_offline`; the path of its page.

    `done` is called with the number of tasks that are drawn. Raises StoreError where something is
    in the way or the disk refuses.
    """
    config = person.planned().config
    questions: list[dict[str, Any]] = []
    out = OutFolder(folder)
    out.check([*assets("offline.js", _PAGE), "questions.js", f"{_PICTURES}/"])
    with out.alone(), out.making() as new:
        (new / _PICTURES).mkdir()
        for number, sample in enumerate(plan.samples(person.model), 1):
            item = shown_item(sample.track, sample.item, sample.seed)
            track = sample.track
            assert isinstance(track, SingleTrack)
            request = await track.request(item, sample.seed, config.params, with_messages=True)
            names = []
            for place, picture in enumerate(pictures_of(request), 1):
                names.append(f"{_PICTURES}/{number:04d}-{place}.png")
                (new / names[-1]).write_bytes(picture.data)
            place_of = Place(number, plan.samples_per_model)
            questions.append(shown(request, picking_of(request, plan.suite), place_of, names))
            done(number)
        for name, (_, content) in assets("offline.js", _PAGE).items():
            (new / name).write_bytes(content)
        sitting = {
            "head": {
                "format": ANSWERS_FORMAT,
                "run": plan.manifest.identity,
                "model": person.model,
                "consent": person.consent_sha256,
            },
            "name": person.name,
            "text": person.consent,
            "questions": questions,
        }
        script = f"const SITTING = {json.dumps(sitting)};\n"
        (new / "questions.js").write_text(script, encoding="utf-8")
        drawn = {path.relative_to(new).as_posix() for path in (new / _PICTURES).iterdir()}
        # What an earlier sitting left behind may be of scenes that this one does not show.
        out.remove(set(out.names(f"{_PICTURES}/")) - drawn)
    return folder / _PAGE
