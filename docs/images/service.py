"""Takes the pictures of the operators' page, from services that play recordings of examples.

    python docs/images/service.py

It needs playwright with a Chromium: `chromium` or `chromium-headless-shell` on the path, or the one that it installs.
"""

import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import sync_playwright

from faultbond.service.web.security import hashed

ROOT = Path(__file__).parents[2]
RECORDING = "examples/tank/fault_pipe.csv"
PORT = 8397
ADDRESS = f"http://127.0.0.1:{PORT}"
SHOWN = 2400  # samples that have passed when the pictures are taken
NAME, PASSWORD = "anna", "pictures only"  # who logs in
SITE = """
name: Water works north
store: kept.sqlite
assets:
  high_tank: {{model: {root}/examples/tank/model.yaml, source: "file:{root}/examples/tank/fault_pipe.csv?speed=60"}}
  low_tank: {{model: {root}/examples/tank/model.yaml, source: "file:{root}/examples/tank/healthy.csv?speed=60"}}
  spare_tank: {{model: {root}/examples/tank/model.yaml, source: "file:spare.csv"}}
users: {{{name}: {{role: engineer, password: "{hash}"}}}}
"""


def main() -> None:
    """Serve, wait, take the pictures: of one plant, then of some, with users."""
    with sync_playwright() as played, tempfile.TemporaryDirectory() as folder:
        found = shutil.which("chromium") or shutil.which("chromium-headless-shell")
        browser = played.chromium.launch(executable_path=found, args=["--no-sandbox"])
        with served("--source", f"file:{RECORDING}?speed=60", "--store", f"{folder}/one.sqlite"):
            wait(httpx.Client())
            picture(browser, "#/tank", "service.png", width=1280, height=1440, scheme="light")
            bring(browser, "service_offline.png")
            picture(browser, "#/tank", "service_tour.png", width=1180, height=560, scheme="light", step=4)
        site = Path(folder) / "site.yaml"
        (site.parent / "spare.csv").write_text("time,u_in,u_out,flow,pressure\n")  # nothing came yet
        site.write_text(SITE.format(root=ROOT, name=NAME, hash=hashed(PASSWORD)), encoding="utf-8")
        with served("--site", str(site)), httpx.Client() as client:
            wait_for_door()
            page = browser.new_page(viewport={"width": 1000, "height": 440})
            page.goto(ADDRESS)
            page.wait_for_selector("input[type=password]")
            page.screenshot(path=Path(__file__).parent / "service_login.png")
            client.post(f"{ADDRESS}/api/v1/login", json={"name": NAME, "password": PASSWORD}).raise_for_status()
            wait(client)
            known = browser.new_context()
            known.add_cookies([{"name": k, "value": v, "url": ADDRESS} for k, v in client.cookies.items()])
            picture(known, "", "service_overview.png", width=1280, height=400, scheme="light")
            picture(known, "", "service_phone.png", width=390, height=640, scheme="dark")
            picture(known, "#/high_tank", "service_accept.png", width=1100, height=640, scheme="light", press="Accept…")
        browser.close()


@contextmanager
def served(*words: str) -> Iterator[None]:
    """Run a service until the block ends."""
    command = [sys.executable, "-m", "faultbond", "serve", *words, "--port", str(PORT)]
    with subprocess.Popen(command, cwd=ROOT) as service:  # noqa: S603
        try:
            yield
        finally:
            service.send_signal(signal.SIGINT)


def wait_for_door() -> None:
    """Wait until it answers."""
    for _ in range(600):
        with suppress(httpx.TransportError):
            httpx.get(f"{ADDRESS}/health")
            return
        time.sleep(0.2)
    raise TimeoutError("the service does not answer")


def wait(client: httpx.Client) -> None:
    """Wait until enough has passed of the first plant."""
    wait_for_door()
    for _ in range(600):
        if client.get(f"{ADDRESS}/api/v1/site").json()["assets"][0]["samples"] >= SHOWN:
            return
        time.sleep(0.2)
    raise TimeoutError("the service has passed too few samples")


def picture(
    browser: Any, place: str, name: str, *, width: int, height: int, scheme: str, step: int = 0, press: str = ""
) -> None:
    """Take one picture; step: of the tour, 0: none. press: a button before that."""
    page = browser.new_page()
    page.set_viewport_size({"width": width, "height": height})
    page.emulate_media(color_scheme=scheme)
    page.goto(f"{ADDRESS}/{place}")
    page.wait_for_timeout(3000)  # plots draw themselves
    for k in range(step):
        page.click("#tour-card button.main" if k else "#tour")
    if press:
        page.click(f"button:text-is('{press}')")
        page.wait_for_timeout(500)
    page.screenshot(path=Path(__file__).parent / name)
    page.close()


def bring(browser: Any, name: str) -> None:
    """Have two recordings analysed, and take a picture once one of them is."""
    page = browser.new_page(viewport={"width": 1280, "height": 700})
    page.goto(f"{ADDRESS}/#offline")
    for recording in (RECORDING, "examples/tank/healthy.csv"):
        page.set_input_files("#desk-recording", ROOT / recording)
        page.click("form button[type=submit]")
        page.wait_for_selector(f".job-name:text-is('{Path(recording).name}')")
    page.wait_for_selector(".job-candidates", timeout=120_000)
    page.wait_for_selector(".told:empty", state="attached")
    page.screenshot(path=Path(__file__).parent / name)
    page.close()


if __name__ == "__main__":
    main()
