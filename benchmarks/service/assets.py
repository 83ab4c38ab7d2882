"""A hundred tanks in one service, three of them with a fault."""

import tempfile
import time
from pathlib import Path

from benchmarks.service.served import Served
from benchmarks.shared.page import Row
from faultbond.io.examples import example

ASSETS = 100
FAULTY = {"tank7": "K1=x1.85", "tank42": "K6=x8", "tank93": "flow.bias=1.4e-5"}
FAULT_AT = 300.0  # s; alarms are on from 180 s
MEASURED = 600.0  # s


def rows() -> list[Row]:
    """Measure, and give lines of the table."""
    model = example("tank") / "model.yaml"
    lines = ["source: sim:?fault=none", "assets:"]
    for k in range(ASSETS):
        name = f"tank{k}"
        source = f', source: "sim:?fault={FAULTY[name]}@{FAULT_AT:g}"' if name in FAULTY else ""
        lines.append(f"  {name}: {{model: {model}{source}}}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "site.yaml").write_text("\n".join([*lines, ""]), encoding="utf-8")
        with Served(folder, "--site", "site.yaml") as service:
            service.until(lambda told: all(item["samples"] > 60 for item in told["assets"]))
            begin, before, memory = time.monotonic(), service.processor_time(), service.memory()
            time.sleep(MEASURED)
            share = (service.processor_time() - before) / (time.monotonic() - begin)
            grown = service.memory()
            assets = service.until(lambda told: True)["assets"]
    alarmed = {item["name"] for item in assets if item["alarm"] is not None}
    return [
        Row(
            figure=f"{ASSETS} tanks at 1 Hz in one service, three with a fault: share of a core",
            asked="30 %",
            got=f"{100 * share:.0f} %; {memory:.0f} to {grown:.0f} MB",
            met=share < 0.3,
        ),
        Row(
            figure="the same: faults without alarm, alarms without fault",
            asked="0, 0",
            got=f"{len(FAULTY.keys() - alarmed)}, {len(alarmed - FAULTY.keys())}",
            met=alarmed == FAULTY.keys(),
        ),
    ]
