"""The operator's page in a browser without a window: what it shows, what people do on it, and when it is not live."""

import asyncio
import os
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fake_desk import REPORT, FakeDesk
from fake_face import FakeFace
from faultbond.service.web.application import application
from faultbond.service.web.page_files import page_files
from faultbond.service.web.security import Guard, LocalGuard, LoginGuard, Role

uvicorn = pytest.importorskip("uvicorn", reason='there is no uvicorn: pip install "faultbond[serve]"')

AXE = "axe-core@4.14.1"
RULES = {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]}
COLOURS = {"type": "rule", "values": ["color-contrast", "link-in-text-block"]}  # all that a dark page can be wrong in
VIEWS = {
    "overview": "#/",
    "several": "#/tank_2",
    "healthy": "#/tank_1",
    "no data": "#/motor_2",
    "shelved": "#/tank_4",
    "off line": "#offline",
}
READY = "#main[data-place]:not([data-place=''])"
LARGEST_LOAD = 200_000  # bytes


class Served:
    """An application served on a port of this machine, with a made-up service behind it."""

    def __init__(self, guard: Guard | None = None) -> None:
        self.face, self.desk = FakeFace(), FakeDesk()
        self.guard = guard or LocalGuard()
        self.port = 0
        self.start()

    def start(self) -> None:
        """Serve, on the same port as before."""
        self.server = uvicorn.Server(
            uvicorn.Config(
                application(self.face, self.guard, desk=self.desk),
                port=self.port,
                log_level="error",
                timeout_graceful_shutdown=1,
            )
        )
        self.thread = threading.Thread(target=self._run)
        self.thread.start()
        while not self.server.started:
            time.sleep(0.01)
        self.port = self.server.servers[0].sockets[0].getsockname()[1]

    def _run(self) -> None:
        async def serve() -> None:
            self.loop = asyncio.get_running_loop()
            await self.server.serve()

        asyncio.run(serve())

    @property
    def address(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self.port}/"

    def tick(self) -> None:
        """Pass a sample."""
        self.loop.call_soon_threadsafe(self.face.tick)

    def stop(self) -> None:
        """Serve no more."""
        self.loop.call_soon_threadsafe(self.face.stop)
        self.server.should_exit = True
        self.thread.join(10.0)


@pytest.fixture
def served() -> Iterator[Served]:
    """A service on the loopback address."""
    made = Served()
    yield made
    made.stop()


@pytest.fixture
def opened(browser: Any, served: Served) -> Iterator[Callable[..., Any]]:
    """Opens a view; `wrong` of the page is what its console complains of, `asked` what it asks for."""
    pages = []

    def made(view: str = "#/", width: int = 1280, *, is_dark: bool = False, ready: str = READY) -> Any:
        page = browser.new_page(
            viewport={"width": width, "height": 900},
            color_scheme="dark" if is_dark else "light",
            reduced_motion="reduce",
        )
        page.set_default_timeout(10_000)
        page.asked, page.wrong = [], []
        page.on("request", lambda request: page.asked.append(request.url))
        page.on("pageerror", lambda problem: page.wrong.append(str(problem)))
        page.on("console", lambda message: page.wrong.append(message.text) if message.type != "log" else None)
        page.goto(served.address + view)
        page.wait_for_selector(ready)
        pages.append(page)
        return page

    yield made
    for page in pages:
        page.close()


@pytest.fixture(scope="module")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The script of axe-core, fetched once into the cache of tests."""
    cache = Path(os.environ.get("FAULTBOND_CACHE") or tmp_path_factory.mktemp("axe")) / AXE
    script = cache / "package" / "axe.min.js"
    if not script.exists():
        if shutil.which("npm") is None:
            pytest.skip("there is no npm to fetch axe-core with")
        cache.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(["npm", "pack", AXE], cwd=cache, capture_output=True, check=False, timeout=120)
        if done.returncode:
            pytest.skip("npm cannot fetch axe-core")
        shutil.unpack_archive(next(cache.glob("*.tgz")), cache, "gztar")
    return script.read_text(encoding="utf-8")


def violations(page: Any, axe: str, rules: dict[str, Any] = RULES) -> list[str]:
    """Give what axe-core finds wrong; of what is right it lists nothing, which would take half of its time."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(axe)
    asked = {"runOnly": rules, "resultTypes": ["violations"], "selectors": False}
    found = page.evaluate("(asked) => axe.run(asked)", asked)["violations"]
    return [f"{item['id']}: {node['html']} {node['failureSummary']}" for item in found for node in item["nodes"]]


def until(page: Any, script: str, argument: object = None) -> None:
    """Wait until something is so; the page's policy forbids what Playwright has for that."""
    end = time.monotonic() + 15.0
    while not page.evaluate(script, argument):
        assert time.monotonic() < end, script
        page.wait_for_timeout(30)


def is_overfull(page: Any) -> bool:
    """Whether the page is wider than the window."""
    return bool(page.evaluate("document.documentElement.scrollWidth > innerWidth"))


def unfold(page: Any) -> None:
    """Open all that is folded."""
    page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
    page.wait_for_timeout(100)


INK = """() => { const all = [...document.querySelectorAll(".charts canvas")];
  return all.length > 0 && all.every((canvas) => {
  if (!canvas.clientWidth) return false;
  const copy = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
  const pen = copy.getContext("2d", { willReadFrequently: true });
  pen.drawImage(canvas, 0, 0);
  const pixels = pen.getImageData(0, 0, canvas.width, canvas.height).data;
  return pixels.some((value, k) => k % 4 === 3 && value > 0); }); }"""


def test_on_a_phone_less_is_open_and_the_rest_a_key_away(opened: Callable[..., Any], served: Served) -> None:
    """What is wrong and what may be at fault stand there; the plots are drawn once they are opened, and stay open."""
    page = opened("#/tank_2", 390, ready=".candidates li")
    assert page.locator("details[open]").count() == 0
    folded = page.locator("main summary").all_inner_texts()
    assert folded == ["Probability over time", "Plant", "Measured and expected", "Journal", "Data"]
    height, all_open = "document.documentElement.scrollHeight", opened("#/tank_2", 390, ready=".candidates li")
    unfold(all_open)
    assert page.evaluate(height) < 0.6 * all_open.evaluate(height)
    assert not page.locator(".charts canvas").first.is_visible()
    page.focus(".panel.trends summary")
    page.keyboard.press("Enter")
    until(page, INK)
    assert page.locator(".charts canvas").first.is_visible()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.closest('.panel.trends') !== null")
    served.tick()
    page.wait_for_timeout(300)
    assert page.locator(".panel.trends details").get_attribute("open") is not None
    page.set_viewport_size({"width": 1280, "height": 900})
    until(page, "document.querySelectorAll('main details:not([open])').length === 0")
    until(page, INK)
    assert page.wrong == []


def test_on_a_screen_all_is_open(opened: Callable[..., Any]) -> None:
    """Nothing folds there by a click, and the keyboard does not stop at headings."""
    page = opened("#/tank_2")
    page.click(".panel.trends summary")
    assert page.locator("main details:not([open])").count() == 0
    assert page.evaluate("[...document.querySelectorAll('main summary')].every((item) => item.tabIndex === -1)")


def test_the_overview_tells_what_needs_attention(opened: Callable[..., Any]) -> None:
    """What needs somebody is listed, the unacknowledged alarm first; no data is not normal; silence is told."""
    page = opened()
    rows = page.locator("section[aria-labelledby=of-attention] tbody tr")
    assert [row.get_attribute("data-asset") for row in rows.all()] == ["tank_2", "tank_3", "motor_2", "motor_3"]
    assert page.locator("section[aria-labelledby=of-silenced] tbody tr").get_attribute("data-asset") == "tank_4"
    assert page.locator("tr[data-asset=motor_2] .condition").inner_text() == "No data"
    assert page.locator("#count").inner_text() == "1 alarm to acknowledge"
    assert page.locator(".tiles li").count() == 7
    assert page.locator("#live-text").inner_text().startswith("Live ")
    assert page.title() == "(1) Water works north"


def test_an_asset_tells_what_is_wrong(opened: Callable[..., Any], served: Served) -> None:
    """Verdict, candidates with their values, group, advice, drawing, data and plots are there."""
    page = opened("#/tank_2")
    text = page.inner_text("main")
    for part in (
        "Cannot yet be told apart",
        "51.2",
        "K6",
        "+272 %",
        "Two explanations",
        "move u_out to 20 %",
        "uncertain",
    ):
        assert part in text
    heat = page.evaluate(
        """() => {
            const parts = document.querySelector('.picture').shadowRoot.querySelectorAll('[data-component]');
            const heatOf = (part) => Number(part.querySelector('.heat').getAttribute('opacity'));
            return Object.fromEntries([...parts].map((part) => [part.dataset.component, heatOf(part)]));
        }"""
    )
    assert heat["leak"] > heat["outlet"] > heat["pipe"] > heat["tank"] == 0
    assert page.locator(".charts figure").count() == 4
    drawn = """() => [...document.querySelectorAll('.charts canvas')].every((canvas) =>
        new Set(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data).size > 20)"""
    until(page, drawn)
    assert page.wrong == []


def test_samples_come_in(opened: Callable[..., Any], served: Served) -> None:
    """A sample is on the page soon after it was taken."""
    page = opened("#/tank_1")
    until(page, "document.querySelector('.range').textContent.startsWith('Now')")
    before = page.inner_text(".range")
    until(page, INK)
    page.evaluate("window.kept = [...document.querySelectorAll('.charts canvas')]")
    served.tick()
    until(page, "(before) => document.querySelector('.range').textContent !== before", before)
    assert page.evaluate("window.kept.every((canvas) => canvas.isConnected)"), "they are drawn on, not made anew"
    facts = page.inner_text("dl.facts")
    assert f"{served.face.now + 1:,}".replace(",", "\u202f") in facts


def test_an_alarm_is_acknowledged_by_keyboard(opened: Callable[..., Any], served: Served) -> None:
    """From the overview to the deed no pointer is needed, the focus is always seen, and the journal tells it."""
    page = opened()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "skip"
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "tank_2"
    page.keyboard.press("Enter")
    page.wait_for_selector("button[data-action=acknowledge]")
    for _ in range(20):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.dataset.action") == "acknowledge":
            break
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    page.keyboard.press("Enter")
    page.wait_for_selector("dialog[open]")
    page.keyboard.type("On my way.")
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    page.wait_for_selector("dialog", state="hidden")
    until(page, "document.querySelector('.journal').textContent.includes('On my way.')")
    done = served.face.done[-1]
    assert (done.asset, done.action.value, done.who, done.comment) == ("tank_2", "acknowledge", "local", "On my way.")
    assert page.locator("button[data-action=acknowledge]").count() == 0
    assert "acknowledged by local" in page.inner_text(".title")
    assert page.locator("#count").is_hidden()


def test_a_diagnosis_is_accepted_and_taken_back(opened: Callable[..., Any], served: Served) -> None:
    """The dialog says what will happen and which diagnosis is meant; decisions can be undone, the last one first."""
    page = opened("#/tank_2")
    page.click("button[data-action=reject]")
    page.click("dialog button[type=submit]")
    page.wait_for_selector(".journal button[data-action=undo]")
    page.click("button[data-action=accept]")
    assert "becomes the model from now on" in page.inner_text("dialog")
    page.get_by_role("radio").nth(1).check()
    page.click("dialog button[type=submit]")
    until(page, "document.querySelector('.group-hint').textContent.startsWith('No alarm')")
    assert served.face.done[-1].target == ("K4",)
    for number, action in ((5, "accept"), (4, "reject")):
        assert page.locator(".journal button[data-action=undo]").count() == 1
        page.click(".journal button[data-action=undo]")
        assert f"{action} by local" in page.inner_text("dialog")
        page.click("dialog button[type=submit]")
        page.wait_for_selector("button[data-action=acknowledge]")
        until(page, f"document.querySelector('.journal').innerText.includes('undone by {11 - number}')")
        assert served.face.done[-1].undone == number
    assert page.locator(".journal button[data-action=undo]").count() == 0


def test_shelving_needs_a_length_and_a_reason(opened: Callable[..., Any], served: Served) -> None:
    """Without a reason nothing is sent; with it the alarm is shelved for as long as was chosen."""
    page = opened("#/tank_2")
    page.click("button[data-action=shelve]")
    page.select_option("#deed-minutes", "30")
    page.click("dialog button[type=submit]")
    assert page.locator("dialog[open]").count() == 1
    assert served.face.done == []
    page.fill("#deed-comment", "Pump is being cleaned.")
    page.click("dialog button[type=submit]")
    page.wait_for_selector("button[data-action=unshelve]")
    assert served.face.done[-1].minutes == 30


def test_what_is_refused_is_told_in_the_dialog(opened: Callable[..., Any], served: Served) -> None:
    """Where the service cannot keep a deed, the dialog stays, says why, and keeps what was written."""
    served.face.is_full = True
    page = opened("#/tank_2")
    page.click("button[data-action=acknowledge]")
    page.fill("#deed-comment", "Seen.")
    page.click("dialog button[type=submit]")
    page.wait_for_selector(".problem-line:not([hidden])")
    assert "the disk is full" in page.inner_text("dialog [role=alert]")
    assert page.input_value("#deed-comment") == "Seen."
    page.keyboard.press("Escape")
    page.wait_for_selector("dialog", state="hidden")


@pytest.mark.parametrize("view", ["#/", "#/tank_2"])
def test_a_lost_service_is_told(opened: Callable[..., Any], served: Served, view: str, axe: str) -> None:
    """Where the service is gone nothing is called live or normal and nothing can be done; then it comes back."""
    page = opened(view)
    served.stop()
    page.wait_for_selector("#lost:not([hidden])")
    told = page.inner_text("#lost")
    assert re.match(r"Not live since \d\d:\d\d:\d\d\sUTC\. What stands below is what was known then", told)
    assert page.title().startswith("Not live")
    assert "Live" not in page.inner_text("#live-text").split()
    until(page, "document.querySelector('main .condition').textContent.startsWith('Not known, was')")
    assert "Normal" not in page.inner_text("main")
    if view != "#/":
        assert page.locator("button[data-action]:enabled").count() == 0
        assert page.inner_text(".range").startswith("Last known")
    assert violations(page, axe) == []
    served.start()
    page.wait_for_selector("#lost", state="hidden", timeout=20_000)
    until(page, "document.querySelector('#live-text').textContent.startsWith('Live ')")
    until(page, "!document.querySelector('main').textContent.includes('Not known')")


@pytest.mark.parametrize("view", ["#/", "#/tank_2"])
def test_what_does_not_work_of_the_service_is_told(
    opened: Callable[..., Any], served: Served, view: str, axe: str
) -> None:
    """On top of each page, for as long as it is so; a page that opens meanwhile has it, too."""
    page = opened(view)
    assert page.is_hidden("#troubles")
    served.loop.call_soon_threadsafe(served.face.fail, "store: the disk is full.", "tell scada: refused.")
    page.wait_for_selector("#troubles:not([hidden])")
    told = ["store: the disk is full.", "tell scada: refused."]
    assert page.locator("#troubles p").all_inner_texts() == told
    assert violations(page, axe) == []
    assert opened(view).locator("#troubles p").all_inner_texts() == told
    served.loop.call_soon_threadsafe(served.face.fail)
    page.wait_for_selector("#troubles", state="hidden")


def test_a_silent_service_is_lost_too(browser: Any, served: Served) -> None:
    """Where the connection stands and nothing is heard any more, the page says so."""
    page = browser.new_page()
    page.clock.install()
    page.goto(served.address)
    page.wait_for_selector(READY)
    blocked = threading.Event()
    served.loop.call_soon_threadsafe(blocked.wait, 20.0)
    try:
        for _ in range(10):
            page.clock.run_for(1000)
        page.wait_for_selector("#lost:not([hidden])", timeout=10_000)
    finally:
        blocked.set()
        page.close()


def test_no_data_is_not_called_now(opened: Callable[..., Any]) -> None:
    """The plots of an asset without data show what was last known, and say so."""
    page = opened("#/motor_2")
    until(page, "document.querySelector('.range').textContent.startsWith('Last known')")
    assert "Nothing is judged now: no data." in page.inner_text("main")


def test_a_period_of_the_past(opened: Callable[..., Any], served: Served) -> None:
    """By pointer or keys one looks closer and back, and returns to now; new samples do not disturb that."""
    page = opened("#/tank_2")
    until(page, "document.querySelector('.range').textContent.startsWith('Now')")
    page.locator(".charts canvas").first.scroll_into_view_if_needed()
    box = page.locator(".charts canvas").first.bounding_box()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 50, steps=4)
    page.mouse.up()
    until(page, "document.querySelector('.range').textContent.startsWith('Past')")
    chosen = page.inner_text(".range")
    served.tick()
    page.focus(".charts")
    page.keyboard.press("ArrowLeft")
    until(page, "(text) => document.querySelector('.range').textContent !== text", chosen)
    page.keyboard.press("Home")
    until(page, "document.querySelector('.range').textContent.startsWith('Now')")
    assert page.wrong == []


VALUES = """() => [...document.querySelectorAll(".charts figure")].map((figure) =>
  [...figure.querySelectorAll(".u-series:not(.edge) .u-value")].slice(1).map((value) => value.innerText))"""
CURSORS = """() => {
  const lines = [...document.querySelectorAll(".charts .u-cursor-x")];
  return [...new Set(lines.map((line) => line.style.transform))];
}"""


def test_a_pointer_tells_values_in_all_plots(opened: Callable[..., Any]) -> None:
    """Where none is, the last values are told; a double click in the past goes back to now."""
    page = opened("#/tank_2")
    until(page, f"({VALUES})().flat().length && ({VALUES})().flat().every((value) => /\\d/.test(value))")
    last = page.evaluate(VALUES)
    page.locator(".charts canvas").first.scroll_into_view_if_needed()
    box = page.locator(".charts .u-over").first.bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + 50)
    told = page.evaluate(VALUES)
    assert all(one != other for one, other in zip(told[:3], last[:3], strict=True))
    assert len(page.evaluate(CURSORS)) == 1
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 50, steps=4)
    page.mouse.up()
    until(page, "document.querySelector('.range').textContent.startsWith('Past')")
    assert page.evaluate("[...document.querySelectorAll('.u-select')].every((part) => !part.clientWidth)")
    page.mouse.dblclick(box["x"] + 0.4 * box["width"], box["y"] + 50)
    until(page, "document.querySelector('.range').textContent.startsWith('Now')")
    page.mouse.move(5, 5)
    until(page, f"(last) => JSON.stringify(({VALUES})()) === JSON.stringify(last)", last)
    assert page.wrong == []


@pytest.mark.parametrize("width", [360, 768, 1440, 2560])
@pytest.mark.parametrize("view", VIEWS)
def test_nothing_is_wider_than_the_window(opened: Callable[..., Any], view: str, width: int) -> None:
    """From a phone to a wall screen nothing has to be scrolled sideways."""
    page = opened(VIEWS[view], width)
    assert not is_overfull(page)
    unfold(page)
    assert not is_overfull(page)


def test_a_dialog_fits_a_phone(opened: Callable[..., Any]) -> None:
    """A dialog with a choice is whole on a phone."""
    page = opened("#/tank_2", 360)
    page.click("button[data-action=accept]")
    box = page.locator("dialog").bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 360
    assert not is_overfull(page)


@pytest.mark.parametrize("is_dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("width", [360, 1280])
def test_everybody_can_use_it(opened: Callable[..., Any], view: str, width: int, is_dark: bool, axe: str) -> None:
    """axe-core finds no violation of WCAG AA in any view, on a phone or a screen, light or dark."""
    page = opened(VIEWS[view], width, is_dark=is_dark)
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, re.findall(r"\d+", paper))) < 200) == is_dark
    rules = COLOURS if is_dark else RULES
    assert violations(page, axe, rules) == []
    if page.locator("details:not([open])").count():
        unfold(page)
        assert violations(page, axe, rules) == []


def test_a_dark_page_differs_in_colours_alone() -> None:
    """What is dark gives other values to colours that have names, so no rule but those of colours can tell it."""
    sheets = [file.content.decode() for name, file in page_files().items() if name.endswith(".css")]
    found = [
        block for text in sheets for block in re.findall(r"^@media .*: dark.*\{\n((?:  .*\n)*)\}", text, re.MULTILINE)
    ]
    assert len(found) == sum(text.count("dark)") for text in sheets) == 2
    for block in found:
        left = re.sub(r"--[\w-]+: #[0-9a-f]{6};|color-scheme: dark;", "", block)
        assert left.split() == [':root:not([data-theme="light"])', "{", "}"]


@pytest.mark.parametrize("action", ["acknowledge", "shelve", "accept", "out of service"])
def test_everybody_can_use_the_dialogs(opened: Callable[..., Any], action: str, axe: str) -> None:
    """axe-core finds no violation in the dialogs."""
    page = opened("#/tank_2")
    page.click(f"button[data-action='{action}']")
    assert violations(page, axe) == []


TOUR = ("How the plant stands", "The plant", "Measured and expected", "What may be at fault", "What you can do")
TOURED = (".verdict", ".plant-drawing", ".trends", ".explanations", ".verdict .buttons")


def toured(page: Any, step: int) -> None:
    """See that a step of the tour stands in the window beside its part, and that the part can be seen."""
    until(page, "(title) => document.getElementById('tour-title')?.textContent === title", TOUR[step])
    assert page.inner_text("#tour-card .hint") == f"Step {step + 1} of 5"
    assert page.locator("[data-toured]").count() == 1
    part = page.locator(f"{TOURED[step]}[data-toured]").bounding_box()
    card, window = page.locator("#tour-card").bounding_box(), page.viewport_size
    assert card["x"] >= 0
    assert card["x"] + card["width"] <= window["width"]
    assert card["y"] + card["height"] <= window["height"]
    assert -1 <= part["y"] < card["y"] + card["height"]
    is_beside = part["x"] + part["width"] <= card["x"] or card["x"] + card["width"] <= part["x"]
    assert is_beside or min(part["height"], 120) <= abs(card["y"] - part["y"]), "its title can be read"
    assert not is_overfull(page)


@pytest.mark.parametrize("is_dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [360, 768, 1280, 1920])
def test_the_tour_points_at_five_parts(opened: Callable[..., Any], width: int, is_dark: bool, axe: str) -> None:
    """From the overview it goes to the asset with the alarm; each step is whole, and anybody can use it."""
    page = opened(width=width, is_dark=is_dark)
    page.click("#tour")
    page.wait_for_selector("#tour-card[open]")
    assert page.evaluate("location.hash") == "#/tank_2"
    for step in range(5):
        toured(page, step)
        assert violations(page, axe, COLOURS if is_dark else RULES) == []
        page.click("#tour-card button.main")
    page.wait_for_selector("#tour-card", state="hidden")
    page.wait_for_selector("[data-toured]", state="detached")  # the dialog tells that it is closed a task later
    assert page.wrong == []


def test_the_tour_by_keyboard(opened: Callable[..., Any], served: Served) -> None:
    """The focus stays on the card, arrows go on and back, Escape ends it, and the focus is where it came from."""
    page = opened("#/tank_1")
    page.focus("#tour")
    page.keyboard.press("Enter")
    toured(page, 0)
    assert page.locator("#tour-card button:visible").all_inner_texts() == ["End tour", "Next"]
    page.keyboard.press("Enter")
    toured(page, 1)
    seen = set()
    for _ in range(8):
        page.keyboard.press("Tab")
        seen.add(page.evaluate("document.activeElement.closest('dialog')?.id ?? document.activeElement.localName"))
    assert seen <= {"tour-card", "body"}, "nothing behind it; a browser may count its own window"
    page.keyboard.press("ArrowRight")
    toured(page, 2)
    served.tick()
    for key, step in (("ArrowLeft", 1), ("ArrowLeft", 0), ("ArrowLeft", 0)):
        page.keyboard.press(key)
        toured(page, step)
    page.keyboard.press("Escape")
    page.wait_for_selector("#tour-card", state="hidden")
    assert page.evaluate("document.activeElement.id") == "tour"
    page.wait_for_selector("[data-toured]", state="detached")  # the dialog tells that it is closed a task later
    page.keyboard.press("Enter")
    toured(page, 0)
    page.evaluate("location.hash = '#/motor_1'")
    page.wait_for_selector("#tour-card", state="hidden")
    assert page.wrong == []


def test_the_tour_is_offered_once_of_what_is_simulated(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether one takes it or not; of a plant there is the button alone, and it says nothing of a simulation."""
    page = opened()
    page.get_by_role("button", name="No, thanks").click()
    assert page.locator("#offer").is_hidden()
    assert page.evaluate("document.activeElement.id") == "tour"
    page.reload()
    page.wait_for_selector("#tour:not([hidden])")
    assert page.locator("#offer").is_hidden()
    page.click("#tour")
    toured(page, 0)
    assert "simulated" in page.inner_text("#tour-card")
    page = opened()
    page.get_by_role("button", name="Show me").click()
    toured(page, 0)
    page.keyboard.press("Escape")
    until(page, "document.activeElement.id === 'tour'")
    assert page.locator("#offer").is_hidden()
    known = served.face.site
    monkeypatch.setattr(served.face, "site", lambda: {**known(), "source": "mqtt://broker/plant"})
    page = opened()
    page.wait_for_selector("#tour:not([hidden])")
    assert page.locator("#offer").is_hidden()
    page.click("#tour")
    toured(page, 0)
    assert "simulated" not in page.inner_text("#tour-card")


def test_the_page_asks_nobody_else(opened: Callable[..., Any], served: Served) -> None:
    """The first load is small, comes from the service alone, and breaks no rule of its policy."""
    page = opened()
    assert [url for url in page.asked if not url.startswith(served.address)] == []
    assert page.wrong == []
    size = page.evaluate(
        """() => [...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')]
        .reduce((sum, item) => sum + (item.transferSize || 0), 0)"""
    )
    assert 10_000 < size < LARGEST_LOAD


def test_an_asset_that_there_is_not(opened: Callable[..., Any]) -> None:
    """A name that there is not is told, and a way back is shown."""
    page = opened("#/nothing", ready="main h1")
    assert page.inner_text("main h1") == "There is no asset 'nothing'."
    page.click("main a")
    page.wait_for_selector(".tiles")


def test_a_picture_of_the_process_is_coloured_too(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A picture with styles and scripts of its own is shown with the styles and without the scripts."""
    picture = (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 50"><style>.a{stroke:rgb(1, 2, 3)}</style>'
        '<script>window.broken = true</script><g data-component="leak" onclick="window.broken = true">'
        '<rect class="a" style="fill: rgb(4, 5, 6)" width="20" height="10"/></g></svg>'
    )
    known = served.face.asset
    monkeypatch.setattr(served.face, "asset", lambda name: {**known(name), "drawing": picture})
    page = opened("#/tank_2")
    found = page.evaluate(
        """() => { const root = document.querySelector('.picture').shadowRoot,
        rect = root.querySelector('.a:not(.heat *)');
        root.querySelector('g').dispatchEvent(new Event('click'));
        return [getComputedStyle(rect).stroke, getComputedStyle(rect).fill, root.querySelectorAll('.heat').length,
        root.querySelectorAll('script').length, window.broken ?? false]; }"""
    )
    assert found == ["rgb(1, 2, 3)", "rgb(4, 5, 6)", 1, 0, False]


PROCESS = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 90 40"><style>.body{COLOURS}</style><g data-component="leak">'
    '<path id="leak" class="body" d="M10 10 L30 20"><title>The gap</title></path></g>'
    '<g data-component="outlet"><text y="30">out</text></g></svg>'
)
THEMED = PROCESS.replace("COLOURS", "fill:none;stroke:currentColor")
FIXED = PROCESS.replace("COLOURS", "fill:none;stroke:#000")
SEEN = """() => {
    const host = document.querySelector('.picture'), root = host.shadowRoot;
    const parts = [...root.querySelectorAll('[data-component]')].map((part) => {
        const heat = part.querySelector('.heat'), drawn = getComputedStyle(heat.firstElementChild);
        return [part.dataset.component, part.querySelector('title').textContent,
            Number(heat.getAttribute('opacity')) > 0.3, heat.firstElementChild.localName, drawn.stroke, drawn.fill];
    });
    return { parts, ids: root.querySelectorAll('#leak').length, label: root.querySelector('svg').ariaLabel,
        paper: getComputedStyle(host).backgroundColor, ink: getComputedStyle(root.querySelector('#leak')).stroke,
        wide: root.querySelector('svg').getBoundingClientRect().width / host.parentElement.clientWidth };
}"""


@pytest.mark.parametrize("is_dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_the_picture_of_the_process_or_the_model_is_shown(
    opened: Callable[..., Any], served: Served, width: int, is_dark: bool, axe: str
) -> None:
    """Both are coloured by suspicion; which of them is seen is chosen by a button, and stays so."""
    served.face.pictures = {"tank_2": THEMED, "tank_3": FIXED}
    page = opened("#/tank_2", width, is_dark=is_dark)
    unfold(page)
    until(page, "document.querySelector('.picture.process') !== null")
    seen, suspicion = page.evaluate(SEEN), served.face.asset("tank_2")["suspicion"]
    hot = "rgb(194, 86, 15)" if is_dark else "rgb(240, 123, 47)"
    assert seen["parts"] == [
        ["leak", f"The gap: {100 * suspicion['leak']:.1f} %", True, "path", hot, "none"],
        ["outlet", f"outlet: {100 * suspicion['outlet']:.1f} %", True, "rect", hot, hot],
    ]
    assert (seen["ids"], seen["paper"]) == (1, "rgba(0, 0, 0, 0)")
    assert seen["ink"] == ("rgb(232, 237, 242)" if is_dark else "rgb(22, 32, 43)")
    assert "at fault may be leak 53" in seen["label"]
    assert 0.9 < seen["wide"] <= 1.0
    assert not is_overfull(page)
    assert "pressure" in page.inner_text(".instruments"), "what is not in the picture is listed below it"
    assert violations(page, axe, COLOURS if is_dark else RULES) == []
    page.get_by_role("button", name="Model").press("Enter")
    assert page.evaluate("document.querySelector('.picture').shadowRoot.querySelectorAll('.node').length") > 5
    served.tick()
    page.goto(served.address + "#/tank_3")
    until(page, "document.querySelector('#asset-title')?.textContent.startsWith('tank_3')")
    unfold(page)
    until(page, "document.querySelector('.picture:not(.process)') !== null")
    page.get_by_role("button", name="Process").click()
    until(page, "document.querySelector('.picture.on-paper') !== null")
    seen = page.evaluate(SEEN)
    assert (seen["paper"], seen["ink"]) == ("rgb(255, 255, 255)", "rgb(0, 0, 0)"), "as it was drawn, in any theme"
    assert violations(page, axe, COLOURS if is_dark else RULES) == []
    assert page.wrong == []


def test_without_a_picture_there_is_nothing_to_choose(opened: Callable[..., Any], served: Served) -> None:
    """Nor where it cannot be had: the bond graph stays."""
    page = opened("#/tank_2")
    assert page.locator(".plant-drawing .buttons").is_hidden()
    served.face.pictures = {"tank_4": " "}
    served.face.picture = lambda name: ""  # type: ignore[method-assign]
    page.goto(served.address + "#/tank_4")
    until(page, "document.querySelector('#asset-title')?.textContent.startsWith('tank_4')")
    until(page, "document.querySelector('.picture')?.shadowRoot.querySelectorAll('.node').length > 5")
    assert page.locator(".plant-drawing .buttons").is_hidden()


def test_login(browser: Any, users: dict[str, tuple[str, Role]], axe: str) -> None:
    """Who is not logged in sees the login alone, who may only look has no buttons, and after logout nothing is left."""
    served = Served(LoginGuard(users=users))
    page = browser.new_page()
    page.goto(served.address + "#/tank_2")
    page.wait_for_selector(".login")
    assert violations(page, axe) == []
    page.fill("#login-name", "viola")
    page.fill("#login-password", "wrong")
    page.keyboard.press("Enter")
    page.wait_for_selector(".problem-line:not([hidden])")
    page.fill("#login-password", "seen only")
    page.keyboard.press("Enter")
    page.wait_for_selector(".candidates li")
    assert page.inner_text("#person") == "viola, view"
    assert page.locator("button[data-action]").count() == 0
    page.click("#tour")
    toured(page, 0)
    page.keyboard.press("Escape")
    page.click("#leave")
    page.wait_for_selector(".login")
    assert page.locator("#tour").is_hidden()
    assert "leak" not in page.inner_text("body")
    page.close()
    served.stop()


def test_a_recording_is_brought_and_analysed(opened: Callable[..., Any], served: Served, tmp_path: Path) -> None:
    """From the overview one comes to the desk, brings a recording and a model with a table, and sees them wait."""
    for name in ("night.csv", "pump 7.yaml", "curve.csv"):
        (tmp_path / name).write_text("time,flow\n0,1\n")
    page = opened()
    page.click("#desk")
    page.wait_for_selector(".jobs li[data-job]")
    before = page.locator(".jobs li").count()
    page.set_input_files("#desk-recording", str(tmp_path / "night.csv"))
    page.select_option("#desk-asset", "tank_2")
    page.check("#desk-analyse")
    page.click("form button[type=submit]")
    until(page, "(n) => document.querySelectorAll('.jobs li').length === n", before + 1)
    assert "by the model of tank_2" in page.locator(".jobs li").first.inner_text()
    assert page.locator("input[value=asset]").is_checked()
    page.check("input[value=file]")
    assert page.locator("#desk-asset").is_hidden()
    page.set_input_files("#desk-recording", str(tmp_path / "night.csv"))
    page.set_input_files("#desk-model", str(tmp_path / "pump 7.yaml"))
    page.set_input_files("#desk-tables", str(tmp_path / "curve.csv"))
    page.click("form button[type=submit]")
    until(page, "(n) => document.querySelectorAll('.jobs li').length === n", before + 2)
    assert "by pump 7.yaml, curve.csv" in page.locator(".jobs li").first.inner_text()
    first, second = served.desk.ordered
    assert (first.asset, first.model, first.analyse) == ("tank_2", "", True)
    assert (second.asset, len(second.tables), second.analyse) == ("", 1, False)
    assert page.wrong == []


def test_analyses_tell_how_they_stand(opened: Callable[..., Any], browser: Any) -> None:
    """Verdict, place in the queue, share and reason are there; results can be opened, and the report downloaded."""
    page = opened("#offline")
    page.wait_for_selector(".jobs li[data-job]")
    text = page.inner_text(".jobs")
    for part in (
        "Waits, 1 in the queue",
        "Fault found",
        "99.7",
        "No fault found",
        "It took longer than 10 min",
        "no column",
    ):
        assert part in text
    assert page.locator(".jobs progress").get_attribute("value") == "0.4"
    with page.expect_download() as fetched:
        page.click("a[aria-label='Download report'] >> nth=-1")
    assert fetched.value.suggested_filename == "plant-2026-11-17.html"
    assert Path(fetched.value.path()).read_text() == REPORT
    assert page.title().endswith("Off line")
    assert page.locator("#crumb").inner_text() == "Off line"


def test_what_the_desk_refuses_is_told(opened: Callable[..., Any], served: Served, tmp_path: Path) -> None:
    """A file that is too large is not sent, nor is another beside it; it stays in the form, and why is read out."""
    (tmp_path / "large.csv").write_text("x" * 6000)
    (tmp_path / "model.yaml").write_text("x")
    page = opened("#offline")
    page.wait_for_selector("[data-job]")
    page.check("[name=desk-model-of][value=file]")
    page.set_input_files("#desk-model", str(tmp_path / "model.yaml"))
    page.set_input_files("#desk-recording", str(tmp_path / "large.csv"))
    page.click("form button[type=submit]")
    page.wait_for_selector(".problem-line:not([hidden])")
    said = page.inner_text(".problem-line").replace("\N{NO-BREAK SPACE}", " ")
    assert said == "It is too large. A recording has 5 kB at most."
    assert page.locator("form button[type=submit]").is_enabled()
    assert served.desk.files == {}
    assert served.desk.ordered == []


def test_an_analysis_is_removed(opened: Callable[..., Any], served: Served, axe: str) -> None:
    """To stop or remove one is asked first, in a dialog that everybody can use."""
    page = opened("#offline")
    page.click(f"button[data-remove='{6:016x}']")
    assert page.inner_text("#dialog-title") == "Stop the analysis of night shift.csv?"
    assert violations(page, axe) == []
    page.click("dialog button[type=submit]")
    until(page, "(id) => !document.querySelector(`[data-job='${id}']`)", f"{6:016x}")
    assert f"{6:016x}" not in served.desk.jobs


def test_the_desk_is_an_engineers(browser: Any, users: dict[str, tuple[str, Role]]) -> None:
    """An operator has no way to the desk, and lands at the overview where one is typed."""
    served = Served(LoginGuard(users=users))
    page = browser.new_page()
    page.goto(served.address + "#offline")
    page.fill("#login-name", "otto")
    page.fill("#login-password", "hands on")
    page.keyboard.press("Enter")
    page.wait_for_selector(".tiles")
    assert page.locator("#desk").is_hidden()
    assert "plant-2026" not in page.inner_text("body")
    page.close()
    served.stop()


def shown_otherwise(face: FakeFace, name: str, monkeypatch: pytest.MonkeyPatch, **keys: Any) -> None:
    """Let a service show some keys of an asset otherwise; `summary` and `alarm`: some of theirs."""
    asset, summary = face.asset, face.summary
    alarm, of_summary = keys.pop("alarm", {}), keys.pop("summary", {})

    def changed(of: str) -> dict[str, Any]:
        told = {**summary(of), **(of_summary if of == name else {})}
        return {**told, "alarm": {**told["alarm"], **alarm}} if of == name and told["alarm"] else told

    monkeypatch.setattr(face, "summary", changed)
    monkeypatch.setattr(face, "asset", lambda of: {**asset(of), **(keys if of == name else {}), "summary": changed(of)})


def test_a_diagnosis_that_is_being_worked_out_is_told(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Right after an alarm there are no candidates yet, which is not that there is no alarm."""
    none: dict[str, Any] = {"time": [], "names": [], "probability": []}
    shown_otherwise(served.face, "tank_2", monkeypatch, rows=[], several=False, checks=[], ranking=none)
    page = opened("#/tank_2")
    assert page.inner_text(".group-hint").startswith("The diagnosis is being worked out")
    assert opened("#/tank_1").inner_text(".group-hint") == "No alarm is open."
    box, panel = page.locator(".group-hint").bounding_box(), page.locator(".panel.explanations").bounding_box()
    assert panel["height"] < box["height"] + 80, "a box with a line in it is not as large as the drawing"


def test_the_journal_has_what_happened_by_itself(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An alarm, and what a rule accepted, stand between what people did, in the order in which they came."""
    ended = {"time": 1504.0, "text": "Alarm ended: a rule accepted pipe (99.3 %).", "alarm": False, "behind": 1}
    raised = {"time": 1404.0, "text": "Alarm raised, seen in flow.", "alarm": True, "behind": 0}
    shown_otherwise(served.face, "tank_3", monkeypatch, events=[ended, raised])
    lines = [text.replace("\u00a0", " ") for text in opened("#/tank_3").locator(".journal li").all_inner_texts()]
    assert "1504 s\nAlarm ended: a rule accepted pipe" in lines[0]
    assert "m.weber acknowledged" in lines[1]
    assert "1404 s\nAlarm raised, seen in flow." in lines[2]
    assert opened("#/tank_1").inner_text(".journal") == "Nothing has happened yet."


LABELS = """() => { window.labels = [];
  const fill = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    const { width } = this.measureText(text), from = this.textAlign === "right" ? x - width : x;
    if (text === "onset" || text === "alarm") window.labels.push([from, from + width, y, this.canvas.clientWidth]);
    fill.call(this, text, x, y);
  };
  repaint(); }"""


@pytest.mark.parametrize(("onset", "alarm"), [(0, 0), (3, 0), (30, 0), (898, 895), (400, 398)])
def test_labels_of_marks_can_be_read(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch, onset: int, alarm: int
) -> None:
    """They stand in the plot and beside each other, also where both are at an edge; samples before the last."""
    last = served.face.time(served.face.now)
    shown_otherwise(served.face, "tank_2", monkeypatch, alarm={"change_time": last - onset, "time": last - alarm})
    page = opened("#/tank_2")
    until(page, INK)
    page.evaluate(LABELS)
    until(page, "window.labels.length > 1")
    one, other = page.evaluate("window.labels.slice(0, 2)")
    for begin, end, _, width in (one, other):
        assert 0 <= begin < end <= width
    assert one[1] <= other[0] or other[1] <= one[0] or abs(one[2] - other[2]) >= 12


RANGE = "(told) => document.querySelector('.range').textContent === told"


def test_a_plot_begins_with_the_first_sample(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a short record no time before it is shown, whatever is pressed, and the minus signs are one."""
    known = served.face.curves

    def short(name: str, begin: float | None, end: float | None, most: int) -> dict[str, Any]:
        told = known(name, None, None, 20)
        inside = [k for k in range(20) if (begin is None or k >= begin) and (end is None or k <= end)]
        cut = {key: {of: [line[k] for k in inside] for of, line in told[key].items()} for key in told if key != "time"}
        return {"time": [float(k) for k in inside], **cut}

    monkeypatch.setattr(served.face, "curves", short)
    shown_otherwise(served.face, "tank_1", monkeypatch, summary={"time": 19.0, "samples": 20})
    page = opened("#/tank_1")
    whole = "Now: 0\u00a0s to 19\u00a0s"
    until(page, RANGE, whole)
    for button in ("Earlier", "Wider", "Closer", "Earlier", "Wider", "Back to now"):
        page.click(f"button:text-is('{button}'):enabled")
        page.wait_for_timeout(200)
        assert re.match(r"(Now|Past): \d+\s", page.inner_text(".range"))
    page.evaluate("document.querySelector('option[value=\"60\"]').value = 10")
    page.select_option(".tools select", "10")
    until(page, RANGE, "Now: 9\u00a0s to 19\u00a0s")
    for _ in range(3):
        page.click("button:text-is('Earlier')")
        page.wait_for_timeout(200)
    assert page.inner_text(".range") == "Past: 0\u00a0s to 10\u00a0s"
    assert page.evaluate("numberText(-0.294)") == "\N{MINUS SIGN}0.294"
    assert page.wrong == []


def test_without_a_sample_there_is_no_axis(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is drawn of an asset of which nothing came yet."""
    empty: dict[str, Any] = {"time": [], **{of: {} for of in ("inputs", "measured", "expected", "sd", "cusum")}}
    monkeypatch.setattr(served.face, "curves", lambda *_: empty)
    shown_otherwise(served.face, "motor_2", monkeypatch, summary={"time": None, "samples": 0})
    page = opened("#/motor_2")
    until(page, "document.querySelector('.range').textContent === 'No sample has come yet'")
    assert page.locator(".charts").is_hidden()
    assert "no, no data come" in page.inner_text("dl.facts")


SOON = "{ const usual = setInterval; setInterval = (act, each) => usual(act, each === 8000 ? 300 : each); }"


def test_what_was_told_goes_by_itself(browser: Any, served: Served) -> None:
    """It stays for some seconds, which are shorter here, and longer under a pointer."""
    page = browser.new_page()
    page.add_init_script(SOON)
    page.goto(served.address + "#/tank_2")
    page.click("button[data-action=acknowledge]")
    page.click("dialog button[type=submit]")
    page.wait_for_selector("#told button")
    page.hover("#told")
    page.wait_for_timeout(700)
    assert "Kept as entry" in page.inner_text("#told")
    page.hover("h1")
    until(page, "document.getElementById('told').textContent === ''")
    page.close()


LONG = "sensor_fault_on_a_tank_with_a_long_name"


@pytest.mark.parametrize("width", [390, 1280])
def test_long_names_fit(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    """A name without a place to break it stays in the window, and the header has room about its text."""
    site, asset = served.face.site, served.face.asset
    of_long = {**asset("tank_2"), "summary": {**served.face.summary("tank_2"), "name": LONG}}
    named = {"name": "Water works of the northern district and its outposts"}
    monkeypatch.setattr(
        served.face, "site", lambda: {**site(), **named, "assets": [*site()["assets"], of_long["summary"]]}
    )
    monkeypatch.setattr(served.face, "asset", lambda name: of_long if name == LONG else asset(name))
    page = opened(f"#/{LONG}", width, ready=".candidates li")
    assert not is_overfull(page)
    header, name = page.locator(".top").bounding_box(), page.locator("#home").bounding_box()
    assert name["y"] - header["y"] >= 5
    assert name["width"] > 0.6 * width or name["height"] < 30, "not a word a line"


def test_a_wall_screen_is_read_from_afar(opened: Callable[..., Any]) -> None:
    """The text grows with the screen, within reason, that of the plots too."""
    sizes = []
    for width in (1280, 2560, 3840, 7680):
        page = opened("#/tank_2", width)
        sizes.append(page.evaluate("parseFloat(getComputedStyle(document.documentElement).fontSize)"))
        assert not is_overfull(page)
    assert sizes[0] == 15
    assert 20 < sizes[1] < sizes[2] <= sizes[3] <= 36


def test_what_is_typed_is_shown_as_that(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch, axe: str
) -> None:
    """Words between backticks are code, and of a verdict the first sentence alone is bold."""
    verdict = "Most likely the model is off: K1 is 2.4 `m`. `faultbond fit` finds what it leaves out."
    shown_otherwise(served.face, "tank_2", monkeypatch, verdict=verdict)
    page = opened("#/tank_2")
    assert page.locator(".sentences p").all_inner_texts() == [
        "Most likely the model is off: K1 is 2.4 m.",
        "faultbond fit finds what it leaves out.",
    ]
    assert page.locator(".sentences code").all_inner_texts() == ["m", "faultbond fit"]
    assert violations(page, axe) == []


def test_what_makes_no_sense_is_not_offered(
    opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without an alarm there is none to shelve; sources are listed for who asks, and samples counted once."""
    shown_otherwise(
        served.face, "tank_1", monkeypatch, may=["shelve", "suppress", "out of service"], counts={"samples": 716}
    )
    page = opened("#/tank_1")
    assert page.locator(".verdict [data-action]").all_inner_texts() == ["Take out of service"]
    assert "716" not in page.inner_text("main")
    assert page.locator("footer li").is_hidden()
    page.click("footer summary")
    assert page.inner_text("footer li") == served.face.site()["source"]


def test_it_says_whose_clock_it_is(opened: Callable[..., Any], served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where samples are ahead of the service's clock that is said, and `since` is by one clock for all."""
    now = time.time()
    ahead = {"since": now + 230, "time": now + 230, "change_time": now + 220}
    shown_otherwise(served.face, "tank_2", monkeypatch, summary={"time": now + 240, "since": now - 60}, alarm=ahead)
    shown_otherwise(served.face, "tank_1", monkeypatch, summary={"time": now})
    shown_otherwise(
        served.face, "tank_3", monkeypatch, summary={"time": 1510.0, "since": now}, alarm={"since": 7.3, "time": None}
    )
    facts = opened("#/tank_2").inner_text("dl.facts")
    assert re.search(r"Clock of its source\s+(4|3\.\d)\smin ahead; alarm, onset and last sample are by it", facts)
    assert "Clock of its source" not in opened("#/tank_1").inner_text("dl.facts")
    assert re.search(r"Alarm ended\s+7\.3\ss", opened("#/tank_3").inner_text("dl.facts"))
    cells = opened().locator("section[aria-labelledby=of-attention] td.moment").all_inner_texts()
    assert all(text.endswith("UTC") for text in cells)
    assert cells[0] == time.strftime("%H:%M:%S UTC", time.gmtime(now - 60)).replace(" ", "\u00a0")


def test_a_report_can_be_kept(opened: Callable[..., Any]) -> None:
    """Beside the report in a tab of its own is the same as a file with the name of the asset."""
    page = opened("#/tank_2")
    with page.expect_download() as found:
        page.get_by_label("Download report").click()
    assert found.value.suggested_filename == "tank_2.html"
