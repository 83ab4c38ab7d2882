"""Where recordings begin, behind a sensor that hardly shows it at first."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.app.engine import build_trial
from faultbond.app.identification import read_points
from faultbond.app.likelihood import likelihood_engine
from faultbond.cli import DONE, main
from faultbond.fit.evidence import begun_likeliest
from faultbond.fit.identification import Fit, fit_plant
from faultbond.fit.objective import FitPoint, FittedPlant, likelihood_value
from faultbond.fit.session import build_fit, free_parameters
from faultbond.io.recording import write_recording
from faultbond.model.text import parse_model
from faultbond.simulate import Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_model

OVEN = """
name: oven
sample_time: 2 s
accuracy: 5 %
inputs: {P: {unit: W}}
components:
  heater: {type: Sf, law: f = P}
  room: {type: Se, law: e = T0}
  core: {type: C, law: q = C*(e - T0), parameters: {C: 400 J/K}}
  wall: {type: R, parameters: {R: 0.4 K/W}}
junctions: {inside: 0, out: 1}
bonds: [heater -> inside -> core, inside -> out -> wall, out -> room]
constants: {T0: 20 degC}
sensors: {T: {reads: inside.e, unit: degC, noise: 0.1 K, lag: 1000 s}}
"""
ROWS, HOT, FAR = 400, 24000.0, 1000.0  # J that are stored at first, and by which a start is off


@pytest.fixture
def recordings(tmp_path: Path) -> list[Path]:
    """Write two recordings of an oven that is hot at first while its sensor is cold."""
    graph, paths = parse_model(OVEN, file="m.yaml"), []
    for seed in (1, 2):
        time = np.linspace(0.0, 2.0 * (ROWS - 1), ROWS)
        power = random_steps(time, np.random.default_rng(seed), low=50, high=300, shortest=60.0, longest=200.0)
        made = simulate(graph, Inputs(time=time, values=power[:, None]), seed=seed, start={"core.q": HOT})
        paths.append(tmp_path / f"h{seed}.csv")
        write_recording(paths[-1], {"time": time, "P": power, "T": made.outputs[:, 0] - 273.15})
    return paths


def fitted(paths: list[Path]) -> tuple[FittedPlant, Any, FitPoint]:
    """Give what is fitted to what, and where that begins."""
    graph = parse_model(OVEN, file="m.yaml")
    core, model = build_trial(graph), build_model(graph)
    read = [(path.name, read_points(graph, str(path))) for path in paths]
    return build_fit(model, likelihood_engine(model), core, read, free_parameters(graph))


def test_starts_are_found_with_all_else_as_it_stands(recordings: list[Path]) -> None:
    """From starts that are far off too, each recording by itself; nothing else moves."""
    plant, records, begin = fitted(recordings)
    off = replace(begin, starts=begin.starts + FAR * np.arange(1, 3)[:, None])
    found = begun_likeliest(plant, records, off)
    assert np.array_equal(found.values, begin.values)
    again = begun_likeliest(plant, records, found)
    assert likelihood_value(plant, records, again) - likelihood_value(plant, records, found) < 1.0
    assert likelihood_value(plant, records, found) > likelihood_value(plant, records, off) + 100.0


def test_the_last_fit_begins_where_recordings_most_likely_do(
    recordings: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing before has found that of what was held back; what its filter is off at first is no noise."""
    begins = list[tuple[FittedPlant, Any, FitPoint]]()

    def noted(plant: FittedPlant, records: Any, begin: FitPoint, **options: Any) -> Fit:
        begins.append((plant, records, begin))
        return fit_plant(plant, records, begin, **options)

    monkeypatch.setattr("faultbond.app.quiet_fit.fit_plant", noted)
    model = tmp_path / "oven.yaml"
    model.write_text(OVEN, encoding="utf-8")
    words = ["fit", str(model), *map(str, recordings), "--until-quiet", "-o", str(tmp_path / "quiet.yaml")]
    assert main(words) == DONE
    plant, records, begin = begins[-1]
    assert len(records) == len(recordings)
    best = begun_likeliest(plant, records, begin)
    assert likelihood_value(plant, records, best) - likelihood_value(plant, records, begin) < 1.0
