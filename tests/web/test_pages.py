"""Report and site in a real browser, opened from disk: views, addresses, keys, hostile texts."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from phyblock.results.tables import write_tables
from phyblock.scoring.plan import ERROR_TYPES
from phyblock.web.report import write_report
from tests.browser import expect
from tests.web.conftest import HOSTILE, MARKUP, NAME, VIEWPORT, ReportVisit, SiteVisit
from tests.web.factory import manifest, write_run
from tests.workspace import Workspace

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

Visiting = Callable[[Path], ReportVisit]
PHONE = {"width": 390, "height": 844}
WIDE = "document.documentElement.scrollWidth <= innerWidth"


def painted(page: Page, selector: str) -> int:
    """Return the number of pixels of a canvas that are drawn."""
    script = """canvas => {
        const copy = new OffscreenCanvas(canvas.width, canvas.height);
        const context = copy.getContext("2d", { willReadFrequently: true });
        context.drawImage(canvas, 0, 0);
        const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
        return new Uint32Array(data.buffer).filter(pixel => pixel >>> 24).length;
    }"""
    count: int = page.eval_on_selector(selector, script)
    return count


STRUCTURE = """() => {
  const seen = (one) => one.checkVisibility();
  const all = (selector) => [...document.querySelectorAll(selector)].filter(seen);
  const named = (one) => one.getAttribute("aria-label") || one.getAttribute("alt")
    || one.textContent.trim() || one.labels?.[0]?.textContent.trim()
    || one.querySelector("img")?.alt;
  const levels = all("h1, h2, h3, h4").map((one) => Number(one.tagName[1]));
  const ids = [...document.querySelectorAll("[id]")].map((one) => one.id);
  const refer = ["aria-controls", "aria-labelledby", "aria-activedescendant"];
  const within = "a[tabindex='0'], button, a:not([tabindex])";
  return {
    nameless: all("a, button, input, select, summary, img, [role=img]")
      .filter((one) => !named(one)).map((one) => one.outerHTML.slice(0, 80)),
    h1: levels.filter((level) => level === 1).length,
    jumps: levels.filter((level, i) => i && level > levels[i - 1] + 1),
    twice: ids.filter((id, i) => ids.indexOf(id) !== i),
    lost: refer.flatMap((name) => all(`[${name}]`).map((one) => one.getAttribute(name)))
      .filter((id) => !document.getElementById(id)),
    unreached: all("*").filter((one) => {
      const { overflowX, overflowY } = getComputedStyle(one);
      const isLarger = one.scrollHeight > one.clientHeight + 1
        || one.scrollWidth > one.clientWidth + 1;
      return /auto|scroll/.test(overflowX + overflowY) && isLarger && one.tabIndex < 0
        && !one.querySelector(within);
    }).map((one) => one.className),
  };
}"""
SOUND: dict[str, Any] = {
    **{"nameless": [], "h1": 1, "jumps": [], "twice": [], "lost": []},
    "unreached": [],
}
CONTRAST = """() => {
  const parse = (text) => text.match(/[\\d.]+/g).map(Number);
  const over = (top, below) => {
    const a = top[3] ?? 1;
    return [0, 1, 2].map((i) => a * top[i] + (1 - a) * below[i]);
  };
  const light = (rgb) => rgb.map((x) => x / 255)
    .map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4))
    .reduce((sum, x, i) => sum + x * [0.2126, 0.7152, 0.0722][i], 0);
  const ownText = (one) => [...one.childNodes].filter((n) => n.nodeType === 3)
    .map((n) => n.data.trim()).join("");
  const wrong = [];
  for (const one of document.querySelectorAll("body *")) {
    const isSeen = one.getBoundingClientRect().width > 3;
    if (!ownText(one) || !isSeen || one.closest("svg, script, style, noscript")) continue;
    const layers = [];
    for (let at = one; at; at = at.parentElement) {
      layers.unshift(parse(getComputedStyle(at).backgroundColor));
    }
    const ground = layers.reduce((below, top) => over(top, below), [255, 255, 255]);
    const ink = over(parse(getComputedStyle(one).color), ground);
    const [a, b] = [light(ink), light(ground)].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < 4.5) wrong.push(`${ownText(one).slice(0, 30)}: ${ratio.toFixed(2)}`);
  }
  return wrong;
}"""
"""Texts that stand out too little from what is behind them, with their ratio (WCAG AA: 4.5)."""


def test_results_say_what_was_found_and_lead_to_samples(visit: ReportVisit) -> None:
    page = visit.open()
    assert page.inner_text("h1") == "trial"
    titles = page.locator("[data-view=results] h2").all_inner_texts()
    assert {"Full planning", "VQA", "Step planning", "All tables"} <= set(titles)
    page.get_by_text("Coverage, suite trial").click()
    assert page.get_by_text("Expected").first.is_visible()
    plans = page.locator("#ranking-full_planning")
    assert plans.locator(".bars tbody th").first.inner_text() == "oracle"
    plans.locator(".more summary").click()
    plans.get_by_role("button", name="Level 3").first.click()
    assert plans.locator(".board th[aria-sort=descending]").first.inner_text().startswith("Level 3")
    plans.locator(".board tbody tr", has_text="oracle").get_by_role("link").nth(4).click()
    page.wait_for_selector("#list [role=option]")
    assert visit.hash.startswith("samples?track=full_planning")
    assert "&level=3" in visit.hash
    assert visit.count() == "4 samples"
    visit.open("results")
    plans.locator(".stack a[title^='random, Shape']").click()
    page.wait_for_selector("#list [role=option]")
    assert "error=shape_not_in_gt" in visit.hash
    assert page.input_value("#filter-model") == "random"
    visit.open("results")
    page.locator("#ranking-vqa .bars a", has_text="oracle").first.click()
    assert visit.count() == "12 samples"


def test_filters_and_search_narrow_the_list_and_stand_in_the_address(visit: ReportVisit) -> None:
    page = visit.open("samples")
    assert visit.count() == "20 samples"
    for name, label, count in (
        ("model", "oracle", "10 samples"),
        ("seed", "Seed 1", "5 samples"),
        ("level", "Level 3", "2 samples"),
        ("error", "Overflow", "No sample passes these filters."),
    ):
        page.select_option(f"#filter-{name}", label=label)
        assert visit.count() == count
    for name in ("model", "seed", "level", "error"):
        page.select_option(f"#filter-{name}", label="All")
    page.select_option("#filter-outcome", label="Missing")
    assert page.locator(".row-name").all_inner_texts() == ["t4"]
    page.select_option("#filter-outcome", label="All")
    page.fill("#search", "it is green")
    page.keyboard.press("Enter")
    expect(page.locator("#list-status")).to_have_text("1 sample")
    expect(page.locator("#sample-title")).to_contain_text("oracle · seed 1")
    page.fill("#search", "")
    page.select_option("#filter-sort", label="Best first")
    assert page.locator(".row-model").first.inner_text().startswith("oracle")
    page.locator("#list [role=option]", has_text="t5").filter(has_text="seed 1").first.click()
    page.select_option("#compare", "random")
    expect(page.locator("canvas.stage")).to_have_count(2)
    page.wait_for_timeout(400)
    address = visit.hash
    assert {"order=best", "with=random"} <= set(address.partition("?")[2].split("&"))
    page.goto("about:blank")
    visit.open(address)
    expect(page.locator("canvas.stage")).to_have_count(2)
    assert page.input_value("#filter-sort") == "best"
    assert visit.hash == address


def test_keys_go_through_the_list_and_back_through_what_was_seen(visit: ReportVisit) -> None:
    page = visit.open()
    page.get_by_role("link", name="Samples").click()
    title = page.locator("#sample-title")
    expect(title).to_contain_text("t1")
    seen = [title.inner_text()]
    for key in "jj":
        page.keyboard.press(key)
        seen.append(title.inner_text())
    assert len(set(seen)) == 3
    page.keyboard.press("k")
    assert title.inner_text() == seen[1]
    for wanted in (seen[2], seen[1], seen[0]):
        page.go_back()
        expect(title).to_have_text(wanted)
    page.keyboard.press("/")
    page.keyboard.type("jk")
    assert page.input_value("#search") == "jk"
    page.goto(f"{visit.path.as_uri()}#samples?s=full_planning%2Fnobody%2Ft5%2Fs0&model=nobody")
    expect(page.locator("#warning")).to_contain_text("model “nobody”")
    assert "has no sample" in page.inner_text("#detail")


def test_a_sample_is_drawn_played_and_turned(visit: ReportVisit) -> None:
    page = visit.page
    page.clock.install()
    visit.show("full_planning/oracle/t5/s0")
    assert page.locator(".cells li").count() == 16
    expect(page.locator("canvas.goal")).to_have_attribute("data-drawn", "4")
    expect(page.locator(".cells canvas").first).to_have_attribute("data-drawn", "1")
    for canvas, least in (("canvas.goal", 1000), (".cells canvas", 100), ("canvas.stage", 1000)):
        assert painted(page, canvas) > least
    assert "F1 100.0" in page.inner_text(".facts")
    assert page.locator(".strip button.right").count() == 4
    assert "Nothing was sent: oracle is a rule" in page.text_content("#panel-saw")  # type: ignore[operator]
    where = page.locator(".controls output")
    assert where.inner_text() == "End"
    page.locator("#scrub").fill("0")
    empty = painted(page, "canvas.stage")
    page.locator("#detail").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert where.inner_text() == "Step 2 of 4"
    assert painted(page, "canvas.stage") > empty
    page.keyboard.press(" ")
    assert page.inner_text("#play") == "Pause"
    page.clock.run_for(10_000)
    expect(where).to_have_text("End")
    picture = "canvas => canvas.toDataURL()"
    views = ("canvas.stage", "canvas.goal")
    before = [page.eval_on_selector(view, picture) for view in views]
    box = page.locator("canvas.stage").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 160, box["y"] + 80)
    page.mouse.up()
    turned = [page.eval_on_selector(view, picture) for view in views]
    page.locator("canvas.goal").focus()
    page.keyboard.press("ArrowLeft")
    by_key = [page.eval_on_selector(view, picture) for view in views]
    for one, other in ((before, turned), (turned, by_key)):
        assert all(a != b for a, b in zip(one, other, strict=True))
    page.get_by_role("button", name="Turn back to the first view").click()
    assert [page.eval_on_selector(view, picture) for view in views] == before


def test_a_stage_opens_at_the_first_wrong_step_and_moves_but_for_those_who_want_it_still(
    visit: ReportVisit,
) -> None:
    page = visit.show("full_planning/oracle/t5/s1", tab="did")
    where = page.locator(".controls output")
    assert where.inner_text() == "Step 1 of 2"
    assert page.locator(".wrong-step").count() == 1
    at_first = "() => document.querySelector('canvas.stage').toDataURL()"
    expect(page.locator("canvas.stage")).to_have_attribute("data-drawn", "0")
    tried = page.evaluate(at_first)
    page.locator("#numbers").uncheck()
    assert page.evaluate(at_first) != tried
    # What is drawn while a block drops is another picture than the one it ends in.
    drawn = """async (still) => {
        const seen = new Set(), canvas = document.querySelector("canvas.stage");
        Detail.player.seek(2);
        for (let i = 0; i < 40; i++) {
            await new Promise(requestAnimationFrame);
            seen.add(canvas.toDataURL());
        }
        return seen.size;
    }"""
    assert page.evaluate(drawn) > 1
    page.emulate_media(reduced_motion="reduce")
    page.evaluate("() => Detail.player.seek(1)")
    assert page.evaluate(drawn) == 1


def test_without_webgl_a_picture_says_so(visit: ReportVisit) -> None:
    visit.page.add_init_script(
        """HTMLCanvasElement.prototype.getContext = new Proxy(
            HTMLCanvasElement.prototype.getContext,
            { apply: (get, canvas, [kind, ...more]) =>
                kind.startsWith("webgl") ? null : get.call(canvas, kind, ...more) })"""
    )
    page = visit.show("full_planning/oracle/t5/s0", tab="did")
    expect(page.locator("canvas.goal")).to_have_attribute("data-drawn", "no")
    assert 0 < painted(page, "canvas.goal") < 10_000
    assert page.inner_text(".said").startswith("End")


def test_a_wrong_step_says_why_with_the_sentence(visit: ReportVisit) -> None:
    page = visit.show("full_planning/oracle/t5/s1", step="1", numbers="off")
    why = page.locator(".why")
    expect(why).to_contain_text("Glowing: what was tried, on the floor, the first open place.")
    expect(page.locator(".said").first).to_contain_text("The goal has no green cylinder.")
    assert why.locator(".quote").inner_text() == "1. Move block with index 9."
    page.locator("#scrub").fill("2")
    assert page.locator(".why .quote").inner_text() == "2. Move block with index 3"
    visit.show("full_planning/random/t5/s0")
    page.locator(".strip button.wrong").first.click()
    assert "Possible here (outlined): 3 (blue cube)." in page.inner_text(".said")
    told = page.evaluate("all => all.map((one) => Words.reason(one, 'red arch'))", ERROR_TYPES)
    assert len({*told} - {name.replace("_", " ") for name in ERROR_TYPES}) == len(ERROR_TYPES)


def test_questions_and_episodes_are_shown(visit: ReportVisit) -> None:
    page = visit.open("samples?track=vqa")
    assert visit.count() == "24 samples"
    page.select_option("#filter-subtask", label="SH shape")
    page.select_option("#filter-answer", label="Right")
    page.select_option("#filter-model", label="oracle")
    assert visit.count() == "4 samples"
    visit.show("vqa/oracle/sh-000/s0")
    assert page.locator(".options .mark").all_inner_texts() == ["✓ right", "✓ given"]
    expect(page.locator(".pictures canvas")).to_have_attribute("data-drawn", re.compile("[0-9]"))
    assert painted(page, ".pictures canvas") > 1000
    page.locator("summary", has_text="Evidence").click()
    assert "{" not in page.locator("dl.evidence").first.inner_text()
    visit.show("vqa/oracle/or-000/s0")
    expect(page.locator(".options canvas")).to_have_count(4)
    visit.show("step_planning/oracle/t5/s0")
    assert page.locator(".turns > li").count() == 4
    assert "goal completed" in page.inner_text(".facts")
    page.locator("#scrub").fill("1")
    assert "Turn 1" in page.inner_text(".said")


def test_what_a_model_saw_is_shown_pixel_for_pixel_or_said_not_to_be_kept(
    trouble: ReportVisit,
    troubled: Workspace,
    visiting: Visiting,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent = {record["track"]: record for record in troubled.records() if record["model"] == "alpha"}
    page = trouble.show(sent["full_planning"]["sample"])
    assert page.get_by_role("tab", selected=True).inner_text() == "What the model saw"
    assert "Step1: Move block with index N" in page.inner_text(".prompt")
    picture = page.locator("#panel-saw img").first
    picture.evaluate("image => image.decode()")
    (image,) = sent["full_planning"]["prompt"]["images"]
    sides = "image => [image.naturalWidth, image.naturalHeight, image.clientWidth]"
    size = [image["width_px"], image["height_px"], image["width_px"]]
    assert picture.evaluate(sides) == size
    assert image["sha256"].startswith((picture.get_attribute("src") or "").split("/")[-1][:24])
    trouble.show(sent["step_planning"]["sample"])
    expect(page.locator("#panel-saw .turns .prompt pre").first).to_be_visible()
    shutil.copytree(troubled.out, tmp_path / "run")
    shutil.rmtree(tmp_path / "run" / "report")
    monkeypatch.setenv("PHYBLOCK_CACHE", str(tmp_path / "cache"))
    other = visiting(write_report(write_tables(tmp_path / "run")))
    other.show(sent["full_planning"]["sample"], tab="saw")
    notice = other.page.locator("#panel-saw .notice")
    expect(notice).to_contain_text("is not kept beside this page")


def test_a_run_in_trouble_says_so_first(
    trouble: ReportVisit, visiting: Visiting, tmp_path: Path
) -> None:
    page = trouble.open()
    caution = page.text_content(".caution") or ""
    assert "This run is not finished:" in caution
    assert "locked, Full planning: 0 of 2 answered: HTTP 401: Incorrect API key" in caution
    assert "A limit was set: 2 scenes of Full planning, 2 episodes of Step planning" in caution
    assert page.inner_text(".lead") == "The whole suite: The 400 scenes."
    page.locator("#ranking-full_planning .bars a", has_text="locked").first.click()
    expect(page.locator("#list-status")).to_contain_text("no sample of locked here: 0 of 2")
    folder = write_run(tmp_path / "run", [], manifest())
    empty = visiting(write_report(write_tables(folder)))
    empty.open("matrix")
    expect(empty.page.locator("#matrix-none")).to_contain_text("This run is not finished: 0 of ")


def test_a_report_without_data_or_scripts_shows_what_it_has(
    visiting: Visiting, browser: Browser, made: Workspace, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(made.out, folder)
    facts = yaml.safe_load((folder / "run.yaml").read_text())
    facts["dataset"]["root"] = "gone"
    (folder / "run.yaml").write_text(yaml.safe_dump(facts))
    visit = visiting(write_report(write_tables(folder)))
    page = visit.show("full_planning/oracle/t5/s0")
    assert "Nothing can be drawn without the data set" in page.inner_text("#detail")
    assert page.locator(".strip button.right").count() == 4
    assert "Step1" in page.inner_text(".markdown")
    shutil.copy(made.out / "report.html", tmp_path)
    bare = browser.new_page()
    bare.goto(f"{(tmp_path / 'report.html').as_uri()}#samples")
    expect(bare.locator("#detail .notice")).to_contain_text("belongs beside this page")
    bare.close()


def test_hostile_replies_and_markup_do_nothing(visit: ReportVisit) -> None:
    page = visit.show("full_planning/random/t3/s0")
    page.locator("summary", has_text="Raw text").last.click()
    # Half a pair of surrogates, which no output could hold, is read as "?".
    text = HOSTILE.encode("utf-8", "replace").decode()
    assert page.locator("pre.reply").last.inner_text() == text
    assert page.locator("#detail script, #detail img, #detail a").count() == 0
    # Even markup in the page may run nothing.
    page.evaluate(
        """() => {
            const script = document.createElement("script");
            script.textContent = "window.hacked = 2";
            document.body.append(script);
        }"""
    )
    page.wait_for_timeout(100)
    (refused,) = visit.complaints
    assert "Content Security Policy" in refused
    visit.complaints.clear()
    assert "<script>window.hacked = 1</script>" in page.locator(".markdown").last.inner_text()
    visit.show("full_planning/oracle/t5/s1")
    reply = page.locator(".markdown").last
    assert reply.locator(".md-heading").inner_text() == "Plan"
    assert reply.locator("ol > li").count() == 2
    assert reply.locator("tbody td").all_inner_texts() == ["3", "base"]
    assert "here (javascript:window.hacked=4)" in reply.inner_text()
    assert reply.locator("a, img, b, [onmouseover]").count() == 0
    page.locator("summary", has_text="Raw text").click()
    assert page.locator("pre.reply").inner_text() == MARKUP


PARTS = (
    *("\n", "\n\n", " ", "    ", "# ", "- ", "* ", "1. ", "> ", "|", "\n|---|---|\n", "`", "**"),
    *("_", "*", "[", "](http://x.y)", "![", "\n```\n", "---", "\\", "<script>alert(1)</script>"),
    *("<img src=x onerror=alert(1)>", "</p>", "&lt;", "\t", "javascript:alert(1)", "\r\n", "("),
)
TAGS = (
    *("P", "STRONG", "EM", "CODE", "PRE", "UL", "OL", "LI", "BLOCKQUOTE", "HR", "DIV"),
    *("TABLE", "THEAD", "TBODY", "TR", "TH", "TD"),
)


def test_markdown_of_any_text_loses_no_word_and_makes_no_element_of_its(visit: ReportVisit) -> None:
    draw, texts = Random(7), []
    for _ in range(400):
        parts = (draw.choice(PARTS) for _ in range(draw.randrange(1, 40)))
        words = (f"{part}w{n}x" * draw.randrange(3) + part for n, part in enumerate(parts))
        texts.append("".join(words))
    # As long and as hostile as it may be, it is read to its end.
    texts += [
        ((part * (4900 // len(part)) + "\n") * 80)
        for part in ("*", "`", "[", "_", "> ", "1. ", "|", "\\", "*a*", "![](", "- a\n\n")
    ]
    made = visit.open().evaluate(
        """texts => texts.map((text) => {
            const place = document.createElement("div");
            for (const one of Markdown.render(text)) place.append(one);
            const all = [...place.querySelectorAll("*")];
            const names = all.flatMap((one) => [one.tagName, ...one.getAttributeNames()]);
            return [place.textContent, all.length, [...new Set(names)]];
        })""",
        texts,
    )
    allowed = {*TAGS, "class", "value", "scope", "tabindex"}
    for text, (shown, count, names) in zip(texts, made, strict=True):
        assert set(names) <= allowed, text[:80]
        assert 0 <= count <= len(text) + 1, text[:80]
        assert set(re.findall(r"w\d+x", text)) <= set(re.findall(r"w\d+x", shown)), text[:80]


@pytest.mark.parametrize(
    "address",
    [
        "results",
        "matrix",
        "samples?s=full_planning%2Frandom%2Ft5%2Fs1&with=oracle",
        "samples?s=vqa%2Frandom%2For-000%2Fs0&with=oracle&track=vqa",
        "samples?s=step_planning%2Frandom%2Ft5%2Fs0&track=step_planning",
    ],
)
def test_every_view_of_a_report_can_be_read_and_reached(visit: ReportVisit, address: str) -> None:
    page = visit.open(address)
    if address.startswith("samples"):
        page.wait_for_selector("#detail .tabs")
        page.set_viewport_size({"width": 1024, "height": 800})
        box = page.locator("#sample-title").bounding_box()
        assert box
        assert box["width"] > 100
    assert page.evaluate(STRUCTURE) == SOUND
    light = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    page.locator("#theme").click()
    assert page.evaluate("getComputedStyle(document.documentElement).backgroundColor") != light
    page.set_viewport_size(PHONE)
    assert page.evaluate(WIDE)


def replay(**more: str) -> dict[str, str]:
    return {"m": "oracle", "t": "full_planning", "i": "t5", "n": "0", **more}


VIEWS: dict[str, tuple[str, dict[str, str], int]] = {
    "board": ("board", {}, 0),
    "model": ("model", {"m": NAME}, 0),
    "scenes": ("scenes", {}, 0),
    "scene": ("scene", {"s": "t5"}, 0),
    "lost scene": ("scene", {"s": NAME}, 0),
    "replay": ("replay", replay(m=NAME, b="oracle"), 2),
    "episode": ("replay", replay(t="step_planning"), 1),
    "poses": ("replay", replay(t="pose_planning"), 2),
    "question": ("replay", {"m": NAME, "t": "vqa", "i": "sh-000", "n": "0"}, 0),
}


@pytest.mark.parametrize("name", VIEWS)
def test_every_view_of_a_site_can_be_read_and_hostile_names_do_nothing(
    site_visit: SiteVisit, name: str
) -> None:
    view, words, stages = VIEWS[name]
    page = site_visit.open(view, **words)
    found = page.evaluate(STRUCTURE)
    assert {**found, "unreached": []} == SOUND
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        assert page.evaluate(CONTRAST) == []
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    assert page.evaluate(WIDE)
    assert words.get("m", "") in page.inner_text("main")
    if stages:
        assert page.locator("canvas.stage").count() == stages


def test_a_leaderboard_says_what_was_found_and_shows_how_models_fail(
    official_checkout: Path,
    browser: Browser,
    tmp_path_factory: pytest.TempPathFactory,
    pictures_dir: Path,
) -> None:
    made = Workspace(tmp_path_factory.mktemp("paper"), pictures_dir)
    path = f"dataset.path={official_checkout}"
    made.phyblock("run", "paper-table1", "--set", path, "--limit", "60", "--out", "out")
    done = made.phyblock("site", "out", "--data", official_checkout, "--out", "site")
    assert done.code == 0, done.err
    page = browser.new_page(viewport=VIEWPORT, color_scheme="light")  # type: ignore[arg-type]
    visit = SiteVisit(page, made.root / "site" / "index.html")
    visit.open()
    assert re.fullmatch(
        r"(No model is shown to beat|\d+ of \d+ models beats?) a rule that never sees the goal "
        r"\(goal-blind, [\d.]+\)\.",
        page.inner_text(".finding"),
    )
    assert page.inner_text(".finding") in str(
        page.locator("meta[name=description]").get_attribute("content")
    )
    assert page.locator(".bars .line.floor").count() == page.locator(".bars tbody tr").count()
    expect(page.locator(".hero-build canvas.goal")).not_to_have_count(0)
    page.locator(".failures").scroll_into_view_if_needed()
    for canvas in page.locator(".failures canvas").all():
        expect(canvas).to_have_attribute("data-drawn", re.compile(r"\d"))
    page.locator(".failures a").first.click()
    expect(page.locator(".controls output")).to_contain_text("Step ")
    page.get_by_role("link", name="Scenes").first.click()
    expect(page.locator(".thumbs canvas").first).to_have_attribute("data-drawn", re.compile(r"\d"))
    page.select_option("#level", "4")
    assert set(page.locator(".thumbs small").all_inner_texts()) == {"level 4"}
    page.locator(".thumbs a").first.click()
    expect(page.locator(".wall canvas").first).to_have_attribute("data-drawn", re.compile(r"\d"))
    assert page.evaluate(STRUCTURE) == SOUND
    page.close()
    assert visit.complaints == []


def test_the_board_is_sorted_by_keyboard_and_ranked_by_any_track(site_visit: SiteVisit) -> None:
    page = site_visit.open()
    assert page.locator(".bars tbody th a").first.inner_text() == "oracle"
    page.locator("#more summary").click()
    names = page.locator(".board tbody th a")
    # The first track of the suite comes first.
    assert page.locator("#by option:checked").inner_text() == "Full planning: Overall F1"
    assert names.first.inner_text() == "oracle"
    page.locator(".board th button").first.focus()
    page.keyboard.press("Enter")
    expect(page.locator("th[aria-sort=ascending]")).to_have_count(1)
    assert names.last.inner_text() == "oracle"
    # What was pressed keeps the focus, so that it can be pressed again.
    page.keyboard.press("Enter")
    expect(page.locator("th[aria-sort=descending]")).to_have_count(1)
    page.select_option("#by", label="VQA: Overall")
    caption = page.locator(".bars caption")
    expect(caption).to_have_text("Models ranked by VQA, Overall")


def test_from_the_board_to_a_replay_and_back(site_visit: SiteVisit) -> None:
    page = site_visit.open()
    page.get_by_role("link", name="oracle").first.click()
    expect(page.locator("h1")).to_have_text("oracle")
    assert page.evaluate("document.activeElement.id") == "content"
    page.locator("summary", has_text="Every scene").first.click()
    page.get_by_role("link", name="t5").first.click()
    expect(page.locator("output")).to_have_text("End")
    page.keyboard.press("ArrowLeft")
    expect(page.locator("output")).to_have_text("Step 4 of 4")
    page.select_option("#beside", label=NAME)
    expect(page.locator(".sides.two .stage")).to_have_count(2)
    page.select_option("#setting", index=1)
    expect(page.locator("#setting")).to_have_value("B")
    for _ in range(2):
        page.go_back()
    expect(page.locator(".stage")).to_have_count(1)
    page.get_by_role("link", name="t5").click()
    assert page.locator(".wall li").count() >= 4
    for view in ("model", "scene", "replay", "nothing"):
        site_visit.open(view, m="<b>x", s="<b>y", i="z")
        expect(page.locator("h1")).to_contain_text("There is no such")
    site_visit.open("replay", m="oracle", t="vqa", i="sh-000", n="0")
    assert "✓ right, given" in page.inner_text(".options")
