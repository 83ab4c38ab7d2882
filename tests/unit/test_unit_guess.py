"""Columns in other units than the model file says: told, where with another unit the plant is quiet."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import cast

import numpy as np
import pytest

from faultbond.app import unit_guess
from faultbond.app.method_face import Watcher
from faultbond.app.unit_guess import FRACTION, TURNED, _is_quiet, _readings
from faultbond.cli import main
from faultbond.contract.samples import STATUSES, Reports, Samples, Status
from faultbond.model.units import measure
from made import EXAMPLES

MODEL = str(EXAMPLES / "tank" / "model.yaml")
TIME, U_IN, U_OUT, FLOW, PRESSURE = range(5)


def recording(folder: Path, change: Callable[[int, list[float]], None], rows: int = 800) -> str:
    """Write the beginning of the healthy recording of the tank, changed row by row, and give its name."""
    header, *lines = (EXAMPLES / "tank" / "healthy.csv").read_text().splitlines()[: rows + 1]
    values = [[float(cell) for cell in line.split(",")] for line in lines]
    for k, row in enumerate(values):
        change(k, row)
    path = folder / "recording.csv"
    path.write_text("\n".join([header, *(",".join(f"{value:.9g}" for value in row) for row in values), ""]))
    return str(path)


def plus(column: int, shift: float) -> Callable[[int, list[float]], None]:
    """Give what adds to a column."""

    def change(_: int, row: list[float]) -> None:
        row[column] += shift

    return change


def times(column: int, factor: float) -> Callable[[int, list[float]], None]:
    """Give what multiplies a column."""

    def change(_: int, row: list[float]) -> None:
        row[column] *= factor

    return change


@pytest.mark.parametrize(
    ("change", "told", "cure"),
    [
        (times(PRESSURE, 1e-3), "the sensor pressure in kPa, not in Pa", "state `unit: kPa` there"),
        (times(FLOW, 3600.0), "the sensor flow in m^3/h, not in m^3/s", "state `unit: m^3/h` there"),
        (times(U_IN, 0.01), f"the input u_in in {FRACTION}, not in percent", "multiply the column by 100"),
        (
            times(FLOW, -1.0),
            "the sensor flow with the other sign",
            "multiply the column by -1, or turn the sign round in the model",
        ),
        (
            plus(PRESSURE, 101_000.0),
            "the sensor pressure as absolute pressure, not as the model has it",
            "subtract the pressure of the atmosphere from the column, or add it in the model",
        ),
        (
            plus(PRESSURE, -101_000.0),
            "the sensor pressure as gauge pressure, not as the model has it",
            "add the pressure of the atmosphere to the column, or subtract it in the model",
        ),
    ],
)
def test_a_column_in_another_unit_is_told(
    change: Callable[[int, list[float]], None], told: str, cure: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before what the bank makes of it: text, page and standard error say in which unit it would be quiet."""
    page = tmp_path / "page.html"
    assert main(["run", MODEL, recording(tmp_path, change), "--report", str(page)]) == 1
    said = capsys.readouterr()
    text = f"The recording looks as if it had {told}: read so, the first "
    assert text in " ".join(said.out.split())
    assert f"If it is so, {cure}; what follows is then no fault." in " ".join(said.out.split())
    assert said.err.startswith(f"faultbond: {text}")
    assert text in page.read_text().replace("\u00a0", " ")


def test_where_trials_take_too_long_nothing_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hint is worth no minutes, and of some units that were tried nobody knows whether others would do."""
    monkeypatch.setattr(unit_guess, "PATIENCE", 0.0)
    assert main(["run", MODEL, recording(tmp_path, times(FLOW, -1.0))]) == 1
    assert "looks as if" not in "".join(capsys.readouterr())


@pytest.mark.parametrize(("ends", "told"), [("10 percent, 90 percent", True), ("0 percent, 1 percent", False)])
def test_an_input_that_is_where_it_was_in_the_fit_has_its_unit(
    ends: str, told: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What lies a little beyond that range is an operation that the model never saw, and in no unit nearer to it."""
    stated, text = "u_in:  {unit: percent", Path(MODEL).read_text()
    assert stated in text
    model = tmp_path / "model.yaml"
    model.write_text(text.replace(stated, f"{stated}, fitted_range: [{ends}]"))
    main(["run", str(model), recording(tmp_path, times(U_IN, 0.01))])
    assert (f"the input u_in in {FRACTION}, not in percent" in " ".join(capsys.readouterr().out.split())) == told


@pytest.mark.parametrize("unit", ["", "Pa", "degC", "degF", "m^3/h"])
def test_the_other_sign_is_that_of_the_number_in_the_file(unit: str) -> None:
    """Of a unit that does not begin at 0, the number is turned round, not what it is in SI."""
    known = measure(unit).unit
    (turned,) = [item for item in _readings(unit) if item[0] == TURNED]
    assert turned[1] * known.to_si(12.5) + turned[2] == pytest.approx(known.to_si(-12.5))


@pytest.mark.parametrize("fault", ["step", "from the start"])
def test_of_a_fault_no_unit_is_told(fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No unit explains what begins within the recording, nor a reading that is off by a usual amount from the start."""

    def change(k: int, row: list[float]) -> None:
        row[PRESSURE] += 3000.0 * (fault == "step" and k > 250)
        row[FLOW] *= 0.7 if fault != "step" else 1.0

    assert main(["run", MODEL, recording(tmp_path, change)]) == 1
    assert "looks as if" not in capsys.readouterr().out


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_what_can_be_read_once_only_is_not_read_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a pipe with a name the verdict stands as it is."""
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    text = Path(recording(tmp_path, times(PRESSURE, 1e-3))).read_text()
    writer = Thread(target=pipe.write_text, args=(text,))
    writer.start()
    assert main(["run", MODEL, str(pipe)]) == 1
    writer.join()
    said = capsys.readouterr()
    assert "looks as if" not in said.out
    assert said.err == ""


def test_of_an_alarm_late_in_the_recording_nothing_is_tried(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A unit is wrong from the first row on."""
    monkeypatch.setattr("faultbond.app.unit_guess.EARLY", 0)
    assert main(["run", MODEL, recording(tmp_path, times(PRESSURE, 1e-3))]) == 1
    assert "looks as if" not in capsys.readouterr().out


@dataclass
class _Losing:
    """A watcher that loses the plant at one of its samples."""

    at: int
    taken: int = 0

    def take(self, samples: Samples) -> Reports:
        count = len(samples)
        status = np.full(count, STATUSES.index(Status.WATCHING))
        status[(np.arange(count) + self.taken) == self.at] = STATUSES.index(Status.LOST)
        self.taken += count
        nothing = np.zeros((count, 0))
        return Reports(
            status=status, wild=np.zeros(count, dtype=np.intp), expected=nothing, variance=nothing, cusum=nothing,
            slow=nothing, left_out=nothing.astype(bool),
        )  # fmt: skip


@pytest.mark.parametrize(("at", "most", "quiet"), [(25, 40, False), (1000, 200, True)])
def test_a_trial_ends_where_the_plant_is_lost(at: int, most: int, quiet: bool) -> None:
    """A filter that is lost solves its start again and again, which took most of the time of a run."""
    watcher, nothing = _Losing(at), np.zeros((200, 0))
    samples = Samples(time=np.arange(200.0), dt=np.ones(200), u=nothing, y=nothing)
    assert _is_quiet(cast(Watcher, watcher), samples) is quiet
    assert watcher.taken == most


HEATED = """\
name: heated vessel, judged while it heats
sample_time: 60 s
valid_when: u > 0.2
inputs: {u: {unit: "1"}}
components:
  heat: {type: Sf, law: f = P*u, parameters: {P: 2 kW}}
  vessel: {type: C, law: q = C*e, parameters: {C: {nominal: 200 kJ/K, suspect: no}}}
  loss: {type: R, law: f = UA*e, parameters: {UA: 30 W/K}}
junctions: {node: 0}
bonds: [heat -> node -> vessel, node -> loss]
sensors: {T: {reads: node.e, unit: K, noise: 0.1 K}}
"""


def test_where_nothing_is_judged_no_unit_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the other sign, or in degrees, the heater is never on and the model never holds: that is not quiet."""
    model, made = tmp_path / "model.yaml", tmp_path / "made.csv"
    model.write_text(HEATED)
    time = 60.0 * np.arange(700)
    u = 0.6 + 0.2 * np.sin(time / 3000.0)
    (tmp_path / "u.csv").write_text("\n".join(["time,u", *(f"{t:.0f},{x:.3f}" for t, x in zip(time, u, strict=True))]))
    words = ["simulate", str(model), "--inputs", str(tmp_path / "u.csv"), "--fault", "UA=x1.5@15000", "--seed", "3"]
    assert main([*words, "-o", str(made)]) == 0
    assert main(["run", str(model), str(made)]) == 1
    assert "looks as if" not in "".join(capsys.readouterr())
