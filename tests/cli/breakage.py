"""Ways to break what a command is given; each leaves the command line to try."""

from __future__ import annotations

import io
import json
import os
import shutil
import sqlite3
from collections.abc import Callable

import yaml
from PIL import Image as PillowImage

from tests.data.broken import sound_scene, with_value, write_checkout
from tests.workspace import Raw, Workspace, tower

Prepare = Callable[[Workspace], list[str]]
RUN = ["run", "suite.yaml", "--out", "out"]
FRESH = ["run", "suite.yaml", "--out", "fresh"]
FAKE_KEY = "sk-" + "x1" * 12


def suite_text(text: str) -> Prepare:
    """The suite is this text."""

    def prepare(workspace: Workspace) -> list[str]:
        (workspace.root / "suite.yaml").write_text(text, encoding="utf-8")
        return RUN

    return prepare


def suite_line(line: str) -> Prepare:
    """The suite is sound but for one more line."""
    sound = ("name: trial", "models: [random]", "dataset: {path: ./data}")
    kept = [other for other in sound if other.split(":")[0] != line.split(":")[0]]
    return suite_text("\n".join([*kept, line, ""]))


def options(*more: str) -> Prepare:
    """A sound suite, and these options."""
    return lambda _: [*RUN, *more]


def command(*args: str) -> Prepare:
    """Another command."""
    return lambda _: list(args)


def scenes_text(change: Callable[[list[str]], list[str]]) -> Prepare:
    """The lines of `scenes.jsonl` are changed."""

    def prepare(workspace: Workspace) -> list[str]:
        path = workspace.root / "data" / "scenes.jsonl"
        lines = change(path.read_text(encoding="utf-8").splitlines())
        path.write_text("".join(line + "\n" for line in lines), encoding="utf-8")
        return RUN

    return prepare


def second_scene(at: str, value: object) -> Prepare:
    """A value of the second scene is replaced."""
    changed = json.dumps(with_value(tower("t2", [2], ("red", "blue")), at, value))
    return scenes_text(lambda lines: [lines[0], changed, *lines[2:]])


def template(text: str | None) -> Prepare:
    """The prompt is a template with this text, or one that is not there."""

    def prepare(workspace: Workspace) -> list[str]:
        if text is not None:
            (workspace.root / "mine.j2").write_text(text, encoding="utf-8")
        workspace.write_suite(models=["alpha"], prompt="mine.j2")
        return FRESH

    return prepare


def template_alone(verb: str) -> Prepare:
    """A template stands where a suite belongs."""

    def prepare(workspace: Workspace) -> list[str]:
        (workspace.root / "mine.j2").write_text(user_block("Build it."), encoding="utf-8")
        return [verb, "mine.j2"]

    return prepare


def user_block(text: str) -> str:
    """A template whose second line is `text`, in a user block."""
    return f"{{% block user %}}\n{text}\n{{% endblock %}}"


def models_text(text: str) -> Prepare:
    """`models.yaml` is this text."""

    def prepare(workspace: Workspace) -> list[str]:
        (workspace.root / "models.yaml").write_text(text, encoding="utf-8")
        return FRESH

    return prepare


def png(size: tuple[int, int] = (64, 32)) -> bytes:
    """A small picture."""
    buffer = io.BytesIO()
    PillowImage.effect_noise(size, 50).save(buffer, "PNG")
    return buffer.getvalue()


def pipe(name: str, *args: str) -> Prepare:
    """A pipe without a writer stands where a file belongs."""

    def prepare(workspace: Workspace) -> list[str]:
        (workspace.root / name).unlink(missing_ok=True)
        os.mkfifo(workspace.root / name)
        return list(args)

    return prepare


def noise(name: str, *args: str) -> Prepare:
    """Ten megabytes that are no text stand in a file."""

    def prepare(workspace: Workspace) -> list[str]:
        (workspace.root / name).write_bytes(bytes(range(256)) * 40_000)
        return list(args)

    return prepare


def checkout(picture: bytes | None) -> Prepare:
    """A checkout of the official layout with one picture, or none."""

    def prepare(workspace: Workspace) -> list[str]:
        root = write_checkout(workspace.root / "official", {**sound_scene(), "id": "000"})
        if picture is not None:
            folder = root / "data" / "SCENEs_400_Goal_and_Cand_Imgs_resized"
            folder.mkdir()
            (folder / "000.png").write_bytes(picture)
        workspace.write_suite(
            dataset={"format": "official", "path": "official"},
            images={"source": "dataset"},
            models=["alpha"],
        )
        return FRESH

    return prepare


def recording(content: str | None) -> Prepare:
    """A model of recorded replies with this file, or with no folder at all."""

    def prepare(workspace: Workspace) -> list[str]:
        if content is not None:
            folder = workspace.root / "replies"
            folder.mkdir()
            (folder / "t1.json").write_text(content, encoding="utf-8")
        workspace.write_yaml("models.yaml", {"old": {"replay": "replies"}})
        workspace.write_suite(models=["old"])
        return FRESH

    return prepare


def earlier_run(name: str, text: str) -> Prepare:
    """A file of the finished run is this text, and the same command is given again."""

    def prepare(workspace: Workspace) -> list[str]:
        (workspace.out / name).write_text(text, encoding="utf-8")
        return RUN

    return prepare


def broken_record(change: Callable[[str], str], *args: str) -> Prepare:
    """The second of the finished run's records is changed."""

    def prepare(workspace: Workspace) -> list[str]:
        path = workspace.out / "records.jsonl"
        lines = path.read_text(encoding="utf-8").splitlines()
        lines[1] = change(lines[1])
        path.write_text("".join(line + "\n" for line in lines), encoding="utf-8")
        return list(args) or RUN

    return prepare


def without_field(field: str) -> Callable[[str], str]:
    """A record's line without one of its fields."""

    def change(line: str) -> str:
        record: Raw = json.loads(line)
        del record[field]
        return json.dumps(record)

    return change


def manifest_without(field: str, *args: str) -> Prepare:
    """The finished run's manifest lacks a field."""

    def prepare(workspace: Workspace) -> list[str]:
        path = workspace.out / "run.yaml"
        manifest: Raw = yaml.safe_load(path.read_text(encoding="utf-8"))
        del manifest[field]
        path.write_text(yaml.safe_dump(manifest), encoding="utf-8")
        return list(args)

    return prepare


def cache_file(content: bytes | None, *args: str) -> Prepare:
    """The reply cache is these bytes, or a database of another schema."""

    def prepare(workspace: Workspace) -> list[str]:
        path = workspace.cache / "replies.sqlite"
        path.unlink()
        if content is not None:
            path.write_bytes(content)
        else:
            database = sqlite3.connect(path)
            database.execute("CREATE TABLE theirs (x)")
            database.commit()
            database.close()
        return list(args) or [*FRESH, "--models", "alpha"]

    return prepare


def file_in_the_way(*args: str) -> Prepare:
    """A file `taken` stands where the command line names a folder."""

    def prepare(workspace: Workspace) -> list[str]:
        (workspace.root / "taken").write_text("mine", encoding="utf-8")
        return list(args)

    return prepare


def pictures_taken(workspace: Workspace) -> list[str]:
    """A file stands where pictures are to be kept."""
    (workspace.root / "c2").mkdir()
    (workspace.root / "c2" / "pictures").write_text("mine", encoding="utf-8")
    return [*FRESH, "--models", "alpha"]


def changed_data(workspace: Workspace) -> list[str]:
    """The data set is not what the run was made on: as many blocks, of another color."""
    path = workspace.root / "data" / "scenes.jsonl"
    text = path.read_text(encoding="utf-8").replace('"red"', '"#"')
    path.write_text(text.replace('"blue"', '"red"').replace('"#"', '"blue"'), encoding="utf-8")
    return ["score", "out"]


def scores_over_run(workspace: Workspace) -> list[str]:
    """The new scores are to go where another run is."""
    shutil.copytree(workspace.out, workspace.root / "precious")
    return ["score", "out", "--out", "precious"]


def no_manifest(workspace: Workspace) -> list[str]:
    """Records whose manifest was deleted."""
    (workspace.out / "run.yaml").unlink()
    return RUN


def lost_data(workspace: Workspace) -> list[str]:
    """The data set of the run is gone."""
    (workspace.root / "data").rename(workspace.root / "moved")
    return ["score", "out"]


def many_files(workspace: Workspace) -> list[str]:
    """Three files, each with a problem of its own."""
    workspace.write_yaml("bad-suite.yaml", {"name": "trial", "models": ["nobody"], "dataset": {}})
    (workspace.root / "bad-models.yaml").write_text("mine: nowhere\n", encoding="utf-8")
    return ["validate", "bad-suite.yaml", "bad-models.yaml", "absent.yaml"]
