"""The page that `generate --web` writes, in a browser without a window: it says what `run` says of a recording."""

import io
import json
import math
import re
import shutil
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import faultbond
from faultbond.cli import main

TANK = Path(__file__).parents[3] / "examples" / "tank"
BROWSER = Path(faultbond.__file__).parent / "browser"
ROWS = 1700  # of the faulty recording; the alarm comes at 1504 s
CLOSE = 1e-6

pytestmark = pytest.mark.skipif(
    not (shutil.which("zig") or find_spec("ziglang")), reason="there is no zig: pip install ziglang"
)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A healthy recording, one with a fault, and one that is rough: other separators, gaps, rows that are late."""
    folder = tmp_path_factory.mktemp("played")
    healthy = (TANK / "healthy.csv").read_text().splitlines()[: 1 + ROWS]
    faulty = (TANK / "fault_pipe.csv").read_text().splitlines()[: 1 + ROWS]
    rough = [line.replace(",", "; ") for line in faulty]
    rough[400:420], rough[600], rough[601] = [], rough[601], rough[600]
    rough[700] = rough[700].rsplit(";", 1)[0] + ";"
    deaf = [healthy[0], *(line.rsplit(",", 1)[0] + "," for line in healthy[1:])]
    texts = {"healthy": healthy, "faulty": faulty, "rough": ["\ufeff" + rough[0], *rough[1:]]}
    texts |= {"deaf": deaf, "short": healthy[:100]}
    for name, lines in texts.items():
        (folder / f"{name}.csv").write_text("\r\n".join(lines) + "\r\n", encoding="utf-8", newline="")
    return {name: folder / f"{name}.csv" for name in texts}


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory, recordings: dict[str, Path]) -> Path:
    """The page of the tank, with the faulty recording inside."""
    file = tmp_path_factory.mktemp("page") / "tank.html"
    told = ["generate", str(TANK / "model.yaml"), "--web", "--recording", str(recordings["faulty"]), "-o", str(file)]
    assert main(told) == 0
    return file


@pytest.fixture
def page(browser: Any, page_file: Path) -> Iterator[Any]:
    """The page of the tank on a screen of 360 px; `asked` is all that it asks for."""
    opened = browser.new_page(viewport={"width": 360, "height": 740})
    opened.asked, opened.wrong = [], []
    opened.on("request", lambda request: opened.asked.append(request.url))
    opened.on("pageerror", lambda problem: opened.wrong.append(str(problem)))
    opened.on("console", lambda message: opened.wrong.append(message.text) if message.type == "error" else None)
    opened.goto(page_file.as_uri())
    yield opened
    assert opened.wrong == []
    opened.close()


def play(page: Any, recording: Path) -> None:
    """Let a recording pass at once."""
    page.select_option("#speed", "Infinity")
    page.set_input_files("#file", str(recording))
    page.wait_for_selector("body[data-state=over]")


def saved(page: Any) -> list[dict[str, Any]]:
    """The records that the page offers to save."""
    with page.expect_download() as found:
        page.click("#save")
    return [json.loads(line) for line in Path(found.value.path()).read_text(encoding="utf-8").splitlines()]


def records_of_run(recording: Path, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """The records that `run -` writes of the same recording."""
    out = io.StringIO()
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(recording.read_bytes()), encoding="utf-8"))
    with redirect_stdout(out):
        assert main(["run", str(TANK / "model.yaml"), "-", "--json", "-"]) in (0, 1)
    return [json.loads(line) for line in out.getvalue().splitlines()]


def is_same(one: object, other: object) -> bool:
    """Whether records are the same but for the last digits of numbers."""
    if isinstance(one, dict) and isinstance(other, dict):
        return list(one) == list(other) and all(is_same(value, other[key]) for key, value in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(is_same, one, other))
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=CLOSE, abs_tol=CLOSE)
    return one == other


@pytest.mark.parametrize("name", ["healthy", "faulty", "rough"])
def test_its_records_are_those_of_run(
    name: str, page: Any, recordings: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the page says of a recording is what `run` says, record by record."""
    play(page, recordings[name])
    assert is_same(saved(page), records_of_run(recordings[name], monkeypatch))
    wrong = "missing" if name == "rough" else "complete"
    assert wrong in page.inner_text("#facts")


@pytest.mark.parametrize("fault", ["", "flow.bias=3e-5@1500", "K6=x30@1500..1690"])
def test_its_verdict_is_that_of_the_report(
    fault: str, page: Any, recordings: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sentence on the page is that of the report, of a part that changed, a sensor, and a drift."""
    recording, report = recordings["faulty"], tmp_path / "report.html"
    model = str(TANK / "model.yaml")
    if fault:
        recording = tmp_path / "faulty.csv"
        told = ["--inputs", str(recordings["healthy"]), "--fault", fault, "--seed", "1", "-o", str(recording)]
        assert main(["simulate", model, *told]) == 0
    assert main(["run", model, str(recording), "--report", str(report)]) == 1
    play(page, recording)
    headline = re.search("<h1>(.*?)</h1>", report.read_text(encoding="utf-8"))
    assert headline is not None
    said = [page.inner_text(place) for place in ("#headline", "#beside") if page.is_visible(place)]
    assert " ".join(said).split() == unescape(headline[1]).split()  # at spaces of either kind


def test_a_model_that_may_be_off_is_told_as_by_run(
    browser: Any, recordings: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With how likely the first is if the model is right, in the same words and figures."""
    model, file = tmp_path / "model.yaml", tmp_path / "tank.html"
    model.write_text("false_alarms: 1\n" + (TANK / "model.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["generate", str(model), "--web", "--recording", str(recordings["faulty"]), "-o", str(file)]) == 0
    assert main(["run", str(model), str(recordings["faulty"])]) == 1
    told = re.search(
        r"With [^ ]+ % the model is off:.*?the first is at [^ ]+ %\.", " ".join(capsys.readouterr().out.split())
    )
    page = browser.new_page()
    page.goto(file.as_uri())
    play(page, recordings["faulty"])
    assert told is not None
    assert told[0] in " ".join(page.inner_text("#remainder").split())
    page.close()


def test_what_is_not_claimed_is_told_as_by_run(browser: Any, tmp_path: Path) -> None:
    """Of two faults, one after the other, of which the second explains the data only with the first beside it."""
    example, recording, report, file = TANK.parent / "rc", *(tmp_path / name for name in ("r.csv", "r.html", "p.html"))
    model, faults = str(example / "model.yaml"), ("--fault", "R=x1.06@10", "--fault", "C=x0.6@32")
    told = ["--inputs", str(example / "healthy.csv"), *faults, "--seed", "5", "-o", str(recording)]
    assert main(["simulate", model, *told]) == 0
    assert main(["run", model, str(recording), "--report", str(report)]) == 1
    assert main(["generate", model, "--web", "--recording", str(recording), "-o", str(file)]) == 0
    page = browser.new_page()
    page.goto(file.as_uri())
    play(page, recording)
    headline = re.search("<h1>(.*?)</h1>", report.read_text(encoding="utf-8"))
    assert headline is not None
    assert "What comes nearest explains the data only with C far from where it was" in unescape(headline[1])
    said = [page.inner_text(place) for place in ("#headline", "#beside") if page.is_visible(place)]
    assert " ".join(said).split() == unescape(headline[1]).split()
    page.close()


def test_what_is_suspected_is_coloured(page: Any, recordings: dict[str, Path]) -> None:
    """The part that is most likely at fault is first in the ranking, and coloured in the drawing."""
    play(page, recordings["faulty"])
    assert page.inner_text("#ranking .name >> nth=0") == "pipe K1"
    assert float(page.get_attribute("[data-name=pipe] .heat", "fill-opacity")) > 0.5
    assert float(page.get_attribute("[data-name=tank] .heat", "fill-opacity")) < 0.1


def test_the_recording_inside_is_played_at_a_speed(page: Any) -> None:
    """Keys and the slider move it, and it shows what was known at each moment; nothing is asked of a network."""
    assert page.inner_text("#headline").startswith("Play the recording")
    page.focus("#play")
    page.keyboard.press("Enter")
    page.wait_for_selector(".player .is-playing")
    page.wait_for_selector("#board:not(.is-waiting)")
    page.keyboard.press("Enter")
    page.wait_for_selector("body[data-state=paused]")
    assert page.get_attribute("#play", "aria-label") == "Play"
    page.wait_for_selector("#save:visible")  # the program has run ahead to the end
    for share, state, told in ((0.5, "watching", "No fault so far."), (0.95, "fault", "sample"), (0.0, "watching", "")):
        page.eval_on_selector(
            "#position", f"slider => {{ slider.value = {1000 * share}; slider.dispatchEvent(new Event('input')) }}"
        )
        page.wait_for_selector(f"#verdict.{state}:has-text('{told}')")
    assert [url.split(":")[0] for url in page.asked] == ["file", "blob"]


def test_a_narrow_screen_is_not_left(page: Any, recordings: dict[str, Path]) -> None:
    """On 360 px nothing is wider than the screen, before and after a recording was played."""
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    play(page, recordings["faulty"])
    assert page.evaluate("document.documentElement.scrollWidth") == 360


def test_a_bad_recording_is_refused_in_the_words_of_run(page: Any, recordings: dict[str, Path], tmp_path: Path) -> None:
    """A column that is absent, and decimal commas beside points, are told with the name of the file and the line."""
    cases = {
        "without.csv": ("time,u_in,u_out,pressure\n1,2,3,4\n", "without.csv: no column 'flow' (sensor flow)"),
        "commas.csv": (
            "time;u_in;u_out;flow;pressure\n0;20;60.5;1,3e-4;6600\n",
            "commas.csv:2: 'flow' is '1,3e-4' and 'u_out' is '60.5'. Decimal commas or points?",
        ),
        "empty.csv": ("", "empty.csv: it is empty."),
    }
    page.select_option("#speed", "Infinity")
    play(page, recordings["short"])
    assert page.is_visible("#sensors")
    for name, (text, told) in cases.items():
        (tmp_path / name).write_text(text)
        page.set_input_files("#file", str(tmp_path / name))
        page.wait_for_selector(f"#problem:has-text('{name}')")
        assert page.inner_text("#problem").startswith(told)
        page.wait_for_selector("#headline:text-is('This recording cannot be watched.')")
        page.wait_for_selector("#clock:text-is('nothing to show')")
        assert page.is_visible("#welcome")
        assert not page.is_visible("#sensors")  # those of the recording before
        out = io.StringIO()
        with redirect_stderr(out):
            assert main(["run", str(TANK / "model.yaml"), str(tmp_path / name)]) == 2
        assert page.inner_text("#problem").split(name)[1] in out.getvalue()


def test_what_is_said_beside_the_records_is_told(page: Any, recordings: dict[str, Path], tmp_path: Path) -> None:
    """As `run` says it on standard error: text for a number, and a line that is no row."""
    header, *rows = recordings["short"].read_text(encoding="utf-8").splitlines()
    cells = rows[5].split(",")
    rows[5], rows[8] = ",".join([*cells[:3], "Bad", *cells[4:]]), rows[8] + ",7"
    name = header.split(",")[3]
    (tmp_path / "texts.csv").write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    play(page, tmp_path / "texts.csv")
    told = page.inner_text("#problem")
    assert f"column '{name}' (sensor {name}), line 7: 'Bad' is no number; it counts as missing." in told
    assert "texts.csv:10: this row has 6 fields, the header 5." in told
    assert told.endswith("The line is passed over.")
    play(page, recordings["short"])
    assert not page.is_visible("#problem")


def test_a_sensor_that_never_reads_is_told(page: Any, recordings: dict[str, Path]) -> None:
    """The plant is called healthy for what was watched only."""
    play(page, recordings["deaf"])
    assert page.inner_text("#headline").startswith(f"No fault found by flow in {ROWS} samples")
    assert "pressure (no value)" in page.inner_text("#facts")
    assert "partial" in (page.get_attribute("#verdict", "class") or "")


def test_the_same_model_gives_the_same_bytes(page_file: Path, recordings: dict[str, Path], tmp_path: Path) -> None:
    """A page that is made again is the same, whatever it is called; it loads nothing from anywhere."""
    again = tmp_path / "again.html"
    told = ["generate", str(TANK / "model.yaml"), "--web", "--recording", str(recordings["faulty"]), "-o", str(again)]
    assert main(told) == 0
    text = again.read_text(encoding="utf-8")
    assert text == page_file.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    assert not [
        word
        for word in ("http:", "https:", "src=", "@import")
        if word in text.replace("http://www.w3.org/2000/svg", "").replace("https://github.com/leeoniya/uPlot", "")
    ]
