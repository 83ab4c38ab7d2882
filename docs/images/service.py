"""Takes the pictures of the operators' page, from a service that plays the tank's recording.

    python docs/images/service.py

It needs playwright with a Chromium: `chromium` on the path, or the one that playwright installs.
"""

import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import httpx
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[2]
RECORDING = "examples/tank/fault_pipe.csv"
PORT = 8397
SHOWN = 2400  # samples that have passed when the pictures are taken


def main() -> None:
    """Serve, wait, take the pictures."""
    words = ["serve", "--source", f"file:{RECORDING}?speed=60", "--port", str(PORT), "--store"]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "faultbond", *words, f"{folder}/kept.sqlite"]
        with subprocess.Popen(command, cwd=ROOT) as service:  # noqa: S603
            try:
                wait()
                take()
            finally:
                service.send_signal(signal.SIGINT)


def wait() -> None:
    """Wait until enough has passed."""
    for _ in range(600):
        try:
            (tank,) = httpx.get(f"http://127.0.0.1:{PORT}/api/v1/site").json()["assets"]
        except httpx.TransportError:
            tank = {"samples": 0}
        if tank["samples"] >= SHOWN:
            return
        time.sleep(0.2)
    raise TimeoutError("the service has passed too few samples")


def take() -> None:
    """Take the overview on a phone, the asset on a desk, and a step of the tour."""
    with sync_playwright() as played:
        browser = played.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        picture(browser, "", "service_phone.png", width=390, height=430, scheme="dark")
        picture(browser, "#/tank", "service.png", width=1280, height=1440, scheme="light")
        bring(browser, "service_offline.png")
        picture(browser, "#/tank", "service_tour.png", width=1180, height=560, scheme="light", step=4)
        browser.close()


def picture(browser: Any, place: str, name: str, *, width: int, height: int, scheme: str, step: int = 0) -> None:
    """Take one picture; step: of the tour, 0: none."""
    page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
    page.goto(f"http://127.0.0.1:{PORT}/{place}")
    page.wait_for_timeout(3000)  # plots draw themselves
    for k in range(step):
        page.click("#tour-card button.main" if k else "#tour")
    page.screenshot(path=Path(__file__).parent / name)
    page.close()


def bring(browser: Any, name: str) -> None:
    """Have two recordings analysed, and take a picture once one of them is."""
    page = browser.new_page(viewport={"width": 1280, "height": 700})
    page.goto(f"http://127.0.0.1:{PORT}/#offline")
    for recording in (RECORDING, "examples/tank/healthy.csv"):
        page.set_input_files("#desk-recording", ROOT / recording)
        page.click("form button[type=submit]")
        page.wait_for_selector(f".job-name:text-is('{Path(recording).name}')")
    page.wait_for_selector(".job-candidates", timeout=120_000)
    page.click(".told button")
    page.screenshot(path=Path(__file__).parent / name)
    page.close()


if __name__ == "__main__":
    main()
