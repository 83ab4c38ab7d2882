"""The healthy filter linearised along a run."""

from dataclasses import replace

import numpy as np
import pytest
from plants import example

from faultbond.analysis.operation import generic_samples, operate, reference_levels
from faultbond.errors import RecordingError
from faultbond.synthesis.filter import build_filter
from faultbond.synthesis.machine import VirtualMachine
from faultbond.synthesis.specify import build_spec


@pytest.mark.parametrize("name", ["tank", "dc_motor"])
def test_the_linear_recursion_answers_like_the_engine(name: str) -> None:
    """A small deviation put through transition, slope and gain moves the estimate as the engine does."""
    model = example(name)
    spec = build_spec(model)
    engine = VirtualMachine(build_filter(spec, model))
    samples = generic_samples(model, spec, 260)
    wrong = 1e-4 * spec.output_noise * np.random.default_rng(5).standard_normal((len(samples), len(spec.outputs)))
    wrong[:30] = 0.0  # the start is solved from these
    before = operate(model, spec, engine, samples)
    moved = [replace(item, y=item.y + away) for item, away in zip(samples, wrong, strict=True)]
    after = operate(model, spec, engine, moved)
    error = np.zeros(spec.n_joint)
    for k, away in enumerate(wrong[len(samples) - len(before.time) :]):
        error = before.transition[k] @ error
        error = error + before.gain[k] @ (away - before.slope[k] @ error)
    seen = (after.mean - before.mean)[-1]
    assert np.all(np.abs(seen[: len(spec.states)]) > 0)
    assert error == pytest.approx(seen, rel=5e-3, abs=1e-3 * np.abs(seen).min(initial=1e-9))


def test_the_generic_run_is_what_the_nominal_plant_does() -> None:
    """Without noise the healthy filter finds nothing new in the generic run: innovations stay far below the noise."""
    model = example("tank")
    spec = build_spec(model)
    samples = generic_samples(model, spec, 240)
    operation = operate(model, spec, VirtualMachine(build_filter(spec, model)), samples)
    factors = operation.mean[:, spec.parameter_slice]
    assert np.all(np.abs(factors - 1.0) < 0.01)
    u = np.array([item.u for item in samples])
    assert np.all((u >= 0.5 * reference_levels(model)) & (u <= 1.5 * reference_levels(model)))
    assert np.corrcoef(u.T)[0, 1] < 0.9


def test_a_run_that_never_starts_is_refused() -> None:
    """Fewer samples than the start needs give one line that says what to do."""
    model = example("rc")
    spec = build_spec(model)
    engine = VirtualMachine(build_filter(spec, model))
    with pytest.raises(RecordingError, match="does not get going on these 5 samples"):
        operate(model, spec, engine, generic_samples(model, spec, 5))


def test_a_temperature_moves_in_its_own_unit() -> None:
    """An input in degrees Celsius moves by parts of a degree, not by parts of 274 kelvin; noise raises its level."""
    model = example("pipe")
    spec = build_spec(model)
    place = [item.name for item in spec.inputs].index("water_in_degC")
    moved = np.array([item.u[place] for item in generic_samples(model, spec, 40)])
    level = reference_levels(model)[place]
    assert np.max(np.abs(moved - level)) <= 0.5 * (level - 273.15)
    assert np.ptp(moved) > 0.1
    noisy = reference_levels(example("dc_motor"))
    assert noisy == pytest.approx([30 * 0.16])
