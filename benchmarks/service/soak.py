"""A tank at a hundred times real time for long, with faults that come and go."""

import tempfile
import time
from pathlib import Path
from urllib.parse import quote

import httpx
import numpy as np

from benchmarks.service.served import Served
from benchmarks.shared.page import Row

SPEED = 100
PERIOD = 14400.0  # s of the plant between two faults
LASTS = 3600.0  # s of a fault
MARGIN = 300.0  # s after its end within which somebody says that it is repaired
FAULTS = ("K1=x1.85", "K6=x8", "K4=x1.3", "K2=x1.5", "flow.bias=1.4e-5", "pressure.bias=1500")  # again and again
SETTLED = 600.0  # s of real time before memory is measured the first time, as the mean of one fault and what follows


def _component(fault: str) -> str:
    """Give what a fault is of, as it is named: a parameter, or a sensor."""
    return fault.partition("=")[0].partition(".")[0]


def rows(hours: float = 1.0) -> list[Row]:
    """Measure, and give lines of the table."""
    span = 3600.0 * hours * SPEED
    starts = [PERIOD * (k + 1) for k in range(int((span - LASTS - MARGIN) // PERIOD))]
    faults = [FAULTS[k % len(FAULTS)] for k in range(len(starts))]
    asked = "&".join(f"fault={quote(f'{what}@{at:g},{LASTS:g}')}" for what, at in zip(faults, starts, strict=True))
    with (
        tempfile.TemporaryDirectory() as folder,
        Served(Path(folder), "--source", f"sim:?speed={SPEED}&{asked}") as service,
    ):
        first = service.until(lambda told: told["assets"][0]["time"] is not None)["assets"][0]
        origin, begin, memory = first["time"] - first["samples"] + 1, time.monotonic(), list[tuple[float, float]]()
        alarms, named = dict[float, float](), dict[float, str]()  # by the fault's start: when, and what was named last
        wrong, repaired = list[float](), 0.0
        while time.monotonic() - begin < span / SPEED:
            time.sleep(0.2)
            told = service.until(lambda told: True)["assets"][0]
            now, alarm = told["time"] - origin, told["alarm"]
            memory.append((time.monotonic() - begin, service.memory()))
            if alarm is None or alarm["time"] is None:
                continue
            at = alarm["time"] - origin
            start = next((item for item in starts if item <= at < item + LASTS), None)
            if start is None:
                if at not in wrong and at > repaired:
                    wrong.append(at)
            else:
                alarms.setdefault(start, at)
                if told["best"] is not None and now < start + LASTS:
                    named[start] = told["best"]["names"]
            over = start is None or now > start + LASTS
            if over and at > repaired and told["best"] is not None:
                (best, *_) = httpx.get(f"{service.address}/api/v1/assets/tank", timeout=30.0).json()["rows"]
                target = best.get("target") or [item["name"] for item in best["suspects"]]
                if service.try_to_do("tank", "repaired", target=target):
                    service.try_to_do("tank", "acknowledge")
                    repaired = now
        cycle, end = PERIOD / SPEED, memory[-1][0]
        settled, last = (
            float(np.mean([of for at, of in memory if since <= at <= since + cycle]))
            for since in (min(SETTLED, end / 2), end - cycle)
        )
        grown = last / settled - 1.0
    right = sum(_component(what) in named.get(start, "") for start, what in zip(starts, faults, strict=True))
    return [
        Row(
            figure=f"the tank at {SPEED} times real time, {hours:g} h, {len(starts)} faults come and go: memory grows",
            asked="1 %",
            got=f"{100 * grown:.1f} % from {settled:.0f} MB",
            met=grown < 0.01,
        ),
        Row(
            figure="the same: faults without alarm, alarms without fault",
            asked="0, 0",
            got=f"{len(starts) - len(alarms)}, {len(wrong)}",
            met=len(starts) == len(alarms) and not wrong,
        ),
        Row(
            figure="the same: named first at the end of the fault",
            asked="",
            got=f"{right} of {len(starts)}",
            met=None,
        ),
    ]
