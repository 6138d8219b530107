"""Files for frameworks that read their tasks from files: VLMEvalKit and lmms-eval."""

from __future__ import annotations

import base64
import csv
import functools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from PIL import Image

from phyblock.api import Task, tasks
from phyblock.domain.question import LETTERS, is_picture_option
from phyblock.files import OutFolder, writing
from phyblock.integrations.huggingface import question_tasks

TSV_FILES = MCQ_FILE, ORDERING_FILE = "PhyBlock_MCQ.tsv", "PhyBlock_Ordering.tsv"
_COLUMNS = ("index", "question", *LETTERS, "answer", "category", "l2-category", "scene")
_LMMS_TRACKS = ("full_planning", "pose_planning", "vqa")
_LMMS_YAML = """task: phyblock_{track}
dataset_path: json
dataset_kwargs: {{data_files: {{test: {rows}}}}}
test_split: test
output_type: generate_until
doc_to_visual: !function utils.doc_to_visual
doc_to_text: !function utils.doc_to_text
doc_to_target: key
process_results: !function utils.process_results
generation_kwargs: {{max_new_tokens: 4096, temperature: 0, do_sample: false}}
metric_list:
- {{metric: value, aggregation: mean, higher_is_better: true}}
- {{metric: success, aggregation: mean, higher_is_better: true}}
metadata: {{version: 1.0}}
"""
_LMMS_UTILS = """from phyblock.integrations.files import doc_to_text, doc_to_visual, process_results
"""


def write_vlmevalkit(
    folder: Path, questions: str, data: str, limit: int | None, size_px: int
) -> tuple[Path, ...]:
    """Write questions as two TSV files, multiple choice and ordering; return the paths.

    In `$LMUData`, VLMEvalKit recognizes the first by its name as a multiple-choice set. Pictures
    are base64; several are a list, with names in `image_path`. Raises StoreError if the folder
    cannot be written or a file of others would be overwritten, DataError for an unreadable set or
    picture.
    """
    out = OutFolder(folder)
    out.check(TSV_FILES)
    with writing(folder), out.making() as made:
        opened = [(made / name).open("w", newline="", encoding="utf-8") for name in TSV_FILES]
        with opened[0], opened[1]:
            writers = [csv.writer(file, delimiter="\t", lineterminator="\n") for file in opened]
            for writer in writers:
                writer.writerow((*_COLUMNS, "image", "image_path"))
            for task in question_tasks(questions, data, limit, size_px):
                asked, images = task.item.question, task.request().images
                labels = [image.label for image in images]
                coded = [base64.b64encode(image.data).decode() for image in images]
                names = [f"{asked.id}-{label}.png" for label in labels]
                # A picture is named by its place among the sent ones.
                options = [
                    f"Picture {labels.index(letter) + 1}" if is_picture_option(option) else option
                    for letter, option in zip(LETTERS, asked.options, strict=True)
                ]
                about = (asked.subtask, asked.category, asked.scene.id)
                sent = (repr(coded), repr(names)) if len(images) > 1 else (coded[0], names[0])
                row = (asked.id, asked.text, *options, asked.answer_letters, *about, *sent)
                writers[len(asked.answer) > 1].writerow(row)
    return tuple(folder / name for name in TSV_FILES)


def write_lmms_eval(folder: Path, limit: int | None) -> tuple[Path, ...]:
    """Write a task of lmms-eval for each single-turn track, for `--include_path`.

    Raises StoreError if the folder cannot be written.
    """
    texts = {"utils.py": _LMMS_UTILS}
    for track in _LMMS_TRACKS:
        rows = f"{track}.jsonl"
        place = json.dumps(str((folder / rows).absolute()))
        texts[f"{track}.yaml"] = _LMMS_YAML.format(track=track, rows=place)
        keys = (json.dumps({"track": track, "key": one.key}) for one in tasks(track, limit=limit))
        texts[rows] = "".join(f"{line}\n" for line in keys)
    OutFolder(folder).write({name: text.encode() for name, text in texts.items()})
    return tuple(folder / name for name in texts)


_tasks = functools.cache(tasks)


def _task(doc: Mapping[str, str]) -> Task:
    """Return the task of a row of lmms-eval; the tasks of a track are read once."""
    return _tasks(doc["track"])[doc["key"]]


def doc_to_visual(doc: Mapping[str, str]) -> list[Image.Image]:
    """Return the pictures of a row, in the order sent."""
    return [one.convert("RGB") for one in _task(doc).pictures.values()]


def doc_to_text(doc: Mapping[str, str], _: object = None) -> str:
    """Return the text of a row, to be sent after its pictures: the prompt of a run."""
    parts = (part for message in _task(doc).request().messages for part in message.parts)
    return "\n\n".join(part for part in parts if isinstance(part, str))


def process_results(doc: Mapping[str, str], results: Sequence[str]) -> dict[str, float]:
    """Return the measures of a reply."""
    score = _task(doc).score(results[0])
    return {"value": score.value, "success": float(score.success)}
