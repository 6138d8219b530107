"""A scripted person at the page, in a real browser: mouse, keys, a phone, a kill, no server.

What is answered here is a script's, to test the page: it says nothing of what people can do.
"""

import re
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.fork_server import Forked
from tests.web.conftest import LOOK, Visit
from tests.workspace import SCENES, plan_text, questions, read_lines, until, write_questions

SUBTASKS = ("SH", "OR", "AD", "VP")
PHONE = {"width": 390, "height": 780}
HOSTILE = "<img src=x onerror=alert(1)></script><script>alert(2)</script>"


@pytest.fixture(scope="module")
def workspace(new_workspace):
    """Three scenes, with poses and without, four hostile questions, and a run of two baselines."""
    made = new_workspace(*SCENES[:3])
    asked = questions(SCENES[:2], 1, SUBTASKS)
    for one in asked:
        one["question"] += HOSTILE
        one["options"] = [o if o.startswith("<img") else f"{o} {HOSTILE}" for o in one["options"]]
    write_questions(made.root / "questions", asked)
    made.write_suite(
        tracks=["full_planning", "vqa", "pose_planning"],
        vqa={"path": "./questions", "subtasks": list(SUBTASKS)},
        seeds=[3, 4],
    )
    started = made.root / "browser"
    started.write_text('#!/bin/sh\necho "$1" > opened.new && mv opened.new opened\n')
    started.chmod(0o755)
    made.env["BROWSER"] = f"{started} %s"
    made.completed()
    return made


@contextmanager
def sitting(browser, workspace, **options):
    """A page at the address that a browser is started with; it asks for nothing elsewhere."""
    command = ["play", "suite.yaml", "--name", "ada", "--out", "ada", "--beside", "out"]
    with Forked(command, workspace.root, workspace.env) as process:
        try:
            line = process.stdout.readline()
            printed = re.search(r"(http://127\.0\.0\.1:\d+/)(\S+)/", line)
            assert printed, line
            note = workspace.root / "opened"
            until(note.exists)
            address = note.read_text().strip()
            note.unlink()
            # Others on the machine can read what a browser is started with.
            assert printed[2] not in address
            context = browser.new_context(**options)
            visit = Visit(context.new_page())
            visit.page.goto(address)
            visit.page.locator("#main h1").wait_for()
            assert visit.page.url == printed[0]
            yield visit, process
            assert visit.asked_elsewhere(address, printed[0]) == []
            visit.page.close()
        finally:
            process.kill()


def task(page, number):
    page.get_by_text(f"Task {number} of 10").wait_for()
    page.locator(".answer").wait_for()


def answered(folder):
    path = folder / "records.jsonl"
    lines = read_lines(path) if path.exists() else []
    return [one for one in lines if one["model"] == "human:ada"]


def said(record):
    return record["reply"]["text"]


def test_a_sitting_by_mouse_keys_and_phone_over_a_kill(browser, workspace):
    run = workspace.root / "ada"
    with sitting(browser, workspace, viewport={"width": 1300, "height": 900}) as (visit, process):
        page = visit.page
        begin_with_mouse_and_keys(page, run)
        # Reloading loses no pick; a kill loses the task at hand alone.
        page.keyboard.press("5")
        page.reload()
        task(page, 3)
        assert page.locator(".chips b").all_inner_texts() == ["5"]
        assert not visit.complaints
        process.kill()
        page.get_by_text("has stopped").wait_for()
    assert [*map(said, answered(run))] == [plan_text(3, 7), plan_text(12, 1, 7)]
    phone = {"viewport": PHONE, "has_touch": True, "color_scheme": "dark"}
    with sitting(browser, workspace, **phone) as (visit, process):
        end_on_a_phone(visit.page, run)
        assert process.wait() == 0
        assert not visit.complaints
    # It is scored as any model, and stands beside others.
    before = [{**one, "time": None} for one in answered(run)]
    workspace.does("score", run)
    assert [{**one, "time": None} for one in answered(run)] == before
    workspace.does("compare", run, "out", "--models", "human:ada,oracle")


def begin_with_mouse_and_keys(page, run):
    page.get_by_role("button", name="Begin").click()

    task(page, 1)
    for name in ("Candidate 3", "Candidate 7", "Candidate 12", "Undo"):
        page.get_by_role("button", name=name).first.click()
    assert page.locator(".chips b").all_inner_texts() == ["3", "7"]
    assert not answered(run)
    shown = sent_to(page)
    page.get_by_role("button", name="Submit 2 steps").click()
    task(page, 2)
    (first,) = answered(run)
    assert (said(first), first["model"], first["seed"]) == (plan_text(3, 7), "human:ada", 3)
    assert 0 < first["reply"]["latency_s"] < 60
    assert shown == stored_prompt(run, first)

    # By keys alone: 1 might be the beginning of 12, so Enter ends it.
    for key in ("1", "2", "1", "Enter", "9", "Backspace", "7", "Control+Enter"):
        page.keyboard.press(key)
    task(page, 3)
    assert said(answered(run)[1]) == plan_text(12, 1, 7)


def end_on_a_phone(page, run):
    page.get_by_text("Welcome back. 8 tasks of 10 are left").wait_for()
    page.get_by_role("button", name="Begin").tap()
    task(page, 3)
    fits_the_phone(page)
    # Goal and candidates one below the other, without the line that is between them.
    halves = [one.bounding_box() for one in page.locator(".window:visible").all()]
    assert [half and round(half["height"] - half["width"]) for half in halves] == [0, 0]
    for name in ("Candidate 16", "Pause"):
        page.get_by_role("button", name=name).tap()
    page.get_by_role("heading", name="Paused").wait_for()
    assert page.locator("img").count() == 0
    for name in ("Continue", "Submit 1 step"):
        page.get_by_role("button", name=name).tap()
    for number in range(4, 8):
        task(page, number)
        fits_the_phone(page)
        if page.get_by_role("button", name="Clear").count():
            page.keyboard.type("badc")
        elif page.locator(".spot").count():
            page.locator(".spot").nth(2).tap()
        else:
            page.locator(".choice").nth(1).tap()
        page.get_by_role("button", name=re.compile("^Submit")).tap()
    give_places_by_touch(page)
    give_places_by_keys(page)
    task(page, 10)
    page.get_by_role("button", name="Candidate 1").first.tap()
    for name in "xyz":
        page.get_by_label(f"{name}, cm of step 1").fill("0")
    page.get_by_role("button", name="Submit 1 step").tap()
    page.get_by_role("heading", name="How it went").wait_for()
    assert len(answered(run)) == 10
    placed = ("3 at (0, 0, 2.5)", "5 at (-0.5, 1.25, 5)", "1 at (0, 0, 0)")
    assert [*map(said, answered(run)[7:])] == [f"Step1: block {one}" for one in placed]
    assert {record["question"]["subtask"]: said(record) for record in answered(run)[3:7]} == {
        "SH": "Answer: B",
        "AD": "Answer: B",
        "VP": "Answer: C",
        "OR": "Answer: B, A, D, C",
    }
    text = page.inner_text("#main")
    assert "It first broke at step 1" in text
    assert "You 0.0" in page.locator(".finding").first.inner_text()
    page.get_by_text("All means").first.tap()
    assert "oracle\t100.0" in page.locator("table").first.inner_text()
    built = page.get_by_alt_text("what you built")
    # Of three plans and three plans with poses.
    assert built.count() == 6
    for picture in (built.first, built.last):
        picture.scroll_into_view_if_needed()
        assert picture.evaluate("image => image.decode().then(() => image.naturalWidth)") == 648
    with page.expect_download() as download:
        page.get_by_role("link", name="Save a picture").tap()
    assert Path(download.value.path()).read_bytes().startswith(b"\x89PNG")
    fits_the_phone(page)
    with page.expect_popup() as popup:
        page.get_by_role("link", name="Replay").first.click()
    popup.value.wait_for_selector(".detail .card")
    popup.value.close()
    page.get_by_role("button", name="Finish").tap()


def give_places_by_touch(page):
    """The browser says what is no number of a field; picks are removed, and all is undone."""
    task(page, 8)
    fits_the_phone(page)
    for name in ("Candidate 7", "Candidate 3", "Remove step 2", "Undo"):
        page.get_by_role("button", name=name).first.tap()
    rows = page.locator(".chips .chip")
    assert [row.get_attribute("aria-label") for row in rows.all()] == ["step 1: 7", "step 2: 3"]
    page.get_by_role("button", name="Remove step 1").tap()
    x, y, z = (page.get_by_label(f"{name}, cm of step 1") for name in "xyz")
    submit = page.get_by_role("button", name="Submit 1 step")
    for wrong in ("", "1000.5", "0.001"):
        x.fill(wrong)
        submit.tap()
        assert not x.evaluate("input => input.validity.valid")
    x.fill("0")
    y.fill("0")
    z.focus()
    for _ in range(5):
        page.keyboard.press("ArrowUp")
    submit.tap()


def give_places_by_keys(page):
    """Numbers of blocks by name, of places by arrows, over a reload in the middle of it."""
    task(page, 9)
    page.keyboard.press("5")
    page.get_by_label("x, cm of step 1").focus()
    for key in ("ArrowDown", "Tab", *"1.25", "Tab", "PageUp"):
        page.keyboard.press(key)
    page.reload()
    task(page, 9)
    assert page.get_by_label("y, cm of step 1").input_value() == "1.25"
    page.keyboard.press("Control+Enter")


def fits_the_phone(page):
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]


def sent_to(page):
    """Texts of the prompt, which is one click away, and digests of the bytes of the pictures."""
    page.get_by_text("The model's exact prompt").click()
    shown = page.locator("details .text").all_inner_texts()
    texts = [text for text in shown if not text.startswith("[picture: ")]
    images = page.locator("figure img").all()
    return [*texts, *{image.evaluate(f"image => {LOOK}.digest(image)") for image in images}]


def stored_prompt(run, record):
    prompts = {line["sha256"]: line for line in read_lines(run / "prompts.jsonl")}
    messages = prompts[record["prompt"]["messages"]]["messages"]
    parts = [part for message in messages for part in message["parts"]]
    texts = [part for part in parts if isinstance(part, str)]
    return [*texts, *(image["sha256"] for image in record["prompt"]["images"])]


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--name", "Ada Lovelace"], "--name: is not a valid name"),
        (["--name", "x", "--beside", "nowhere"], "nowhere"),
        (["--name", "x", "--set", "vary.repeats=2"], "varies its presentation"),
    ],
)
def test_what_cannot_be_played_is_said_before_anything_is_begun(workspace, words, error):
    before = sorted(workspace.root.rglob("*"))
    done = workspace.phyblock("play", "suite.yaml", "--no-browser", *words)
    assert done.code == 2, done.out
    assert error in done.err
    assert "Traceback" not in done.err
    assert sorted(workspace.root.rglob("*")) == before
