"""The page as people use it: what it says first, its address, keyboard, paper, phone, labels."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

import pytest

from phyblock.results.tables import write_tables
from phyblock.scoring.plan import ERROR_TYPES
from phyblock.web.report import write_report
from tests.browser import expect
from tests.report.browser import ReportVisit
from tests.report.factory import manifest, write_run
from tests.report.html_run import MARKUP
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

if TYPE_CHECKING:
    from playwright.sync_api import Browser

PLAN = "full_planning/{}/t5/s{}"


@pytest.fixture(scope="module")
def troubled(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """A run of two models, of which one has no key, limited to two items of each track."""
    workspace = Workspace(tmp_path_factory.mktemp("troubled"), pictures_dir)
    workspace.write_scenes()
    tracks = ["full_planning", "step_planning"]
    workspace.write_suite(
        models=["alpha", "locked"],
        seeds=[0],
        limit=2,
        tracks=tracks,
        steps={"physics": "off"},
        description="The 400 scenes.",
    )
    with Running(OpenAIChat()) as good, Running(OpenAIChat(Faults(mode="401"))) as bad:
        ways = {"alpha": good.url, "locked": bad.url}
        entries = {
            name: {"id": f"hosted_vllm/{name}", "api_base": f"{url}/v1"}
            for name, url in ways.items()
        }
        workspace.write_yaml("models.yaml", entries)
        workspace.run()
    workspace.phyblock("report", workspace.out)
    return workspace


@pytest.fixture
def visit(browser: Browser, made: Workspace) -> Iterator[ReportVisit]:
    yield from visited(browser, made)


@pytest.fixture
def trouble(browser: Browser, troubled: Workspace) -> Iterator[ReportVisit]:
    yield from visited(browser, troubled)


def visited(browser: Browser, run: Workspace) -> Iterator[ReportVisit]:
    page = browser.new_page(viewport={"width": 1400, "height": 1000}, color_scheme="light")
    visit = ReportVisit(page, run.out / "report.html")
    yield visit
    page.close()
    assert visit.complaints == []
    assert visit.asked_elsewhere("file://") == []


def test_a_banner_says_first_what_a_run_is_not(trouble: ReportVisit) -> None:
    page = trouble.open()
    caution = page.inner_text(".caution")
    assert "This run is not finished:" in caution
    assert "locked: stopped (HTTP 401: Incorrect API key provided" in caution
    assert "A limit was set: 2 scenes of Full planning, 2 episodes of Step planning" in caution
    assert page.inner_text(".lead") == "The whole suite: The 400 scenes."
    assert "of 8" in page.locator(".about div", has_text="Samples").inner_text()
    row = page.locator(".headline tr", has_text="locked").first
    assert row.locator(".lacking").inner_text().startswith("0 of 2 answered: HTTP 401: Incorrect")


def test_what_a_model_saw_is_the_first_tab_pixel_for_pixel(
    trouble: ReportVisit, troubled: Workspace
) -> None:
    sent = {record["track"]: record for record in troubled.records() if record["model"] == "alpha"}
    page = trouble.page
    trouble.show(sent["full_planning"]["sample"])
    tabs = page.get_by_role("tab").all_inner_texts()
    assert tabs == ["What the model saw", "What it built"]
    assert page.get_by_role("tab", selected=True).inner_text() == tabs[0]
    assert "Step1: Move block with index N" in page.inner_text(".prompt")
    picture = page.locator("#panel-saw img").first
    picture.evaluate("image => image.decode()")
    (image,) = sent["full_planning"]["prompt"]["images"]
    size = [
        picture.evaluate(f"image => image.{name}") for name in ("naturalWidth", "naturalHeight")
    ]
    assert size == [image["width_px"], image["height_px"]]
    assert picture.evaluate("image => image.clientWidth") == image["width_px"]
    assert image["sha256"].startswith((picture.get_attribute("src") or "").split("/")[-1][:24])
    trouble.show(sent["step_planning"]["sample"])
    expect(page.locator("#panel-saw .turns .prompt pre").first).to_be_visible()
    turns = sent["step_planning"]["turns"]
    # Goal and candidates, and the assembly as it stood before each turn.
    assert page.locator("#panel-saw img").count() == sum(len(t["prompt"]["images"]) for t in turns)
    page.get_by_role("tab", name="What it built").click()
    page.locator("#next").click()
    # What was chosen stays chosen.
    expect(page.get_by_role("tab", selected=True)).to_have_text("What it built")


def test_pictures_that_are_not_kept_are_said(
    browser: Browser, troubled: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("run.yaml", "records.jsonl", "prompts.jsonl"):
        (folder / name).write_bytes((troubled.out / name).read_bytes())
    # A cache in which nothing was ever kept.
    monkeypatch.setenv("PHYBLOCK_CACHE", str(tmp_path / "cache"))
    write_report(write_tables(folder), figures=False)
    page = browser.new_page()
    visit = ReportVisit(page, folder / "report.html")
    sample = next(r["sample"] for r in troubled.records() if r["track"] == "full_planning")
    visit.show(sample, tab="saw")
    expect(page.locator("#panel-saw .notice")).to_contain_text("is not kept beside this page")
    page.close()


def test_everything_that_is_seen_is_in_the_address(visit: ReportVisit) -> None:
    page = visit.open("samples")
    page.select_option("#filter-model", label="random")
    page.select_option("#filter-sort", label="Worst first")
    page.select_option("#filter-setting", label="B")
    page.locator("#list [role=option]", has_text="t5").filter(has_text="seed 1").click()
    page.select_option("#compare", "oracle")
    expect(page.locator("canvas.stage")).to_have_count(2)
    page.locator("#scrub").fill("2")
    box = page.locator("canvas.stage").first.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 100, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 160, box["y"] + 80)
    page.mouse.up()
    page.wait_for_timeout(400)
    words = dict(word.split("=") for word in visit.hash.removeprefix("samples?").split("&"))
    assert words == {
        **{"track": "full_planning", "model": "random", "setting": "B", "order": "worst"},
        **{"s": "full_planning%2Frandom%2Ft5%2Fs1", "with": "oracle", "step": "2"},
        "view": "15%2C12",
    }
    seen = page.screenshot(clip=dict(box))
    address = visit.hash
    page.goto("about:blank")
    visit.open(address)
    expect(page.locator(".controls output")).to_contain_text("2 of")
    assert page.input_value("#filter-model") == "random"
    assert page.input_value("#filter-sort") == "worst"
    assert page.screenshot(clip=dict(box)) == seen
    assert visit.hash == address


def test_back_and_forward_go_through_what_was_seen(visit: ReportVisit) -> None:
    page = visit.open("results")
    page.get_by_role("link", name="Samples").click()
    title = page.locator("#sample-title")
    expect(title).to_contain_text("t1")
    seen = [title.inner_text()]
    for key in "jj":
        page.keyboard.press(key)
        seen.append(title.inner_text())
    assert len(set(seen)) == 3
    for wanted in (seen[1], seen[0]):
        page.go_back()
        expect(title).to_have_text(wanted)
    page.go_forward()
    expect(title).to_have_text(seen[1])
    page.go_back()
    page.go_back()
    expect(page.locator(".intro h1")).to_be_visible()


def test_a_link_to_what_is_not_there_says_so(visit: ReportVisit) -> None:
    page = visit.page
    page.goto(f"{visit.path.as_uri()}#samples?s=full_planning%2Fnobody%2Ft5%2Fs0&model=nobody")
    expect(page.locator("#warning")).to_contain_text("model “nobody”")
    expect(page.locator("#warning")).to_contain_text("sample “full_planning/nobody/t5/s0”")
    assert "has no sample" in page.inner_text("#detail")
    page.goto(f"{visit.path.as_uri()}#elsewhere")
    expect(page.locator("#warning")).to_contain_text("view “elsewhere”")


def test_a_model_without_any_sample_is_in_the_run_and_says_why(trouble: ReportVisit) -> None:
    page = trouble.open()
    page.locator(".headline a", has_text="locked").first.click()
    expect(page.locator("#list-status")).to_contain_text("no sample of locked here: 0 of 2")
    assert "Incorrect API key" in page.inner_text("#list-status")
    assert page.locator("#warning").is_hidden()
    assert page.locator("#list [role=option]").count() == 0
    assert page.locator("#filter-model option:checked").inner_text() == "locked"


def test_every_view_of_a_run_without_records_says_why(browser: Browser, tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [], manifest())
    write_report(write_tables(folder), figures=False)
    page = browser.new_page()
    visit = ReportVisit(page, folder / "report.html")
    visit.page.goto(f"{visit.path.as_uri()}#samples")
    expect(page.locator("#list-status")).to_contain_text("There is no sample here. This run is not")
    visit.open("matrix")
    expect(page.locator("#matrix-none")).to_contain_text("This run is not finished: 0 of ")
    assert page.locator("#matrix").is_hidden()
    page.close()
    assert visit.complaints == []


def test_filtering_out_what_is_shown_moves_on(visit: ReportVisit) -> None:
    visit.show(PLAN.format("oracle", 0))
    page = visit.page
    page.select_option("#filter-model", label="random")
    expect(page.locator("#sample-title")).to_contain_text("random")
    page.goto(f"{visit.path.as_uri()}#samples?model=random&s=full_planning%2Foracle%2Ft5%2Fs0")
    expect(page.locator("#list-status")).to_contain_text("The sample shown does not pass")
    page.fill("#search", "nothing has this name")
    expect(page.locator("#detail")).to_contain_text("No sample is chosen")


def test_the_pane_scrolls_by_keyboard_and_the_list_moves(visit: ReportVisit) -> None:
    visit.show(PLAN.format("oracle", 0), tab="did")
    page = visit.page
    page.set_viewport_size({"width": 1400, "height": 500})
    title = page.inner_text("#sample-title")
    page.locator("#detail").focus()
    for key in ("PageDown", "ArrowDown"):
        before = page.evaluate("document.getElementById('detail').scrollTop")
        page.keyboard.press(key)
        page.wait_for_timeout(250)
        assert page.evaluate("document.getElementById('detail').scrollTop") > before
    assert page.inner_text("#sample-title") == title
    page.locator("#list").focus()
    page.keyboard.press("ArrowDown")
    expect(page.locator("#sample-title")).not_to_have_text(title)


def test_skip_to_content_stays_in_the_view(visit: ReportVisit) -> None:
    page = visit.open("samples")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "detail"
    assert page.locator("#workspace").is_visible()


def test_search_finds_scenes_models_and_replies(visit: ReportVisit) -> None:
    page = visit.open("samples")
    page.fill("#search", "ORACLE t5")
    assert visit.count().startswith("2 samples")
    page.fill("#search", "it is green")
    assert visit.count().startswith("No sample")
    page.keyboard.press("Enter")
    expect(page.locator("#list-status")).to_have_text("1 sample")
    expect(page.locator("#sample-title")).to_contain_text("oracle · seed 1")


def test_models_are_ranked_and_their_numbers_lead_to_samples(trouble: ReportVisit) -> None:
    page = trouble.open()
    heads = page.locator(".headline").first.locator("thead th").all_inner_texts()
    assert heads[:2] == ["Model", "Overall F1"]
    page.locator(".headline tr", has_text="alpha").locator('[data-label="Level 2"] a').first.click()
    page.wait_for_selector("#list [role=option]")
    assert page.input_value("#filter-model") == "alpha"
    assert page.input_value("#filter-level") == "2"


def test_a_matrix_cell_opens_a_replay(visit: ReportVisit) -> None:
    page = visit.open("matrix")
    first = page.locator(".matrix-cell a").first
    first.focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowRight")
    cell = page.locator(".matrix-cell a:focus")
    assert cell.get_attribute("data-at") == "1.1"
    told = cell.get_attribute("title") or ""
    key, model = told.partition(":")[0].split(", ")
    page.keyboard.press("Enter")
    expect(page.locator("#sample-title .title-key")).to_have_text(key)
    expect(page.locator("#sample-title")).to_contain_text(model)
    expect(page.locator("canvas.stage")).to_be_visible()
    page.go_back()
    expect(page.locator(".matrix-cell a").first).to_be_visible()
    page.select_option("#matrix-order", "worst")
    sums = [
        sum(int(text) for text in line.locator("a").all_inner_texts() if text != "!")
        for line in page.locator(".matrix-line").all()
    ]
    assert sums == sorted(sums)
    assert "order=worst" in visit.hash


def test_replies_are_markdown_that_can_do_nothing(visit: ReportVisit) -> None:
    visit.show(PLAN.format("oracle", 1))
    page = visit.page
    reply = page.locator(".markdown").last
    assert reply.locator(".md-heading").inner_text() == "Plan"
    assert reply.locator("strong").inner_text() == "first"
    assert reply.locator("ol > li").count() == 2
    assert reply.locator("tbody td").all_inner_texts() == ["3", "base"]
    assert "here (javascript:window.hacked=4)" in reply.inner_text()
    assert '<b onmouseover="window.hacked=5">quote</b>' in reply.inner_text()
    assert reply.locator("a, img, b, [onmouseover]").count() == 0
    page.locator("summary", has_text="Raw text").click()
    assert page.locator("pre.reply").inner_text() == MARKUP
    assert page.evaluate("window.hacked") is None


PARTS = [
    *(
        "\n",
        "\n",
        "\n\n",
        " ",
        "  ",
        "    ",
        "# ",
        "- ",
        "* ",
        "1. ",
        "> ",
        "|",
        "\n|---|---|\n",
        "`",
        "**",
    ),
    *(
        "_",
        "*",
        "[",
        "](http://x.y)",
        "![",
        "\n```\n",
        "\n~~~\n",
        "---",
        "\\",
        "<script>alert(1)</script>",
    ),
    *(
        "<img src=x onerror=alert(1)>",
        "</p>",
        "&lt;",
        "\t",
        "javascript:alert(1)",
        "\r\n",
        "(",
        ")",
    ),
]


def test_markdown_of_any_text_loses_no_word_and_makes_no_element_of_its(visit: ReportVisit) -> None:
    draw = Random(7)
    texts = []
    for _ in range(400):
        parts = [draw.choice(PARTS) for _ in range(draw.randrange(1, 40))]
        texts.append(
            "".join(f"{part}w{n}x" * draw.randrange(3) + part for n, part in enumerate(parts))
        )
    page = visit.open()
    made = page.evaluate(
        """texts => texts.map((text) => {
            const place = document.createElement("div");
            place.append(...Markdown.render(text));
            const all = [...place.querySelectorAll("*")];
            const names = all.flatMap((one) => [one.tagName, ...one.getAttributeNames()]);
            return [place.textContent, [...new Set(names)]];
        })""",
        texts,
    )
    tags = ["P", "STRONG", "EM", "CODE", "PRE", "UL", "OL", "LI", "BLOCKQUOTE", "HR", "DIV"]
    tags += ["TABLE", "THEAD", "TBODY", "TR", "TH", "TD"]
    allowed = {*tags, "class", "value", "scope", "tabindex"}
    for text, (shown, names) in zip(texts, made, strict=True):
        assert set(names) <= allowed, text
        assert set(re.findall(r"w\d+x", text)) <= set(re.findall(r"w\d+x", shown)), text


HOSTILE = [
    "*",
    "**",
    "`",
    "[",
    "_",
    "> ",
    "1. ",
    "- ",
    "|",
    "\\",
    "*a*",
    "[a",
    "`a",
    "![](",
    "- a\n\n",
]


def test_markdown_of_a_hostile_text_as_long_as_it_may_be_is_read_to_its_end(
    visit: ReportVisit,
) -> None:
    page = visit.open()
    made = page.evaluate(
        """parts => parts.map((part) => {
            const line = part.repeat(Math.floor(4900 / part.length)) + "\\n";
            const text = line.repeat(Math.floor(400_000 / line.length));
            const place = document.createElement("div");
            for (const one of Markdown.render(text)) place.append(one);
            const letters = (said) => said.split("a").length - 1;
            const elements = place.querySelectorAll("*").length;
            return [text.length, elements, letters(text), letters(place.textContent)];
        })""",
        HOSTILE,
    )
    for part, (length, elements, letters, shown) in zip(HOSTILE, made, strict=True):
        assert 0 < elements <= length, part
        assert shown == letters, part


@pytest.mark.parametrize(
    "form",
    [
        "Step {i}: Move block with index {n}",
        '"Step{i}": "Move block with index {n}",',
        "{i}. Place block {n} on top.",
        "**Step {i}**: take number {n}. It is wide.",
        "{i}) Move({n})",
    ],
)
def test_each_step_finds_its_sentence(visit: ReportVisit, form: str) -> None:
    draw = Random(form)
    page = visit.open()
    for _ in range(12):
        plan = [draw.randrange(1, 17) for _ in range(draw.randrange(1, 9))]
        said = [form.format(i=i, n=n) for i, n in enumerate(plan, 1)]
        text = "\n".join(["There are 16 candidates, of which 3 are red.", "", *said, "", "Done."])
        found = page.evaluate("([text, plan]) => Quotes.ofPlan(text, plan)", [text, plan])
        assert all(one and one in line for one, line in zip(found, said, strict=True)), text


def test_why_a_step_is_wrong_is_told_in_one_script(visit: ReportVisit) -> None:
    scripts = [*(Path(__file__).parents[2] / "phyblock/web/assets").glob("*.js")]
    for error in ERROR_TYPES:
        telling = [
            path.name for path in scripts if re.search(rf"\b{error}\b", path.read_text("utf-8"))
        ]
        assert telling == ["dom.js"]
    reasons = visit.open().evaluate(
        "names => names.map((name) => Words.reason(name, 'red arch'))", ERROR_TYPES
    )
    assert len({*reasons}) == len(ERROR_TYPES)
    assert not {*reasons} & {name.replace("_", " ") for name in ERROR_TYPES}


def test_a_wrong_step_shows_the_block_that_was_tried_and_the_sentence(visit: ReportVisit) -> None:
    visit.show(PLAN.format("oracle", 1), step="1", numbers="off")
    page = visit.page
    why = page.locator(".why")
    expect(why).to_contain_text("Glowing: what was tried, in the place of block 1")
    expect(page.locator(".said").first).to_contain_text("The goal has no green cylinder.")
    assert why.locator(".quote").inner_text() == "1. Move block with index 9."
    tried = [int(n) for n in page.evaluate("Stage.style('--tried-rgb')").split(",")]
    glowing = """(canvas, [red, green, blue]) => {
        const copy = new OffscreenCanvas(canvas.width, canvas.height);
        const context = copy.getContext("2d", { willReadFrequently: true });
        context.drawImage(canvas, 0, 0);
        const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
        let count = 0;
        for (let i = 0; i < data.length; i += 4) {
            const apart = [red, green, blue].map((value, k) => Math.abs(data[i + k] - value));
            if (data[i + 3] > 200 && Math.max(...apart) < 30) count++;
        }
        return count;
    }"""
    stage = page.locator("canvas.stage")
    assert stage.evaluate(glowing, tried) > 300
    page.locator("#scrub").fill("2")
    assert stage.evaluate(glowing, tried) == 0
    assert page.locator(".why .quote").inner_text() == "2. Move block with index 3"


def test_blocks_have_numbers_and_candidates_names_beside_their_colors(visit: ReportVisit) -> None:
    visit.show(PLAN.format("oracle", 0))
    page = visit.page
    names = page.locator(".cell-name").all_inner_texts()
    assert len(names) == 16
    assert names[0] == "red cube"
    numbered = page.locator("canvas.goal").evaluate("canvas => canvas.toDataURL()")
    page.locator("#numbers").uncheck()
    expect(page.locator("canvas.goal")).to_be_visible()
    page.wait_for_timeout(300)
    assert page.locator("canvas.goal").evaluate("canvas => canvas.toDataURL()") != numbered
    assert "numbers=off" in visit.hash


def test_on_paper_everything_is_open(visit: ReportVisit) -> None:
    page = visit.open()
    page.emulate_media(media="print", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("details:not([open])").count() == 0
    paper = "getComputedStyle(document.documentElement).backgroundColor"
    assert page.evaluate(paper) == "rgb(255, 255, 255)"
    assert not page.locator(".top nav").is_visible()
    for place in page.locator(".scroll").all():
        assert place.evaluate("place => getComputedStyle(place).overflowX") == "visible"
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("details[open]").count() == 0
    page.emulate_media(media="screen")
    visit.show(PLAN.format("oracle", 1), step="1")
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    for part in ("#panel-saw", "#panel-did", ".markdown", "canvas.stage", ".why .quote"):
        assert page.locator(part).first.is_visible(), part
    assert not page.locator("#list").is_visible()


def test_a_phone_shows_every_column_of_the_headline(visit: ReportVisit) -> None:
    page = visit.page
    page.set_viewport_size({"width": 390, "height": 844})
    visit.open()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for place in page.locator(".headline").first.locator("td[data-label]").all():
        box = place.bounding_box()
        assert box is None or (box["x"] >= 0 and box["x"] + box["width"] <= 390)
    label = page.locator(".headline tbody tr:not(.group) td[data-label]").first
    assert label.get_attribute("data-label") == "Overall F1"
    page.get_by_role("button", name="Level 3").first.click()
    assert page.locator(".headline th[aria-sort=descending]").count() == 1


LABELS = """() => {
    const seen = (one) => one.checkVisibility();
    const found = [];
    for (const one of document.querySelectorAll("a, button, select, input, summary")) {
        if (!seen(one)) continue;
        const text = (one.innerText || "").trim();
        const names = [one.getAttribute("aria-label"), text,
            ...[...(one.labels || [])].map((label) => label.innerText),
            one.querySelector("img")?.alt];
        const name = names.find((said) => said && said.trim());
        if (!name) found.push(`no name: ${one.outerHTML.slice(0, 80)}`);
        const isWord = /[a-z]{2}/i.test(text) && one.hasAttribute("aria-label");
        const isSaid = name?.toLowerCase().includes(text.toLowerCase());
        if (isWord && !one.matches("select") && !isSaid) found.push(`label: ${name}`);
    }
    const levels = [...document.querySelectorAll("h1, h2, h3, h4")].filter(seen)
        .map((one) => Number(one.tagName[1]));
    if (levels.filter((level) => level === 1).length !== 1) found.push(`h1: ${levels}`);
    const leaps = levels.some((level, i) => i && level > levels[i - 1] + 1);
    if (leaps) found.push(`order: ${levels}`);
    const ids = [...document.querySelectorAll("[id]")].map((one) => one.id);
    if (new Set(ids).size !== ids.length) found.push("an id stands twice");
    for (const name of ["aria-controls", "aria-labelledby", "aria-activedescendant"]) {
        for (const one of document.querySelectorAll(`[${name}]`)) {
            if (!document.getElementById(one.getAttribute(name))) found.push(`${name}: nothing`);
        }
    }
    for (const one of document.querySelectorAll("*")) {
        const style = getComputedStyle(one);
        const isLarger = one.scrollHeight > one.clientHeight + 1
            || one.scrollWidth > one.clientWidth + 1;
        const scrolls = /auto|scroll/.test(style.overflowY + style.overflowX) && isLarger;
        const within = "a[tabindex='0'], button, a:not([tabindex])";
        const isReached = one.tabIndex >= 0 || one.querySelector(within);
        if (seen(one) && scrolls && !isReached) found.push(`no focus: ${one.className}`);
    }
    for (const image of document.querySelectorAll("img, [role=img]")) {
        const said = image.getAttribute("alt") || image.getAttribute("aria-label");
        if (seen(image) && !said) found.push("no alt");
    }
    return found;
}"""
"""What a checker would find, of the rules that the page once broke and their like."""


@pytest.mark.parametrize(
    "address",
    [
        "results",
        "matrix",
        "samples?s=full_planning%2Foracle%2Ft5%2Fs1&step=1",
        "samples?s=full_planning%2Frandom%2Ft5%2Fs1&with=oracle",
        "samples?s=vqa%2Frandom%2For-000%2Fs0&with=oracle&track=vqa",
        "samples?s=step_planning%2Frandom%2Ft5%2Fs0&track=step_planning",
    ],
)
def test_every_view_has_names_headings_and_focus(visit: ReportVisit, address: str) -> None:
    page = visit.open(address)
    if address.startswith("samples"):
        page.wait_for_selector("#detail .tabs")
    assert page.evaluate(LABELS) == []


def test_evidence_is_a_list_that_can_be_read(visit: ReportVisit) -> None:
    visit.show("vqa/oracle/sh-000/s0", track="vqa")
    page = visit.page
    page.locator("summary", has_text="Evidence").click()
    listed = page.locator("dl.evidence").first
    assert listed.is_visible()
    assert "{" not in listed.inner_text()
