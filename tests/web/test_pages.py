"""Report and site in a real browser, opened from disk: views, addresses, keys, hostile texts."""

import re
import shutil

import pytest
import yaml

from phyblock.results.tables import write_tables
from phyblock.scoring.plan import ERROR_TYPES
from phyblock.web.pages import write_report
from tests.web.conftest import HOSTILE, LOOK, NAME, expect
from tests.web.factory import manifest, write_run


def painted(page, selector):
    """Return the number of pixels of a canvas that are drawn."""
    return page.eval_on_selector(selector, f"canvas => {LOOK}.painted(canvas)")


def pictures(page, *selectors):
    return [page.eval_on_selector(one, "canvas => canvas.toDataURL()") for one in selectors]


SOUND = {**{"nameless": [], "h1": 1, "jumps": [], "twice": [], "lost": []}, "unreached": []}


def test_results_say_what_was_found_and_lead_to_models_and_samples(visit):
    page = visit.open()
    titles = page.locator("h1, h2").all_inner_texts()
    assert {"trial", "Full planning", "VQA", "Step planning", "All tables"} <= set(titles)
    plans = page.locator("#ranking-full_planning")
    assert plans.locator(".bars tbody th").first.inner_text() == "oracle"
    plans.locator(".more summary").click()
    plans.get_by_role("button", name="Level 3").first.focus()
    for direction in ("descending", "ascending"):
        # The heading that was pressed keeps the focus, so that it can be pressed again.
        page.keyboard.press("Enter")
        expect(plans.locator(f".more th[aria-sort={direction}]").first).to_contain_text("Level 3")
    plans.locator(".more tbody tr", has_text="oracle").get_by_role("link").nth(3).click()
    visit.count("4 samples")
    assert {"samples", "track=full_planning", "model=oracle", "level=3"} <= visit.words
    visit.open()
    plans.locator(".stack a[title^='random, Shape']").click()
    expect(page.locator("#filter-model")).to_have_value("random")
    assert "error=shape_not_in_gt" in visit.words
    visit.open()
    page.locator("#ranking-vqa .bars a", has_text="oracle").first.click()
    expect(page.locator("h1")).to_have_text("oracle")
    assert page.evaluate("document.activeElement.id") == "content"
    page.get_by_role("link", name="All its samples").nth(1).click()
    visit.count("12 samples")


def test_filters_and_search_narrow_the_list_and_stand_in_the_address(visit):
    page = visit.open("samples")
    visit.count("20 samples")
    for name, label, said in (
        ("model", "oracle", "10 samples"),
        ("seed", "Seed 1", "5 samples"),
        ("level", "Level 3", "2 samples"),
        ("outcome", "Missing", "No sample passes these filters."),
        ("model", "All", "No sample passes these filters."),
        ("seed", "All", "1 sample"),
        ("level", "All", "1 sample"),
        ("outcome", "All", "20 samples"),
    ):
        page.select_option(f"#filter-{name}", label=label)
        visit.count(said)
    page.fill("#search", "it is green")
    page.keyboard.press("Enter")
    visit.count("1 sample")
    expect(page.locator(".bar-top h1")).to_contain_text("oracle · seed 1")
    page.fill("#search", "")
    visit.count("20 samples")
    page.select_option("#filter-order", label="Best first")
    expect(page.locator(".row-model").first).to_contain_text("oracle")
    page.locator(".list [role=option]", has_text="t5").filter(has_text="seed 1").first.click()
    page.select_option("#compare", "random")
    expect(page.locator("canvas.stage")).to_have_count(2)
    address = visit.words
    assert {"order=best", "with=random"} <= address
    page.reload()
    expect(page.locator("canvas.stage")).to_have_count(2)
    assert page.input_value("#filter-order") == "best"
    assert visit.words == address


def test_keys_go_through_the_list_and_back_through_what_was_seen(visit):
    page = visit.open()
    page.get_by_role("link", name="Samples").click()
    title = page.locator(".bar-top h1")
    expect(title).to_contain_text("t1")
    seen = [title.inner_text()]
    for _ in range(2):
        page.keyboard.press("j")
        expect(title).not_to_have_text(seen[-1])
        seen.append(title.inner_text())
    assert len(set(seen)) == 3
    page.keyboard.press("k")
    expect(title).to_have_text(seen[1])
    for wanted in seen[::-1]:
        page.go_back()
        expect(title).to_have_text(wanted)
    page.keyboard.press("/")
    page.keyboard.type("jk")
    assert page.input_value("#search") == "jk"
    visit.show("full_planning/nobody/t5/s0", model="nobody")
    expect(page.locator("#warning")).to_contain_text("model “nobody”")
    assert "There is no sample" in page.inner_text(".detail")


def test_a_sample_is_drawn_played_and_turned(visiting, made):
    visit = visiting(made.out / "report.html", draws=True)
    page = visit.page
    page.clock.install()
    visit.show("full_planning/oracle/t5/s0")
    goal, stage = ".sides canvas.picture", "canvas.stage"
    drawn = {goal: ("4", 1000), ".cells canvas": ("1", 100), stage: ("4", 1000)}
    for canvas, (blocks, least) in drawn.items():
        page.locator(canvas).first.scroll_into_view_if_needed()
        expect(page.locator(canvas).first).to_have_attribute("data-drawn", blocks)
        assert painted(page, canvas) > least
    assert "F1 100.0" in page.inner_text(".facts")
    counts = [page.locator(one).count() for one in (".cells li", ".strip button.right")]
    assert counts == [16, 4]
    where = page.locator(".controls output")
    assert where.inner_text() == "End"
    page.locator("#scrub").fill("0")
    empty = painted(page, stage)
    page.locator(".detail").focus()
    for _ in range(2):
        page.keyboard.press("ArrowRight")
    assert where.inner_text() == "Step 2 of 4"
    assert painted(page, stage) > empty
    page.keyboard.press(" ")
    assert page.inner_text("#play") == "Pause"
    page.clock.run_for(10_000)
    expect(where).to_have_text("End")
    before = pictures(page, stage, goal)
    page.locator(stage).drag_to(
        page.locator(stage),
        source_position={"x": 100, "y": 100},
        target_position={"x": 160, "y": 80},
    )
    turned = pictures(page, stage, goal)
    page.locator(goal).focus()
    page.keyboard.press("ArrowLeft")
    by_key = pictures(page, stage, goal)
    for one, other in ((before, turned), (turned, by_key)):
        assert all(a != b for a, b in zip(one, other, strict=True))
    page.get_by_role("button", name="Turn back to the first view").click()
    assert pictures(page, stage, goal) == before


def test_a_stage_opens_at_the_first_wrong_step_and_moves_but_for_those_who_want_it_still(
    visiting, made
):
    visit = visiting(made.out / "report.html", draws=True)
    page = visit.page
    page.clock.install()
    visit.show("full_planning/oracle/t5/s1")
    assert page.locator(".controls output").inner_text() == "Step 1 of 2"
    assert page.locator(".wrong-step").count() == 1
    expect(page.locator("canvas.stage")).to_have_attribute("data-drawn", "0")
    said = page.locator(".said")
    assert "green cylinder" in said.inner_text()
    assert said.locator(".quote").inner_text() == "1. Move block with index 9."
    # What is drawn while a block drops is another picture than the one it ends in.
    page.clock.pause_at(page.evaluate("Date.now() / 1000 + 60"))
    drawn = """() => {
        Sample.player.seek(2);
        return document.querySelector("canvas.stage").toDataURL();
    }"""
    first = page.evaluate(drawn)
    page.clock.run_for(1000)
    assert pictures(page, "canvas.stage") != [first]
    assert said.locator(".quote").inner_text() == "2. Move block with index 3"
    page.emulate_media(reduced_motion="reduce")
    page.evaluate("() => Sample.player.seek(1)")
    first = page.evaluate(drawn)
    page.clock.run_for(1000)
    assert pictures(page, "canvas.stage") == [first]
    told = page.evaluate("all => all.map((one) => Words.reason(one, 'red arch'))", ERROR_TYPES)
    assert len({*told} - {name.replace("_", " ") for name in ERROR_TYPES}) == len(ERROR_TYPES)


def test_without_webgl_blocks_are_painted_and_turned(visit):
    page = visit.show("full_planning/oracle/t5/s0")
    stage = "canvas.stage"
    expect(page.locator(stage)).to_have_attribute("data-drawn", "painted")
    assert painted(page, stage) > 1000
    before = pictures(page, stage)
    page.locator(stage).focus()
    page.keyboard.press("ArrowLeft")
    assert pictures(page, stage) != before


def test_questions_and_episodes_are_shown(visiting, made):
    visit = visiting(made.out / "report.html", draws=True)
    page = visit.open("samples", track="vqa")
    visit.count("24 samples")
    page.select_option("#filter-part", label="SH shape")
    page.select_option("#filter-solved", label="Full")
    page.select_option("#filter-model", label="oracle")
    visit.count("4 samples")
    visit.show("vqa/oracle/sh-000/s0")
    assert page.locator(".options .mark").all_inner_texts() == ["✓ right", "✓ given"]
    expect(page.locator(".pictures canvas")).to_have_attribute("data-drawn", re.compile("[0-9]"))
    assert painted(page, ".pictures canvas") > 1000
    page.locator("summary", has_text="Evidence").click()
    assert "{" not in page.locator("dl.pairs").first.inner_text()
    visit.show("vqa/oracle/or-000/s0")
    expect(page.locator(".options canvas")).to_have_count(4)
    visit.show("step_planning/oracle/t5/s0")
    assert page.locator(".turns > li").count() == 4
    assert "goal completed" in page.inner_text(".facts")
    page.locator("#scrub").fill("1")
    assert "Turn 1" in page.inner_text(".said")


def test_what_a_model_saw_is_shown_pixel_for_pixel_or_said_not_to_be_kept(
    trouble, troubled, visiting, tmp_path, monkeypatch
):
    sent = {record["track"]: record for record in troubled.records() if record["model"] == "alpha"}
    page = trouble.show(sent["full_planning"]["sample"])
    page.get_by_text("What the model saw").click()
    assert "Step1: Move block with index N" in page.inner_text(".prompt")
    picture = page.locator(".sent img").first
    picture.evaluate("image => image.decode()")
    (image,) = sent["full_planning"]["prompt"]["images"]
    sides = "image => [image.naturalWidth, image.naturalHeight, image.clientWidth]"
    assert picture.evaluate(sides) == [image[f"{one}_px"] for one in ("width", "height", "width")]
    assert image["sha256"].startswith((picture.get_attribute("src") or "").split("/")[-1][:24])
    trouble.show(sent["step_planning"]["sample"])
    page.get_by_text("What the model saw").click()
    expect(page.locator(".sent .turns .prompt pre").first).to_be_visible()
    shutil.copytree(troubled.out, tmp_path / "run")
    shutil.rmtree(tmp_path / "run" / "report")
    monkeypatch.setenv("PHYBLOCK_CACHE", str(tmp_path / "cache"))
    other = visiting(write_report(write_tables(tmp_path / "run")))
    other.show(sent["full_planning"]["sample"])
    expect(other.page.locator(".sent .notice")).to_contain_text("is not kept beside this page")


def test_a_run_in_trouble_says_so_first(trouble, visiting, tmp_path):
    page = trouble.open()
    caution = page.text_content(".caution") or ""
    for said in (
        "This run is not finished:",
        "locked, Full planning: 0 of 2 answered: HTTP 401: Incorrect API key",
        "A limit was set: 2 scenes of Full planning, 2 episodes of Step planning",
    ):
        assert said in caution
    trouble.open("samples", track="full_planning", model="locked")
    expect(page.locator("aside [role=status]")).to_contain_text("no sample of locked here: 0 of 2")
    folder = write_run(tmp_path / "run", [], manifest())
    page = visiting(write_report(write_tables(folder))).open("samples")
    expect(page.locator("aside [role=status]")).to_contain_text("This run is not finished: 0 of ")


def test_a_report_without_data_or_scripts_shows_what_it_has(visiting, browser, made, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(made.out, folder)
    facts = yaml.safe_load((folder / "run.yaml").read_text())
    facts["dataset"]["root"] = "gone"
    (folder / "run.yaml").write_text(yaml.safe_dump(facts))
    page = visiting(write_report(write_tables(folder))).show("full_planning/oracle/t5/s0")
    assert "Nothing can be drawn without the data set" in page.inner_text(".detail")
    assert page.locator(".strip button.right").count() == 4
    assert "Step1" in page.inner_text("pre.reply")
    shutil.copy(made.out / "report.html", tmp_path)
    bare = browser.new_page()
    bare.goto(f"{(tmp_path / 'report.html').as_uri()}#samples")
    expect(bare.locator("main .notice")).to_contain_text("belongs beside this page")
    bare.close()


def test_hostile_replies_do_nothing(visit):
    page = visit.show("full_planning/random/t3/s0")
    page.locator("summary", has_text="Reasoning").click()
    # Half a pair of surrogates, which no output could hold, is read as U+FFFD.
    text = HOSTILE.replace("\ud83d", "\ufffd")
    assert page.locator("pre.reply").all_inner_texts() == [text, text]
    assert page.locator(".detail script, .detail img, .detail a").count() == 0
    # Even markup in the page may run nothing.
    page.evaluate("document.body.append(document.createElement('script'))")
    page.evaluate("document.body.lastChild.textContent = 'window.hacked = 2'")
    page.wait_for_function("!document.querySelector('nothing')")
    (refused,) = visit.complaints
    assert "Content Security Policy" in refused
    visit.complaints.clear()


def sample(track, model, key, **more):
    return "samples", {"s": f"{track}/{model}/{key}/s0", **more}


VIEWS = {
    "results": ("results", {}),
    "model": ("model", {"m": "random"}),
    "scenes": ("scenes", {}),
    "scene": ("scene", {"s": "t5"}),
    "lost scene": ("scene", {"s": NAME}),
    "list": ("samples", {}),
    "plan": sample("full_planning", "random", "t5", **{"with": "oracle"}),
    "episode": sample("step_planning", "oracle", "t5"),
    "question": sample("vqa", "random", "or-000", **{"with": "oracle"}),
}
OF_SITE = {
    "named": ("model", {"m": NAME}),
    "poses": sample("pose_planning", "oracle", "t5"),
    "named plan": sample("full_planning", NAME, "t5"),
    "named question": sample("vqa", NAME, "sh-000"),
}


@pytest.mark.parametrize("name", [*VIEWS, *OF_SITE])
def test_every_view_can_be_read_and_reached_and_hostile_names_do_nothing(
    visiting, made, site, name
):
    view, words = (VIEWS | OF_SITE)[name]
    is_of_site = name in OF_SITE or name in ("results", "scenes")
    path = site if is_of_site else made.out / "report.html"
    one = visiting(path, draws=name in ("plan", "poses"))
    page = one.open(view, **words)
    assert page.evaluate(f"{LOOK}.structure()") == SOUND
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert page.evaluate(f"{LOOK}.contrast()") == []
    for width in (1024, 390):
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate(f"{LOOK}.structure()") == SOUND
    if "s" in words and view == "samples":
        assert page.locator(".bar-top h1").evaluate("title => title.clientWidth") > 100
    assert words.get("m", "") in page.inner_text("main")


def test_a_leaderboard_says_what_was_found_and_shows_how_models_fail(
    official_checkout, visiting, new_workspace
):
    made = new_workspace()
    words = ("run", "paper-table1", "--set", f"dataset.path={official_checkout}", "--limit", "8")
    made.phyblock(*words, "--out", "out", "--no-report")
    made.does("site", "out", "--data", official_checkout, "--out", "site")
    page = visiting(made.root / "site" / "index.html", draws=True).open()
    finding = page.inner_text(".finding")
    assert re.search(r"a rule that never sees the goal \(goal-blind, [\d.]+\)\.$", finding)
    assert finding in str(page.locator("meta[name=description]").get_attribute("content"))
    assert page.locator(".bars .line.floor").count() == page.locator(".bars tbody tr").count()
    number = re.compile(r"\d")
    for place in (".hero-build", ".cards"):
        page.locator(place).scroll_into_view_if_needed()
        for canvas in page.locator(f"{place} canvas").all():
            expect(canvas).to_have_attribute("data-drawn", number)
    page.locator(".cards a").first.click()
    expect(page.locator(".controls output")).to_contain_text("Step ")
    page.get_by_role("link", name="Scenes").first.click()
    expect(page.locator(".thumbs canvas").first).to_have_attribute("data-drawn", number)
    page.select_option("#level", "4")
    page.wait_for_function("location.hash.includes('level=4')")
    assert set(page.locator(".thumbs small").all_inner_texts()) == {" level 4"}
    page.locator(".thumbs a").first.click()
    expect(page.locator(".wall canvas").first).to_have_attribute("data-drawn", number)
    assert page.evaluate(f"{LOOK}.structure()") == SOUND
    page.locator(".wall a").first.click()
    page.go_back()
    expect(page.locator(".wall li")).not_to_have_count(0)


def test_what_is_not_there_is_said(visiting, site):
    for view in ("model", "scene", "nothing"):
        page = visiting(site).open(view, m="<b>x", s="<b>y")
        expect(page.locator("h1")).to_contain_text("There is no such")
