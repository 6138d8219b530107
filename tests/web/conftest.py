"""Runs, their report and their site, made once, and visits to them by one browser."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urlencode

import pytest

from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace, questions, write_lines, write_questions

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Locator, LocatorAssertions, Page


_FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
    # WebGL in software, which draws the same everywhere.
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
]
_CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")
LOOK = Path(__file__).with_name("page.js").read_text(encoding="utf-8").strip()
"""An object of functions that look at a page, as an expression."""


def expect(locator: Locator) -> LocatorAssertions:
    """Return what waits for a locator; the page forbids `eval`, which other ways need."""
    from playwright.sync_api import expect as expected

    return expected(locator)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A headless Chromium; its event loop runs while it does, so that it ends with its module."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, _CHROMIUMS)), None)
    if found is None:
        pytest.skip("no Chromium: apt-get install chromium")
    with playwright.sync_playwright() as started:
        running = started.chromium.launch(executable_path=found, args=_FLAGS)
        yield running
        running.close()


HOSTILE = (
    "<script>window.hacked = 1</script><img src=x onerror='window.hacked = 2'>"
    "</pre></script><!--<script>\u2028'\\');window.hacked = 3//\ud83d\n"
    "Step1: Move block with index 1"
)
PLAN = "1. Move block with index 9. It is green.\n2. Move block with index 3"
NAME = "<img src=x onerror='window.hacked=1'>\"&"
"""What a model and a scene of the site are called."""
SUBTASKS = ("SH", "OR", "AD")
LIGHT: Any = {"viewport": {"width": 1400, "height": 1000}, "color_scheme": "light"}
WITHOUT_WEBGL = """HTMLCanvasElement.prototype.getContext = new Proxy(
    HTMLCanvasElement.prototype.getContext,
    { apply: (get, canvas, [kind, ...more]) =>
        kind.startsWith("webgl") ? null : get.call(canvas, kind, ...more) })"""


class Visit:
    """A page, of a file if it is one, and all that it complained of or asked for."""

    def __init__(self, page: Page, path: Path | None = None) -> None:
        self.page = page
        self.path = path
        self.complaints: list[str] = []
        self.requests: list[str] = []
        page.on("console", lambda message: self._complain(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", lambda dialog: self.complaints.append(dialog.message))
        page.on("request", lambda request: self.requests.append(request.url))

    def _complain(self, text: str) -> None:
        # A driver without a graphics card speaks of its own speed.
        if "GL Driver Message" not in text:
            self.complaints.append(text)

    def asked_elsewhere(self, *own: str) -> list[str]:
        """Return the requests to addresses that do not begin so."""
        return [url for url in self.requests if not url.startswith(own)]

    def open(self, view: str = "results", **words: str) -> Page:
        """Open a view and wait until it is shown."""
        query = f"?{urlencode(words, quote_via=quote)}" if words else ""
        self.page.goto("about:blank")
        self.page.goto(f"{self.path.as_uri()}#{view}{query}")
        expect(self.page.locator("html")).to_have_attribute("data-shown", view)
        return self.page

    def show(self, sample: str, **words: str) -> Page:
        return self.open("samples", s=sample, **words)

    def count(self, text: str) -> None:
        """Wait until the list says this of itself."""
        expect(self.page.locator("aside [role=status]")).to_have_text(text)

    @property
    def words(self) -> set[str]:
        """The view, and what else the address says."""
        found: str = self.page.evaluate("location.hash")
        return set(re.split("[#?&]", found)) - {""}


@pytest.fixture(scope="session")
def made(new_workspace: Callable[..., Workspace]) -> Workspace:
    """A run, with its report, of two baselines on five scenes and six questions, two seeds each, in
    four tracks; `later.zip` is a bundle of two in one of them.

    One reply says `HOSTILE`, one plans 9, 3; one is missing. No test changes it.
    """
    made = new_workspace()
    write_questions(made.root / "questions", questions(per_subtask=2, subtasks=SUBTASKS))
    made.write_suite(name="later", models=["random", "all-candidates"], seeds=[0, 1])
    made.out = made.root / "later"
    made.completed()
    made.does("bundle", "later", "--out", "later.zip")
    made.write_suite(
        tracks=["full_planning", "vqa", "step_planning", "pose_planning"],
        vqa={"path": "./questions", "subtasks": list(SUBTASKS)},
        steps={"physics": "off"},
        seeds=[0, 1],
    )
    made.out = made.root / "first"
    made.completed()
    lines = made.records()
    by_name = {record["sample"]: record for record in lines}
    hostile, planned = (by_name[f"full_planning/{one}"] for one in ("random/t3/s0", "oracle/t5/s1"))
    hostile["reply"] |= {"text": HOSTILE, "reasoning": HOSTILE}
    hostile["parse"]["rule"] = HOSTILE
    planned["reply"]["text"], planned["parse"]["plan"] = PLAN, [9, 3]
    for score in planned["scores"]:
        if score.get("placed"):
            score |= {"placed": [None, 0], "why": ["shape_not_in_gt", None]}
    lost = {"reply": None, "outcome": "missing", "scores": [], "parse": None}
    by_name["full_planning/random/t4/s0"].update(lost)
    write_lines(made.out / "records.jsonl", lines)
    made.does("report", made.out)
    return made


@pytest.fixture(scope="session")
def troubled(new_workspace: Callable[..., Workspace]) -> Workspace:
    """A run of two models, of which one has no key, limited to two items of each track."""
    troubled, tracks = new_workspace(), ["full_planning", "step_planning"]
    asked = {"tracks": tracks, "steps": {"physics": "off"}, "seeds": [0], "limit": 2}
    troubled.write_suite(models=["alpha", "locked"], description="The 400 scenes.", **asked)
    with Running(OpenAIChat()) as good, Running(OpenAIChat(Faults(mode="401"))) as bad:
        troubled.write_served({"alpha": good.url, "locked": bad.url})
        troubled.run()
    troubled.phyblock("report", troubled.out)
    return troubled


@pytest.fixture(scope="session")
def site(made: Workspace) -> Path:
    """The page of a site of a bundle and a run whose model `random` and scene `t3` are `NAME`."""
    folder = made.root / "hostile"
    folder.mkdir()
    manifest = (made.out / "run.yaml").read_text(encoding="utf-8")
    renamed = manifest.replace("name: random", f'name: "{json.dumps(NAME)[1:-1]}"')
    (folder / "run.yaml").write_text(renamed, encoding="utf-8")
    lines = made.records()
    for record in lines:
        for field in ("model", "key", "scene"):
            record[field] = NAME if record[field] in ("random", "t3") else record[field]
        record["sample"] = f"{record['track']}/{record['model']}/{record['key']}/s{record['seed']}"
        if record["model"] == NAME and record["reply"]:
            record["reply"]["text"] = record["reply"]["reasoning"] = HOSTILE
    write_lines(folder / "records.jsonl", lines)
    data = ("--data", "data", "--data", "questions")
    named = ("--title", f"A site {NAME}", "--out", "site")
    done = made.does("site", "hostile", "later.zip", *data, *named)
    assert "4 models and baselines, 104 samples" in done.out
    return made.root / "site" / "index.html"


@pytest.fixture(scope="module")
def context(browser: Browser) -> Iterator[BrowserContext]:
    """Pages that are read: drawing takes longest."""
    made = browser.new_context(**LIGHT)
    made.add_init_script(WITHOUT_WEBGL)
    yield made
    made.close()


@pytest.fixture
def visiting(browser: Browser, context: BrowserContext) -> Iterator[Callable[..., Visit]]:
    """Visits to pages by their paths, which may complain of nothing and ask for nothing else; one
    that draws has WebGL and a clock of its own.
    """
    visits: list[Visit] = []

    def visit(path: Path, *, draws: bool = False) -> Visit:
        page = browser.new_page(**LIGHT) if draws else context.new_page()
        visits.append(Visit(page, path))
        return visits[-1]

    yield visit
    for one in visits:
        assert one.page.evaluate("window.hacked") is None
        one.page.close()
        assert one.complaints == []
        assert one.asked_elsewhere(one.path.parent.as_uri(), "about:") == []


@pytest.fixture
def visit(visiting: Callable[..., Visit], made: Workspace) -> Visit:
    return visiting(made.out / "report.html")


@pytest.fixture
def trouble(visiting: Callable[..., Visit], troubled: Workspace) -> Visit:
    return visiting(troubled.out / "report.html")
