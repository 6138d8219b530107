"""Ways to break what a command is given; each leaves the command line to try."""

from __future__ import annotations

import io
import json
import os
import sqlite3
from collections.abc import Callable
from contextlib import closing

import yaml
from PIL import Image as PillowImage

from tests.data.broken import sound_scene, with_value, write_checkout
from tests.workspace import Raw, Workspace, tower

Prepare = Callable[[Workspace], list[str]]
RUN = ["run", "suite.yaml", "--out", "out"]
FRESH = ["run", "suite.yaml", "--out", "fresh"]
FAKE_KEY = "sk-" + "x1" * 12


def after(change: Callable[[Workspace], object], *args: str) -> Prepare:
    """Something is changed, and then this command is given."""

    def prepare(workspace: Workspace) -> list[str]:
        change(workspace)
        return list(args)

    return prepare


def file(name: str, content: str | bytes, *args: str) -> Prepare:
    """A file holds this, whatever it was."""

    def change(workspace: Workspace) -> None:
        path = workspace.root / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())

    return after(change, *args)


def lines(name: str, change: Callable[[list[str]], list[str]], *args: str) -> Prepare:
    """The lines of a file are changed."""

    def changed(workspace: Workspace) -> None:
        path = workspace.root / name
        texts = change(path.read_text(encoding="utf-8").splitlines())
        path.write_text("".join(text + "\n" for text in texts), encoding="utf-8")

    return after(changed, *args)


def suite_text(text: str) -> Prepare:
    """The suite is this text."""
    return file("suite.yaml", text, *RUN)


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
    return lines("data/scenes.jsonl", change, *RUN)


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
    return file("mine.j2", user_block("Build it."), verb, "mine.j2")


def user_block(text: str) -> str:
    """A template whose second line is `text`, in a user block."""
    return f"{{% block user %}}\n{text}\n{{% endblock %}}"


def models_text(text: str) -> Prepare:
    """`models.yaml` is this text."""
    return file("models.yaml", text, *FRESH)


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
    return file(name, bytes(range(256)) * 40_000, *args)


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


def broken_record(change: Callable[[str], str], *args: str) -> Prepare:
    """The second of the finished run's records is changed."""
    return lines(
        "out/records.jsonl", lambda them: [them[0], change(them[1]), *them[2:]], *(args or RUN)
    )


def without_field(field: str) -> Callable[[str], str]:
    """A record's line without one of its fields."""

    def change(line: str) -> str:
        record: Raw = json.loads(line)
        del record[field]
        return json.dumps(record)

    return change


def manifest_without(field: str, *args: str) -> Prepare:
    """The finished run's manifest lacks a field."""

    def change(workspace: Workspace) -> None:
        manifest: Raw = yaml.safe_load((workspace.out / "run.yaml").read_text(encoding="utf-8"))
        del manifest[field]
        workspace.write_yaml("out/run.yaml", manifest)

    return after(change, *args)


def file_in_the_way(*args: str) -> Prepare:
    """A file `taken` stands where the command line names a folder."""
    return file("taken", "mine", *args)


def foreign_cache(workspace: Workspace) -> None:
    """The reply cache is a database of another schema."""
    path = workspace.cache / "replies.sqlite"
    path.unlink()
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE theirs (x)")
        database.commit()


def changed_colors(texts: list[str]) -> list[str]:
    """Lines of scenes with as many blocks, of another color."""
    return [
        text.replace('"red"', '"#"').replace('"blue"', '"red"').replace('"#"', '"blue"')
        for text in texts
    ]


def many_files(workspace: Workspace) -> list[str]:
    """Three files, each with a problem of its own."""
    workspace.write_yaml("bad-suite.yaml", {"name": "trial", "models": ["nobody"], "dataset": {}})
    (workspace.root / "bad-models.yaml").write_text("mine: nowhere\n", encoding="utf-8")
    return ["validate", "bad-suite.yaml", "bad-models.yaml", "absent.yaml"]
