"""A site in a real browser, opened from disk: every view, the keyboard, hostile names."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urlencode

import pytest
from PIL import Image

from tests.browser import Visit, expect
from tests.site.site_runs import HOSTILE, make_hostile
from tests.workspace import Workspace

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

PHONE = {"width": 390, "height": 844}


# Of the session as `made` is, in whose folder it lies: a worker may come to a module twice.
@pytest.fixture(scope="session")
def site(made: Workspace) -> Path:
    """A site of a bundle and a run with hostile names."""
    make_hostile(made.root / "first", made.root / "hostile")
    data = ("--data", "data", "--data", "questions")
    named = ("--title", f"A site {HOSTILE}", "--out", "site")
    done = made.phyblock("site", "hostile", "later.zip", *data, *named)
    assert done.code == 0, done.err
    assert "4 models, 58 samples" in done.out
    return made.root / "site" / "index.html"


class SiteVisit(Visit):
    """A site's page, by its file."""

    def __init__(self, page: Page, path: Path) -> None:
        super().__init__(page)
        self.path = path

    def open(self, view: str = "", **words: str) -> Page:
        """Open a view and wait until it is shown."""
        query = f"?{urlencode(words, quote_via=quote)}" if words else ""
        self.page.goto("about:blank")
        self.page.goto(f"{self.path.as_uri()}#{view}{query}")
        expect(self.page.locator("html")).to_have_attribute("data-shown", view or "board")
        return self.page


@pytest.fixture
def visit(browser: Browser, site: Path) -> Iterator[SiteVisit]:
    page = browser.new_page(viewport={"width": 1400, "height": 1000}, color_scheme="light")
    visit = SiteVisit(page, site)
    yield visit
    hacked = page.evaluate("window.hacked")
    page.close()
    assert visit.complaints == []
    assert visit.asked_elsewhere(site.parent.as_uri()) == []
    assert hacked is None


def replay(**more: str) -> dict[str, str]:
    return {"m": "oracle", "t": "full_planning", "i": "t5", "n": "0", **more}


VIEWS: dict[str, tuple[str, dict[str, str]]] = {
    "board": ("board", {}),
    "model": ("model", {"m": HOSTILE}),
    "scenes": ("scenes", {}),
    "scene": ("scene", {"s": "t5"}),
    "lost scene": ("scene", {"s": HOSTILE}),
    "replay": ("replay", replay(m=HOSTILE, b="oracle")),
    "episode": ("replay", replay(t="step_planning")),
    "poses": ("replay", replay(t="pose_planning")),
    "question": ("replay", {"m": HOSTILE, "t": "vqa", "i": "sh-000", "n": "0"}),
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
STRUCTURE = """() => {
  const all = (selector) => [...document.querySelectorAll(selector)];
  const named = (one) => one.getAttribute("aria-label") || one.textContent.trim()
    || one.labels?.[0]?.textContent.trim();
  const levels = all("h1, h2, h3, h4").map((one) => Number(one.tagName[1]));
  const ids = all("[id]").map((one) => one.id);
  return {
    nameless: all("a, button, input, select, summary, canvas[role=img]")
      .filter((one) => !named(one)).map((one) => one.outerHTML.slice(0, 80)),
    h1: levels.filter((level) => level === 1).length,
    first: levels[0],
    jumps: levels.filter((level, i) => i && level > levels[i - 1] + 1),
    twice: ids.filter((id, i) => ids.indexOf(id) !== i),
  };
}"""


@pytest.mark.parametrize("name", VIEWS)
def test_every_view_can_be_read_and_hostile_names_do_nothing(visit: SiteVisit, name: str) -> None:
    view, words = VIEWS[name]
    page = visit.open(view, **words)
    found: dict[str, Any] = page.evaluate(STRUCTURE)
    assert found == {"nameless": [], "h1": 1, "first": 1, "jumps": [], "twice": []}
    assert page.evaluate(CONTRAST) == []
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(CONTRAST) == []
    page.set_viewport_size(PHONE)
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= PHONE["width"]
    if "m" in words:
        assert words["m"] in page.inner_text("main")
    if view == "replay" and name != "question":
        assert page.locator("canvas.stage").count() == (2 if name in ("replay", "poses") else 1)
        assert page.locator(".strip button").count() >= 4


def names(page: Page) -> list[str]:
    return page.locator(".board tbody th a").all_inner_texts()


def test_the_table_is_sorted_and_its_columns_are_chosen_by_keyboard(visit: SiteVisit) -> None:
    page = visit.open()
    assert names(page)[0] == "oracle"
    page.locator(".board th button").first.focus()
    page.keyboard.press("Enter")
    expect(page.locator("th[aria-sort=ascending]")).to_have_count(1)
    assert names(page)[-1] == "oracle"
    # What was pressed keeps the focus, so that it can be pressed again.
    page.keyboard.press("Enter")
    expect(page.locator("th[aria-sort=descending]")).to_have_count(1)
    before = page.locator(".board thead button").all_inner_texts()
    page.locator("summary").press("Enter")
    expect(page.get_by_label("USD a solved question")).to_have_count(1)
    expect(page.get_by_label("Samples done", exact=True)).to_have_count(4)
    expect(page.locator(".notes")).to_contain_text(["these are taken from the records"])
    box = page.get_by_role("group", name="Full planning, setting B").get_by_label("Overall F1")
    box.focus()
    page.keyboard.press("Space")
    expect(page.locator(".board thead button")).to_have_count(len(before) + 1)
    assert page.locator("details[open]").count() == 1
    page.go_back()
    expect(page.locator(".board thead button")).to_have_count(len(before))
    # Nobody was asked, so that there is no day to show; it is that of the run that is known.
    assert "Asked on" not in before
    page.get_by_label("Asked on").check()
    page.get_by_label("Run begun").check()
    days = page.locator(".board tbody tr").first.locator("td.text").all_inner_texts()
    assert days == ["\u2013", page.inner_text(".about div:nth-child(5) dd")]
    rows = [{"facts": {"a": {"asked": [day, "2026-11-21"]}, "b": {"asked": None}}} for day in DAYS]
    said = page.evaluate("rows => rows.map(Table.asked)", rows)
    assert said == ["2026-11-20 to 2026-11-21", "2026-11-21"]
    page.select_option("#by", label="VQA: Overall")
    expect(page.locator("caption")).to_have_text("Models ranked by VQA, Overall")
    assert page.locator(".board tbody tr").first.locator(".rank").inner_text() == "\u2013"


DAYS = ("2026-11-20", "2026-11-21")


CROWD = """(count) => {
  const board = { tracks: [], rows: Array.from({ length: count }, (_, i) => ({
    name: `model-number-${i}`, kind: "litellm", lacking: {},
    values: { f1: [30 + (i * 7) % 23, 25 + (i * 7) % 23, 34 + (i * 7) % 23] },
    facts: { plan: { completion_tokens: 300 + (i * 37) % 400, done: i ? 8 : 5, expected: 8 } },
  })) };
  const column = { id: "f1", heading: "F1", unit: "%" };
  const { drawing } = Chart.draw(board, { name: "plan" }, column, "completion_tokens");
  document.querySelector("main").replaceChildren(el("div", { class: "scroll" }, drawing));
  const boxes = (selector) => [...drawing.querySelectorAll(selector)].map((one) => one.getBBox());
  const meet = (a, b) => a.x < b.x + b.width && b.x < a.x + a.width
    && a.y < b.y + b.height && b.y < a.y + a.height;
  const names = boxes(".point text");
  const all = [...names, ...boxes(".point circle")];
  return {
    met: names.flatMap((a, i) => all.slice(i + 1).filter((b) => meet(a, b))).length,
    outside: names.filter((a) => a.x < 0 || a.x + a.width > drawing.viewBox.baseVal.width).length,
    cut: drawing.querySelectorAll(".cut circle").length,
  };
}"""
"""Draw made-up models close to each other: how many names meet another name or a point."""


@pytest.mark.parametrize("count", [1, 6, 18])
def test_names_in_the_chart_meet_nothing(visit: SiteVisit, count: int) -> None:
    page = visit.open()
    if count == 1:
        page.set_viewport_size(PHONE)
    assert page.evaluate(CROWD, count) == {"met": 0, "outside": 0, "cut": 1}
    expect(page.locator(".chart .tick").first).to_be_visible()
    # On a phone an edge behind which more lies is shaded; where all is shown, none is.
    scroll = page.locator(".scroll")
    for place in (0, 10_000):
        scroll.evaluate("(one, place) => { one.scrollLeft = place; }", place)
        shaded = [count == 1 and place > 0, count == 1 and place == 0]
        assert shaded_edges(scroll) == shaded


def shaded_edges(region: Locator) -> list[bool]:
    """True if the left and the right edge of a region are darker than the paper within."""
    with Image.open(BytesIO(region.screenshot())) as picture:
        gray = picture.convert("L")
    columns = [gray.crop((x, 0, x + 1, gray.height)) for x in (0, gray.width - 1)]
    paper = median(gray.tobytes())
    return [median(column.tobytes()) < paper - 20 for column in columns]


def test_baselines_do_not_tell_how_hard_a_scene_is(visit: SiteVisit) -> None:
    page = visit.open("scenes")
    expect(page.locator(".lead")).to_contain_text("mean score of all baselines")
    page.evaluate("Store.board.rows[1].kind = 'replay'; Site.go('scenes', { q: 't' })")
    expect(page.locator(".lead")).to_contain_text("mean score of all models")
    own = page.evaluate("""() => {
      const { rows, items, scenes } = Store.index;
      const place = scenes.indexOf("t5");
      return rows.score.filter((score, i) => score !== null && items.scene[rows.item[i]] === place
        && Store.index.tracks[items.track[rows.item[i]]] === Store.board.tracks[0].name
        && Store.board.rows[rows.entry[i]].kind !== "baseline").map((score) => score / 10);
    }""")
    shown = page.get_by_role("link", name="t5").locator(".shade").inner_text()
    assert float(shown) == pytest.approx(sum(own) / len(own), abs=0.051)


def test_from_the_table_to_a_replay_and_back(visit: SiteVisit) -> None:
    page = visit.open()
    page.get_by_role("link", name="oracle").first.click()
    expect(page.locator("h1")).to_have_text("oracle")
    assert page.evaluate("document.activeElement.id") == "content"
    page.get_by_role("link", name="t5").first.click()
    expect(page.locator(".stage")).to_have_count(1)
    expect(page.locator("output")).to_have_text("End")
    drawn = page.eval_on_selector(".stage", "canvas => canvas.toDataURL()")
    page.keyboard.press("ArrowLeft")
    expect(page.locator("output")).to_have_text("Step 4 of 4")
    # Blocks have numbers: red, green and orange look alike to some.
    page.evaluate("Overlay.hasNumbers = false")
    page.keyboard.press("ArrowRight")
    assert page.eval_on_selector(".stage", "canvas => canvas.toDataURL()") != drawn
    page.evaluate("Overlay.hasNumbers = true")
    page.keyboard.press("Space")
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.select_option("#beside", label=HOSTILE)
    expect(page.locator(".sides.two .stage")).to_have_count(2)
    page.select_option("#setting", index=1)
    expect(page.locator("#setting")).to_have_value("B")
    for _ in range(2):
        page.go_back()
    expect(page.locator(".stage")).to_have_count(1)
    page.get_by_role("link", name="t5").click()
    expect(page.locator("h1")).to_have_text("t5")
    assert page.locator(".answers li").count() >= 4
    page.get_by_role("link", name="Ranking").last.click()
    expect(page.locator(".board")).to_have_count(1)


def test_a_question_says_what_is_right_and_what_was_given(visit: SiteVisit) -> None:
    page = visit.open("replay", m="oracle", t="vqa", i="sh-000", n="0")
    assert "✓ right, given" in page.inner_text(".options")
    assert "Answered" in page.inner_text("main")


@pytest.mark.parametrize("view", ["model", "scene", "replay", "nothing"])
def test_what_is_not_there_is_said(visit: SiteVisit, view: str) -> None:
    page = visit.open(view, m="<b>x", s="<b>y", i="z")
    expect(page.locator("h1")).to_contain_text("There is no such")


def test_a_page_without_its_data_says_so(browser: Browser, site: Path, tmp_path: Path) -> None:
    shutil.copy(site, tmp_path / "index.html")
    page = browser.new_page()
    page.goto((tmp_path / "index.html").as_uri())
    expect(page.locator(".notice")).to_contain_text("belongs beside this page")
    page.close()
