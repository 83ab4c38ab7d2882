"""A service that is none: assets in all conditions, the same at every start, for tests of the page."""

import asyncio
import math
from collections.abc import AsyncIterator, Mapping
from functools import cache
from typing import Any

from fake import MOTOR_STROKES, TANK_STROKES, motor_graph, tank_graph
from faultbond.errors import FaultbondError, StoreError
from faultbond.report.drawing import draw
from faultbond.report.numbers import TIMES
from faultbond.service.contract.face import Request, Shown
from faultbond.service.contract.messages import Action, AuditEntry, Ne107

START = 1_795_000_000.0  # Unix s of the first sample
HISTORY = 900  # samples that there are at the start
ALARM_AT = HISTORY - 240  # sample
LIMIT = 11.0
SENSORS = {"tank": {"flow": "m³/s", "pressure": "Pa"}, "motor": {"omega": "rad/s"}}
INPUTS = {"tank": {"u_in": "%", "u_out": "%"}, "motor": {"V": "V"}}
MEANS = {"flow": 2.31e-4, "pressure": 41200.0, "omega": 52.4, "u_in": 62.0, "u_out": 48.0, "V": 24.0}
FAULTY = ("tank_2", "tank_3", "tank_4")
STATES = {Action.SHELVE: "shelved", Action.SUPPRESS: "suppressed by design", Action.OUT_OF_SERVICE: "out of service"}


def candidate(*suspects: tuple[str, ...], kind: str, probability: float, group: bool) -> Shown:
    """A candidate of suspects, each component, name, nominal, estimate, sd, change."""
    keys = ("component", "name", "nominal", "estimate", "sd", "change")
    return {
        "suspects": [dict(zip(keys, item, strict=True)) for item in suspects],
        "kinds": [kind],
        "probability": probability,
        "percent": f"{100 * probability:.1f}" if probability >= 0.001 else "<0.1",
        "group": group,
    }


LEAK = ("leak", "K6", f"1.04 {TIMES} 10⁻⁵ m³/s", f"3.87 {TIMES} 10⁻⁵ m³/s", f"0.11 {TIMES} 10⁻⁵ m³/s", "+272 %")
OUTLET = (
    "outlet",
    "K4",
    f"2.35 {TIMES} 10⁻⁶ m³/(s %)",
    f"2.94 {TIMES} 10⁻⁶ m³/(s %)",
    f"0.04 {TIMES} 10⁻⁶ m³/(s %)",
    "+25 %",
)
PIPE = (
    "pipe",
    "K1",
    f"2.41 {TIMES} 10¹¹ Pa s²/m⁶",
    f"4.44 {TIMES} 10¹¹ Pa s²/m⁶",
    f"0.06 {TIMES} 10¹¹ Pa s²/m⁶",
    "+84 %",
)
BIAS = ("sensor pressure", "pressure.bias", "", "2150 Pa", "180 Pa", "")
SEVERAL = [
    candidate(LEAK, kind="step", probability=0.512, group=True),
    candidate(OUTLET, kind="step", probability=0.431, group=True),
    candidate(BIAS, kind="drift", probability=0.038, group=False),
    candidate(LEAK, OUTLET, kind="step", probability=0.0181, group=False),
    candidate(PIPE, kind="step", probability=0.0009, group=False),
]
ONE = [
    candidate(PIPE, kind="step", probability=0.993, group=True),
    candidate(BIAS, kind="drift", probability=0.0061, group=False),
    candidate(LEAK, kind="step", probability=0.0009, group=False),
]
CHANGED = (
    f"Most likely pipe changed: K1 rose from 2.41 {TIMES} 10¹¹ to 4.44 {TIMES} 10¹¹ Pa s²/m⁶ (+84 %), 99.3 % sure."
)
VERDICTS = {
    "tank_1": ["No fault found."],
    "tank_2": [
        "Cannot yet be told apart: leak (51 %) and outlet (43 %).",
        "Best next: look at the leak.",
    ],
    "tank_3": [CHANGED],
    "tank_4": [CHANGED],
    "motor_1": ["No fault found since C of C was accepted at 0.52 N m s/rad."],
    "motor_2": ["No sample has come for 4 min; nothing is being watched."],
    "motor_3": ["Getting to know the plant: alarms are off for the first 120 samples."],
}
STATUS = {
    "tank_1": Ne107.NORMAL,
    "tank_2": Ne107.OFF_SPEC,
    "tank_3": Ne107.FAILURE,
    "tank_4": Ne107.MAINTENANCE_REQUIRED,
    "motor_1": Ne107.NORMAL,
    "motor_2": Ne107.CHECK_FUNCTION,
    "motor_3": Ne107.CHECK_FUNCTION,
}


@cache
def drawings() -> dict[str, str]:
    """The bond graphs of the two plants, as a face gives them."""
    drawn = {"tank": draw(tank_graph(), TANK_STROKES), "motor": draw(motor_graph(), MOTOR_STROKES)}
    return {name: text.replace("data-name", "data-component") for name, text in drawn.items()}


class FakeFace:
    """Assets in all conditions. `tick` passes a sample; `is_full` makes deeds fail, `fails_each` each n-th look."""

    def __init__(self) -> None:
        self.now = HISTORY
        self.is_full = False
        self.fails_each = 0
        self.noted: list[AuditEntry] = []
        self._looks = 0
        self.troubles: list[str] = []
        self.pictures: dict[str, str] = {}
        self.done: list[Request] = []
        self._queues: list[tuple[asyncio.Queue[tuple[str, Shown] | None], int]] = []
        self._journal: dict[str, list[Shown]] = {name: [] for name in STATUS}
        self._number = 0
        self._alarms: dict[str, Shown | None] = dict.fromkeys(STATUS)
        self._before: dict[int, Shown | None] = {}
        for name in FAULTY:
            self._alarms[name] = {
                "state": "unacknowledged",
                "since": self.time(ALARM_AT),
                "acknowledged_by": None,
                "shelved_until": None,
                "signals": ["flow"] if name == "tank_3" else ["flow", "pressure"],
                "time": self.time(ALARM_AT),
                "change_time": self.time(ALARM_AT - 14),
            }
        self._enter(Request(asset="tank_3", action=Action.ACKNOWLEDGE, who="m.weber", comment="Rang the field crew."))
        shelved = Request(
            asset="tank_4", action=Action.SHELVE, who="a.novak", comment="Valve is being changed.", minutes=60.0
        )
        self._enter(shelved)
        self._enter(Request(asset="motor_1", action=Action.ACCEPT, who="a.novak", comment="New grease.", target=["C"]))

    def time(self, sample: int) -> float:
        """Give the time of a sample."""
        return START + sample

    # ---- what it shows

    def site(self) -> Shown:
        """Give all assets in a line each."""
        return {
            "name": "Water works north",
            "version": "0.1.0",
            "now": self.time(self.now),
            "source": "sim: seven built-in plants",
            "assets": [self.summary(name) for name in STATUS],
            "troubles": self.troubles,
        }

    def summary(self, name: str) -> Shown:
        """Give an asset in a line."""
        kind = name.partition("_")[0]
        rows = self._rows(name)
        monitoring = {"motor_2": "no data", "motor_3": "initialising"}.get(name, "running")
        status = STATUS[name]
        if name in FAULTY and self._alarms[name] is None:
            status = Ne107.NORMAL
        best = rows[0] if rows else None
        names = [item["name"] for item in best["suspects"]] if best else []
        return {
            "name": name,
            "model": "water tank" if kind == "tank" else "DC motor",
            "status": status.name,
            "status_code": int(status),
            "monitoring": monitoring,
            "headline": self._verdict(name)[0],
            "since": self.time(ALARM_AT) if name in FAULTY else START,
            "time": self.time(self._last(name)),
            "samples": self._last(name) + 1,
            "operation": "waiting" if name == "motor_3" else "alarms on",
            "alarm": dict(self._alarms[name]) if self._alarms[name] else None,  # type: ignore[arg-type]
            "best": {"names": names, "probability": best["probability"]} if best else None,
        }

    def _look_at(self, name: str) -> None:
        """Refuse what there is not, and now and then what there is."""
        self._looks += 1
        if self.fails_each and self._looks % self.fails_each == 0:
            raise StoreError("store.db: it cannot be read.")
        if name not in STATUS:
            raise KeyError(name)

    def asset(self, name: str) -> Shown:
        """Give all of an asset."""
        self._look_at(name)
        kind = name.partition("_")[0]
        rows = self._rows(name)
        suspicion: dict[str, float] = {}
        for row in rows:
            for item in row["suspects"]:
                suspicion[item["component"]] = suspicion.get(item["component"], 0.0) + row["probability"]
        signals = [{"name": item, "role": "sensor", "unit": unit} for item, unit in SENSORS[kind].items()]
        signals += [{"name": item, "role": "input", "unit": unit} for item, unit in INPUTS[kind].items()]
        alarm = self._alarms[name]
        return {
            "summary": self.summary(name),
            "drawing": drawings()[kind],
            "picture": "drawn by hand" if self.pictures.get(name) else "",
            "suspicion": {key: min(value, 1.0) for key, value in suspicion.items()},
            "signals": [{**item, "in_use": name != "motor_2"} for item in signals],
            "cusum_limit": LIMIT,
            "verdict": self._verdict(name),
            "rows": rows,
            "several": sum(row["group"] for row in rows) > 1,
            "checks": self._checks(rows),
            "notes": ["pressure gave no value from 12:02 to 12:04."] if name == "tank_2" else [],
            "events": [{"time": alarm["since"], "text": "Alarm raised, seen in flow.", "alarm": True, "behind": 0}]
            if alarm
            else [],
            "ranking": self._ranking(rows),
            "counts": {"missing": 3, "late": 0, "duplicate": 1, "dropped": 0, "bad": 0, "uncertain": 12},
            "journal": [dict(item) for item in reversed(self._journal[name])],
            "may": self._may(name),
        }

    def picture(self, name: str) -> str:
        """Give the picture of the process that a test has put there."""
        if name not in STATUS:
            raise KeyError(name)
        return self.pictures.get(name, "")

    def curves(self, name: str, begin: float | None, end: float | None, most: int) -> Shown:
        """Give curves of a period."""
        self._look_at(name)
        last = self._last(name)
        first = 0 if begin is None else max(0, math.ceil(begin - START))
        until = last if end is None else min(last, math.floor(end - START))
        if begin is None and end is None:
            first = max(0, last + 1 - most)
        step = max(1, math.ceil((until + 1 - first) / most))
        return self._points(name, range(first, until + 1, step))

    def health(self) -> Mapping[str, Any]:
        """Give that it is well, unless its store is full."""
        return {"ok": not self.is_full, "store": {"ok": not self.is_full, "since": START if self.is_full else None}}

    def metrics(self, viewers: int) -> str:
        """Give the one number that there is."""
        return f"# TYPE viewers gauge\nviewers {viewers}\n# EOF\n"

    def report(self, name: str) -> str:
        """Give a report."""
        self._look_at(name)
        return (
            f"<!doctype html><html lang=en><title>{name}</title><script>document.title += '!'</script><h1>{name}</h1>"
        )

    # ---- what people do

    async def note(self, entry: AuditEntry) -> None:
        """Keep what a person did that is about no asset."""
        if self.is_full:
            raise StoreError("store.db: the disk is full. Free some space.")
        self.noted.append(entry)

    async def do(self, request: Request) -> Shown:
        """Do what a person wants."""
        if request.asset not in STATUS:
            raise KeyError(request.asset)
        if self.is_full:
            raise StoreError("store.db: the disk is full. Free some space.")
        if request.action.value not in self._may(request.asset):
            raise FaultbondError(f"{request.asset}: {request.action.value} makes no sense now.")
        entry = self._enter(request)
        self.done.append(request)
        self._tell("asset", self.asset(request.asset))
        return dict(entry)

    def _enter(self, request: Request) -> Shown:
        self._number += 1
        entry: Shown = {
            "number": self._number,
            "at": self.time(self.now),
            "who": request.who,
            "action": request.action.value,
            "comment": request.comment,
            "target": list(request.target),
            "undone_by": None,
        }
        journal = self._journal[request.asset]
        alarm = self._alarms[request.asset]
        self._before[self._number] = dict(alarm) if alarm else None
        if request.action is Action.UNDO:
            assert request.undone is not None
            undone = [item for item in journal if item["number"] == request.undone]
            if not undone or undone[0]["undone_by"]:
                raise FaultbondError(f"{request.asset}: there is no deed {request.undone} to take back.")
            undone[0]["undone_by"] = self._number
            self._alarms[request.asset] = self._before[request.undone]
        elif alarm is not None:
            self._alarms[request.asset] = self._after(alarm, request)
        journal.append(entry)
        return entry

    def _after(self, alarm: Shown, request: Request) -> Shown | None:
        match request.action:
            case Action.ACKNOWLEDGE:
                return {**alarm, "state": "acknowledged", "acknowledged_by": request.who}
            case Action.SHELVE:
                until = self.time(self.now) + 60.0 * (request.minutes or 0.0)
                return {**alarm, "state": "shelved", "shelved_until": until}
            case Action.SUPPRESS | Action.OUT_OF_SERVICE:
                return {**alarm, "state": STATES[request.action]}
            case Action.ACCEPT | Action.REPAIRED:
                return None
            case Action.REJECT:
                return alarm
        return {**alarm, "state": "unacknowledged", "shelved_until": None}

    def _may(self, name: str) -> list[str]:
        alarm, found = self._alarms[name], []
        if alarm:
            state = alarm["state"]
            found = {
                "unacknowledged": ["acknowledge", "shelve", "suppress"],
                "acknowledged": ["shelve", "suppress"],
                "shelved": ["unshelve"],
                "suppressed by design": ["unsuppress"],
            }.get(state, [])
            found = [*found, "accept", "reject", "repaired"]
        is_out = alarm is not None and alarm["state"] == "out of service"
        found = [*found, "in service" if is_out else "out of service"]
        return [*found, "undo"] if any(not item["undone_by"] for item in self._journal[name]) else found

    # ---- what happens

    def tick(self) -> None:
        """Pass a sample of all assets that have data."""
        self.now += 1
        for name in STATUS:
            if name != "motor_2":
                self._tell("samples", {"asset": name, **self._points(name, [self.now])})
                self._tell("summary", self.summary(name))

    def fail(self, *troubles: str) -> None:
        """Have troubles, or none any more."""
        self.troubles = [*troubles]
        self._tell("service", {"troubles": self.troubles})

    def stop(self) -> None:
        """End all who listen, as where the service stops."""
        for queue, _ in self._queues:
            queue.put_nowait(None)

    async def listen(self, most: int = 100) -> AsyncIterator[tuple[str, Shown]]:
        """Give what happens."""
        queue: asyncio.Queue[tuple[str, Shown] | None] = asyncio.Queue()
        self._queues.append((queue, most))
        try:
            while (told := await queue.get()) is not None:
                yield told
        finally:
            self._queues.remove((queue, most))

    def _tell(self, name: str, shown: Shown) -> None:
        for queue, most in self._queues:
            queue.put_nowait((name, shown) if queue.qsize() < most else None)

    # ---- numbers

    def _last(self, name: str) -> int:
        return HISTORY - 241 if name == "motor_2" else self.now

    def _verdict(self, name: str) -> list[str]:
        return VERDICTS["tank_1" if name in FAULTY and self._alarms[name] is None else name]

    def _rows(self, name: str) -> list[Shown]:
        if name not in FAULTY or self._alarms[name] is None:
            return []
        return SEVERAL if name == "tank_2" else ONE

    @staticmethod
    def _checks(rows: list[Shown]) -> list[Shown]:
        if rows is not SEVERAL:
            return []
        return [
            {"what": "look at the leak", "why": "tells leak from outlet"},
            {"what": "move u_out to 20 % and wait 3 min", "why": "tells outlet from leak or sensor pressure"},
        ]

    def _ranking(self, rows: list[Shown]) -> Shown:
        times = [self.time(sample) for sample in range(ALARM_AT, self.now + 1, 30)] if rows else []
        names = [" with ".join(item["name"] for item in row["suspects"]) for row in rows]
        raw = [
            [row["probability"] + math.exp(-k / 2) * (0.6 if place == 2 else 0.1) for k in range(len(times))]
            for place, row in enumerate(rows)
        ]
        sums = [sum(column) for column in zip(*raw, strict=True)]
        shares = [[value / total for value, total in zip(line, sums, strict=True)] for line in raw]
        return {"time": times, "names": names, "probability": shares}

    def _points(self, name: str, samples: range | list[int]) -> Shown:
        kind = name.partition("_")[0]
        found: Shown = {"time": [self.time(k) for k in samples]}
        found["inputs"] = {key: [round(_input(key, k), 6) for k in samples] for key in INPUTS[kind]}
        found["expected"] = {key: [_expected(key, k) for k in samples] for key in SENSORS[kind]}
        found["sd"] = {key: [0.004 * MEANS[key]] * len(samples) for key in SENSORS[kind]}
        found["measured"] = {
            key: [_measured(key, k, name in FAULTY, is_rough=name == "tank_2") for k in samples]
            for key in SENSORS[kind]
        }
        found["cusum"] = {key: [_cusum(key, k, name in FAULTY) for k in samples] for key in SENSORS[kind]}
        return found


def _noise(key: str, sample: int) -> float:
    """Give a number between -1 and 1 that looks like chance."""
    found = math.sin(12.9898 * sample + 78.233 * len(key) + ord(key[0])) * 43758.5453
    return 2.0 * (found - math.floor(found)) - 1.0


def _input(key: str, sample: int) -> float:
    return MEANS[key] + (8.0 if (sample // 200) % 2 else 0.0) * (MEANS[key] / 60.0)


def _expected(key: str, sample: int) -> float:
    return MEANS[key] * (1.0 + 0.05 * math.sin(sample / 90.0))


def _measured(key: str, sample: int, is_faulty: bool, is_rough: bool) -> float | None:
    if is_rough and key == "pressure" and 400 <= sample < 440:
        return None
    size = -0.045 * (1.0 - math.exp(-(sample - ALARM_AT + 14) / 60.0)) if is_faulty and sample >= ALARM_AT - 14 else 0.0
    return _expected(key, sample) + MEANS[key] * (size + 0.006 * _noise(key, sample))


def _cusum(key: str, sample: int, is_faulty: bool) -> float:
    rest = 1.2 + 0.9 * _noise(key + "s", sample // 4) + 0.3 * _noise(key, sample)
    grown = max(0.0, (sample - ALARM_AT + 14) * 0.75) if is_faulty else 0.0
    return max(0.0, rest + min(grown, 3.0 * LIMIT))
