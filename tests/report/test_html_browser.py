"""The report in a real browser, opened from disk: every view, the keyboard, hostile replies."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest
import yaml

from phyblock import registry, run_suite
from phyblock.results.tables import write_tables
from phyblock.web.leaderboard import write_site
from phyblock.web.report import write_report
from tests.browser import expect
from tests.report.browser import ReportVisit
from tests.report.html_run import HOSTILE, HOSTILE_SAMPLE, many
from tests.tracks.test_added_track import Counting
from tests.workspace import Workspace

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture
def visit(browser: Browser, made: Workspace) -> Iterator[ReportVisit]:
    page = browser.new_page(viewport={"width": 1400, "height": 1000}, color_scheme="light")
    visit = ReportVisit(page, made.out / "report.html")
    yield visit
    page.close()
    assert visit.complaints == []
    assert visit.asked_elsewhere("file://") == []


def painted(page: Page, selector: str) -> int:
    """How many pixels of a canvas are drawn."""
    script = """canvas => {
        const copy = new OffscreenCanvas(canvas.width, canvas.height);
        const context = copy.getContext("2d", { willReadFrequently: true });
        context.drawImage(canvas, 0, 0);
        const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
        return new Uint32Array(data.buffer).filter(pixel => pixel >>> 24).length;
    }"""
    count: int = page.eval_on_selector(selector, script)
    return count


def test_results_stand_in_the_page_before_anything_is_loaded(visit: ReportVisit) -> None:
    page = visit.open()
    assert page.inner_text("h1") == "trial"
    heads = page.locator(".headline h2").all_inner_texts()
    assert {"Full planning", "VQA"} <= set(heads)
    assert "oracle" in page.locator(".headline").first.inner_text()
    assert not any("/report/" in url for url in visit.requests)
    for picture in page.locator(".figures img").all():
        picture.scroll_into_view_if_needed()
        picture.evaluate("image => image.decode()")
    page.get_by_text("Coverage, suite trial").click()
    assert page.get_by_text("Expected").first.is_visible()


def test_numbers_on_the_page_are_rounded_as_in_tables(visit: ReportVisit) -> None:
    """Ties go to even, and what only looks like one when it is printed goes where it lies."""
    page = visit.open()
    values = [sign * n / 32 for n in range(400) for sign in (1, -1) if n] + [
        0.15,
        1.005,
        2.675,
        99.95,
    ]
    for digits in (0, 1, 2):
        script = "([values, digits]) => values.map(value => Words.fixed(value, digits))"
        shown = page.evaluate(script, [values, digits])
        differ = [
            (value, text)
            for value, text in zip(values, shown, strict=True)
            if text.replace("-0", "0") != f"{value:.{digits}f}".replace("-0", "0")
        ]
        assert not differ


def test_numbers_of_headlines_lead_to_the_samples_that_they_were_made_from(
    visit: ReportVisit,
) -> None:
    page = visit.open()
    for track, place, words, count in (
        ("Full planning", 4, "track=full_planning&level=3&model=oracle", 4),
        ("VQA", 2, "track=vqa&subtask=object_property&model=oracle", 4),
    ):
        headline = page.locator(".headline", has_text=track)
        links = headline.locator("tbody tr", has_text="oracle").first.get_by_role("link")
        # The first of a row is its name.
        assert links.nth(place).get_attribute("href") == f"#samples?{words}"
        visit.open(f"samples?{words}")
        assert visit.count() == f"{count} samples"
        visit.open()


def test_a_column_sorts_the_models_of_its_table(visit: ReportVisit) -> None:
    page = visit.open()
    # Baselines alone: a body of models that is empty stays empty, and the order of others too.
    heading = page.get_by_role("button", name="Level 3").first
    heading.click()
    assert page.locator(".headline th[aria-sort=descending]").inner_text().startswith("Level 3")
    heading.click()
    assert page.locator(".headline th[aria-sort=ascending]").count() == 1
    assert visit.hash == "results?sort=full_planning.4.up"


def test_filters_narrow_the_list(visit: ReportVisit) -> None:
    page = visit.open("samples")
    assert visit.count() == "20 samples"
    page.select_option("#filter-model", label="oracle")
    assert visit.count() == "10 samples"
    page.select_option("#filter-seed", label="Seed 1")
    assert visit.count() == "5 samples"
    page.select_option("#filter-level", label="Level 3")
    assert visit.count() == "2 samples"
    page.fill("#search", "T4")
    assert visit.count() == "1 sample"
    page.select_option("#filter-error", label="Overflow")
    assert visit.count() == "No sample passes these filters."
    for name in ("model", "seed", "level", "error"):
        page.select_option(f"#filter-{name}", label="All")
    page.fill("#search", "")
    page.select_option("#filter-outcome", label="Missing")
    assert page.locator(".row-name").all_inner_texts() == ["t4"]
    page.select_option("#filter-outcome", label="All")
    page.select_option("#filter-sort", label="Best first")
    assert page.locator(".row-model").first.inner_text().startswith("oracle")
    page.select_option("#filter-setting", label="B")
    page.locator("#list [role=option]").first.click()
    expect(page.locator("#detail .facts").first).to_contain_text("Setting B")


def test_a_sample_shows_everything_about_it(visit: ReportVisit) -> None:
    visit.show("full_planning/oracle/t5/s0")
    page = visit.page
    assert page.inner_text("#sample-title .title-key") == "t5"
    assert page.locator(".cells li").count() == 16
    assert page.locator(".cells li.needed .cell-uses").all_inner_texts() == [
        f"\N{MULTIPLICATION SIGN}{times}" for times in (1, 1, 2)
    ]
    assert painted(page, "canvas.goal") > 1000
    assert painted(page, ".cells canvas") > 100
    assert painted(page, "canvas.stage") > 1000
    assert "F1 100.0" in page.inner_text(".facts")
    assert page.locator(".strip button.right").count() == 4
    assert "read by the rule" in page.inner_text(".parsed")
    assert "Nothing was sent: oracle is a rule" in page.text_content("#panel-saw")
    page.locator("summary", has_text="Facts").click()
    expect(page.locator("details[open] dl")).to_contain_text("Finish")


def test_wrong_steps_say_why_and_what_was_possible(visit: ReportVisit) -> None:
    visit.show("full_planning/random/t5/s0")
    page = visit.page
    wrong = page.locator(".strip button.wrong").first
    why = wrong.locator(".strip-what").inner_text().partition(":")[0]
    wrong.click()
    said = page.inner_text(".said")
    assert why in said
    assert "Possible here (outlined): 3 (blue cube)." in said


def test_play_scrub_and_keys_move_through_the_steps(visit: ReportVisit) -> None:
    page = visit.page
    page.clock.install()
    visit.show("full_planning/oracle/t5/s0")
    where = page.locator(".controls output")
    assert where.inner_text() == "End"
    page.locator("#scrub").fill("0")
    assert where.inner_text() == "Step 0 of 4"
    empty = painted(page, "canvas.stage")
    page.keyboard.press("Tab")
    page.locator("#detail").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert where.inner_text() == "Step 2 of 4"
    assert page.locator(".strip [aria-current=true]").get_attribute("data-step") == "2"
    assert painted(page, "canvas.stage") > empty
    page.keyboard.press(" ")
    assert page.inner_text("#play") == "Pause"
    page.clock.run_for(10_000)
    expect(where).to_have_text("End")
    expect(page.locator("#play")).to_have_text("Play")
    page.locator("#play").click()
    page.clock.run_for(1_000)
    expect(where).to_have_text("Step 1 of 4")
    page.locator("#play").click()
    assert page.inner_text("#play") == "Play"


def test_a_drag_turns_the_drawing(visit: ReportVisit) -> None:
    visit.show("full_planning/oracle/t5/s0")
    page = visit.page
    before = page.eval_on_selector("canvas.stage", "canvas => canvas.toDataURL()")
    box = page.locator("canvas.stage").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 160, box["y"] + 80)
    page.mouse.up()
    assert page.eval_on_selector("canvas.stage", "canvas => canvas.toDataURL()") != before
    page.locator("canvas.stage").dblclick()
    assert page.eval_on_selector("canvas.stage", "canvas => canvas.toDataURL()") == before


def test_keys_and_buttons_go_through_the_list(visit: ReportVisit) -> None:
    page = visit.open("samples")
    title = page.locator("#sample-title")
    first = title.inner_text()
    page.keyboard.press("j")
    expect(title).not_to_have_text(first)
    second = title.inner_text()
    page.keyboard.press("k")
    assert title.inner_text() == first
    page.locator("#next").click()
    assert title.inner_text() == second
    assert page.locator(".row[aria-selected=true]").count() == 1
    page.keyboard.press("/")
    page.keyboard.type("jk")
    assert page.input_value("#search") == "jk"
    assert title.inner_text() == second


def test_two_models_stand_side_by_side(visit: ReportVisit) -> None:
    visit.show("full_planning/random/t5/s1")
    page = visit.page
    page.select_option("#compare", "oracle")
    expect(page.locator("canvas.stage")).to_have_count(2)
    assert page.locator(".built figcaption").all_inner_texts() == ["random", "oracle"]
    assert page.locator("ol.strip").count() == 2
    assert "with=oracle" in page.url
    page.keyboard.press("Escape")
    page.locator("#next").click()
    expect(page.locator("#sample-title")).to_contain_text("oracle")
    expect(page.locator("canvas.stage")).to_have_count(1)
    assert page.input_value("#compare") == ""


def test_an_address_leads_back_to_the_same_view(visit: ReportVisit) -> None:
    page = visit.open("samples?s=full_planning%2Frandom%2Ft5%2Fs1&with=oracle")
    expect(page.locator("canvas.stage")).to_have_count(2)
    assert page.inner_text("#sample-title .title-key") == "t5"
    assert page.input_value("#compare") == "oracle"


def test_dark_and_light(visit: ReportVisit) -> None:
    page = visit.open("samples")
    paper = "getComputedStyle(document.documentElement).backgroundColor"
    light = page.evaluate(paper)
    page.locator("#theme").click()
    dark = page.evaluate(paper)
    assert dark != light
    page.reload()
    assert page.evaluate(paper) == dark
    page.locator("#theme").click()
    assert page.evaluate(paper) == light


def test_a_question_with_its_options_and_answer(visit: ReportVisit) -> None:
    page = visit.open("samples")
    page.locator("#tracks button[data-track=vqa]").click()
    assert visit.count() == "24 samples"
    page.select_option("#filter-subtask", label="SH shape")
    page.select_option("#filter-model", label="oracle")
    assert visit.count() == "4 samples"
    page.select_option("#filter-answer", label="Wrong")
    assert visit.count() == "No sample passes these filters."
    visit.show("vqa/oracle/sh-000/s0")
    page.locator(".asked").wait_for()
    assert page.inner_text(".asked").startswith("A question of kind SH")
    assert page.locator(".options li").count() == 4
    assert page.locator(".options li.right.given").count() == 1
    assert page.locator(".options .mark").all_inner_texts() == ["✓ right", "✓ given"]
    assert "✓ Right" in page.inner_text(".answer")
    assert painted(page, ".pictures canvas") > 1000
    visit.show("vqa/oracle/or-000/s0")
    expect(page.locator(".options canvas")).to_have_count(4)
    marks = page.locator(".options .mark").all_inner_texts()
    assert sorted(marks[::2]) == [f"right place {n}" for n in (1, 2, 3, 4)]
    assert sorted(marks[1::2]) == [f"✓ given {n}" for n in (1, 2, 3, 4)]


def test_an_episode_turn_by_turn(visit: ReportVisit) -> None:
    visit.show("step_planning/oracle/t5/s0")
    page = visit.page
    assert page.locator(".turns > li").count() == 4
    assert "goal completed" in page.inner_text(".facts")
    page.locator(".turns summary").first.click()
    assert "Move(" in page.locator("li:has(.spoken) .markdown").first.inner_text()
    page.locator("#scrub").fill("1")
    assert "Turn 1" in page.inner_text(".said")


def test_a_plan_with_poses_as_it_was_given_and_carried_out(
    browser: Browser, workspace: Workspace
) -> None:
    workspace.write_suite(tracks=["pose_planning"], models=["oracle", "oracle-2d"], limit=1)
    assert workspace.run().code == 0
    write_report(write_tables(workspace.out), figures=False)
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    visit = ReportVisit(page, workspace.out / "report.html")
    # The second block is refused: it would stand in the first.
    for model, n_carried in (("oracle", "2 blocks"), ("oracle-2d", "1 block")):
        visit.show(f"pose_planning/{model}/t1/s0")
        titles = page.locator(".sides figcaption").all_inner_texts()
        assert titles == ["Goal 2 blocks, levels 1 and 2", "As given", "Carried out"]
        labels = [canvas.get_attribute("aria-label") for canvas in page.locator(".stage").all()]
        assert labels == ["As given: 2 blocks", f"Carried out: {n_carried}"]
    assert painted(page, ".built canvas") > 1000
    assert page.locator(".strip button.right").count() == 1
    page.locator(".strip button.wrong").click()
    said = page.inner_text(".said")
    assert "Off in height, overlaps" in said
    assert "5.0 cm too low" in said
    assert "Refused: it would share space with others" in said
    _lists_what_the_headline_leads_with(visit, workspace.out)
    page.close()
    assert visit.complaints == []


def _lists_what_the_headline_leads_with(visit: ReportVisit, folder: Path) -> None:
    """One scene was asked about once, so that a sample is worth what its model is."""
    models = ("oracle", "oracle-2d")
    found = pd.read_csv(folder / "tables" / "estimates.csv", keep_default_na=False)
    value = {
        (row["measure"], row["model"]): f"{100 * float(row['value']):.1f}"
        for row in found[found["cell"] == "overall"].to_dict("records")
    }
    assert value["f1_c", "oracle-2d"] != value["f1_a", "oracle-2d"]
    page = visit.open("matrix")
    reached = page.locator("#matrix .matrix-cell").all_inner_texts()
    assert sorted(reached) == sorted(str(round(float(value["f1_c", m]))) for m in models)
    page = visit.open("samples")
    for setting in ("C", "A", "B"):
        page.select_option("#filter-setting", label=setting)
        marks = page.locator(".row-mark .number").all_inner_texts()
        assert marks == [value[f"f1_{setting.lower()}", model] for model in models]
    assert "Overflow" in page.inner_text("#filter-error")
    page.select_option("#filter-setting", label="C")
    page.select_option("#filter-error", label="Off in height")
    assert page.locator(".row-model").all_inner_texts() == ["oracle-2d"]
    visit.wait_for_hash(lambda said: "error=off_height" in said)
    assert "setting" not in visit.hash
    page.select_option("#filter-setting", label="A")
    assert visit.count() == "2 samples"
    visit.wait_for_hash(lambda said: "setting=A" in said)


def test_a_hostile_reply_does_nothing(visit: ReportVisit) -> None:
    visit.show(HOSTILE_SAMPLE)
    page = visit.page
    page.locator("summary", has_text="Raw text").last.click()
    reply = page.locator("pre.reply").last.inner_text()
    # Half a pair of surrogates, which no output could hold, is read as "?".
    assert reply == HOSTILE.encode("utf-8", "replace").decode()
    assert page.locator("#detail script, #detail img, #detail a").count() == 0
    assert "<script>window.hacked = 1</script>" in page.locator(".markdown").last.inner_text()
    assert page.evaluate("window.hacked") is None


def test_even_markup_in_the_page_may_run_nothing(browser: Browser, made: Workspace) -> None:
    page = browser.new_page()
    page.goto((made.out / "report.html").as_uri())
    refused: list[str] = []
    page.on("console", lambda message: refused.append(message.text))
    page.evaluate(
        """() => {
            document.body.insertAdjacentHTML("beforeend", "<img src=x onerror='window.hacked=1'>");
            const script = document.createElement("script");
            script.textContent = "window.hacked = 2";
            document.body.append(script);
        }"""
    )
    page.wait_for_timeout(200)
    assert page.evaluate("window.hacked") is None
    assert sum("Content Security Policy" in text for text in refused) >= 2
    page.close()


def test_a_narrow_window_shows_list_or_sample(browser: Browser, made: Workspace) -> None:
    page = browser.new_page(viewport={"width": 400, "height": 800})
    visit = ReportVisit(page, made.out / "report.html")
    visit.open("samples")
    assert not page.locator("#detail").is_visible()
    page.locator("#list [role=option]").first.click()
    page.locator("canvas.stage").wait_for()
    assert not page.locator("#list").is_visible()
    wide = "document.documentElement.scrollWidth <= innerWidth"
    assert page.evaluate(wide)
    page.locator("#back").click()
    assert page.locator("#list").is_visible()
    visit.open("results")
    assert page.evaluate(wide)
    assert visit.complaints == []
    page.close()


def test_data_that_were_dropped_while_they_came_come_to_all_who_asked(visit: ReportVisit) -> None:
    page = visit.open()
    asked = """async () => {
        const { load, count } = chunksOf({ read: JSON.parse, noun: "report", most: 1 });
        const names = ["index", "records-0", "index"];
        const found = await Promise.all(names.map(load));
        return [found[0] === found[2], found.every(Boolean), count()];
    }"""
    assert page.evaluate(asked) == [True, True, 1]


def test_a_page_without_its_folder_says_so(
    browser: Browser, made: Workspace, tmp_path: Path
) -> None:
    shutil.copy(made.out / "report.html", tmp_path)
    page = browser.new_page()
    page.goto(f"{(tmp_path / 'report.html').as_uri()}#samples")
    page.locator("#detail .notice").wait_for()
    assert "belongs beside this page" in page.inner_text("#detail")
    page.close()


def test_a_report_without_the_data_set_still_shows_replies(
    browser: Browser, made: Workspace, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(made.out, folder)
    manifest = yaml.safe_load((folder / "run.yaml").read_text())
    manifest["dataset"]["root"] = "gone"
    (folder / "run.yaml").write_text(yaml.safe_dump(manifest))
    write_report(write_tables(folder), figures=False)
    page = browser.new_page()
    visit = ReportVisit(page, folder / "report.html")
    visit.show("full_planning/oracle/t5/s0")
    assert "Nothing can be drawn without the data set" in page.inner_text("#detail")
    assert page.locator(".strip button.right").count() == 4
    assert "Step1" in page.inner_text(".markdown")
    page.close()
    assert visit.complaints == []


@pytest.mark.slow
def test_twenty_thousand_records_keep_memory_bounded(
    browser: Browser, made: Workspace, tmp_path: Path
) -> None:
    folder = _large_run(made, tmp_path / "run")
    write_report(write_tables(folder), figures=False)
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    visit = ReportVisit(page, folder / "report.html")
    visit.open("samples")
    assert visit.count() == "20,000 samples"
    for step in range(40):
        page.evaluate(f"document.querySelector('#list').scrollTop = {step * 22_000}")
        page.wait_for_timeout(30)
        page.locator("#list [role=option]").nth(12).click()
        expect(page.locator("#detail pre.reply")).to_have_count(1)
        assert page.locator(".row").count() < 80
    assert page.evaluate("Data.chunksKept()") <= 24
    page.close()
    assert visit.complaints == []


def _large_run(made: Workspace, folder: Path) -> Path:
    """Ten models on a thousand scenes in the planning track, with replies of some kilobytes."""
    facts: dict[str, Any] = yaml.safe_load((made.out / "run.yaml").read_text())
    records = [record for record in made.records() if record["track"] == "full_planning"]
    for record in records:
        if record["reply"]:
            record["reply"]["text"] += " The base is wide." * 150
    copied = many(records, "oracle", 2000)
    facts["suite"]["tracks"] = ["full_planning"]
    facts["models"] = [
        {**facts["models"][0], "name": name}
        for name in dict.fromkeys(record["model"] for record in copied)
    ]
    folder.mkdir()
    (folder / "run.yaml").write_text(yaml.safe_dump(facts))
    lines = (json.dumps(record) + "\n" for record in copied)
    (folder / "records.jsonl").write_text("".join(lines))
    return folder


def test_a_track_of_ones_own_is_shown_by_what_it_reads_and_by_what_is_better_in_it(
    browser: Browser, workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry.register_track(Counting)
    try:
        monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
        suite = workspace.write_suite(tracks=["counting"], models=["random"])
        run_suite(suite, out=workspace.out)
        write_report(write_tables(workspace.out), figures=False)
        write_site([workspace.out], workspace.root / "site")
    finally:
        registry.unregister_track("counting")
    (record, *_) = workspace.records()
    visit = ReportVisit(browser.new_page(), workspace.out / "report.html")
    page = visit.open("samples")
    expect(page.locator("#detail .parsed")).to_have_text(
        f"number {record['parse']['number']} read by the rule number"
    )
    page.get_by_role("tab", name="The scene").click()
    expect(page.locator("#detail canvas.goal")).to_be_visible()
    assert "could be read" not in page.inner_text("#detail")
    # The fewer blocks a count is off, the better.
    for view in ("scenes?t=counting", "model?m=random"):
        page.goto(f"{(workspace.root / 'site' / 'index.html').as_uri()}#{view}")
        page.reload()
        shades = page.locator(".tiles .shade")
        expect(shades).to_have_count(5)
        errors = [float(text) for text in shades.all_inner_texts()]
        assert errors == sorted(errors, reverse=True)
        assert len(set(errors)) > 1
    page.close()
    assert visit.complaints == []
