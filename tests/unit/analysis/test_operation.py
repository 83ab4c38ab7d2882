"""The healthy filter linearised along a run."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.analysis.equilibrium import at_rest, reference_levels
from faultbond.analysis.operation import operate, usual_operation, usual_runs
from faultbond.errors import RecordingError, StructureError
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.specify import build_spec
from made import EXAMPLES
from plants import example, stated


@pytest.mark.parametrize("name", ["tank", "dc_motor"])
def test_the_linear_recursion_answers_like_the_engine(name: str) -> None:
    """A small deviation put through transition, slope and gain moves the estimate as the engine does."""
    model = example(name)
    spec = build_spec(model)
    engine = build_engine(model.plant.graph)[1]
    samples = next(usual_runs(model, spec, 260)).samples
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


def test_the_usual_run_is_what_the_nominal_plant_does() -> None:
    """Without noise the healthy filter finds nothing new in the generic run: innovations stay far below the noise."""
    model = example("tank")
    spec = build_spec(model)
    run = next(usual_runs(model, spec, 240))
    operation = operate(model, spec, build_engine(model.plant.graph)[1], run)
    factors = operation.mean[:, spec.parameter_slice]
    assert np.all(np.abs(factors - 1.0) < 0.01)
    u = np.array([item.u for item in run.samples])
    assert np.all((u >= 0.5 * reference_levels(model)) & (u <= 1.5 * reference_levels(model)))
    assert np.corrcoef(u.T)[0, 1] < 0.9


def test_a_run_that_never_starts_is_refused() -> None:
    """Fewer samples than the start needs give one line that says what to do."""
    model = example("rc")
    spec = build_spec(model)
    engine = build_engine(model.plant.graph)[1]
    with pytest.raises(RecordingError, match="does not get going on these 5 samples"):
        operate(model, spec, engine, next(usual_runs(model, spec, 5)).samples)


def test_a_temperature_moves_in_its_own_unit() -> None:
    """An input in degrees Celsius moves by parts of a degree, not by parts of 274 kelvin; noise raises its level."""
    model = example("pipe")
    spec = build_spec(model)
    place = [item.name for item in spec.inputs].index("water_in_degC")
    moved = np.array([item.u[place] for item in next(usual_runs(model, spec, 40)).samples])
    level = reference_levels(model)[place]
    assert np.max(np.abs(moved - level)) <= 0.5 * (level - 273.15)
    assert np.ptp(moved) > 0.1
    noisy = reference_levels(example("dc_motor"))
    assert noisy == pytest.approx([30 * 0.16])


def test_noise_raises_no_level_that_is_known() -> None:
    """Three quarters of a range are that, whatever the noise; only a level that nobody states has to rise above it."""
    text = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")
    ranged = stated(text.replace("V: {unit: V", "V: {unit: V, range: [2 V, 12 V]", 1))
    assert reference_levels(ranged) == pytest.approx([9.5])


def test_the_usual_run_begins_where_the_plant_is_at_rest() -> None:
    """The motor under a constant voltage: V = R i + K w and K i = C w give current and speed of its start."""
    model = example("dc_motor")
    spec = build_spec(model)
    volts = reference_levels(model)[0]
    current = volts / (3.0 + 2.0 * 2.0 / 0.4)
    states = next(usual_runs(model, spec, 3)).states
    assert states[0] == pytest.approx([current, 2.0 / 0.4 * current], rel=1e-5)


def test_a_plant_that_only_integrates_has_no_rest() -> None:
    """A capacitor at a current source fills for ever; its run begins where the reference run ended."""
    model = stated(
        "name: fill\nsample_time: 1 s\ninputs: {u: {unit: A}}\ncomponents:\n  source: {type: Sf, law: f = u}\n"
        "  C: {type: C, parameters: {C: 2 F}}\njunctions: {node: 0}\nbonds: [source -> node -> C]\n"
        "sensors: {v: {reads: C.e, unit: V, noise: 0.01 V}}\n"
    )
    assert at_rest(model, reference_levels(model)) is None
    assert next(usual_runs(model, build_spec(model), 3)).states[0] == pytest.approx(model.reference_state)


EXPLOSIVE = (
    "name: chain reaction\nsample_time: 1 s\ninputs: {u: {unit: W}}\ncomponents:\n"
    "  heater: {type: Sf, law: f = GAIN*u}\n"
    "  mass: {type: C, law: e = q/C, parameters: {C: 2}}\n"
    "  loss: {type: R, law: f = G*e, parameters: {G: 0.1}}\n"
    "  reaction: {type: Sf, law: f = P*exp(mass.q - 12), parameters: {P: 0.05}}\n"
    "junctions: {node: 0}\nbonds: [heater -> node -> mass, node -> loss, reaction -> node]\n"
    "constants: {GAIN: LEVEL}\nsensors: {t: {reads: node.e, noise: 0.01}}\n"
)


def test_inputs_move_less_where_the_plant_would_run_away() -> None:
    """A mass that ignites when heated by much more than usual is heated by a little more only."""
    model = stated(EXPLOSIVE.replace("LEVEL", "0.5"))
    spec = build_spec(model)
    samples = next(usual_runs(model, spec, 300)).samples
    u = np.array([item.u[0] for item in samples])
    assert 0.0 < np.ptp(u) < 0.5
    assert np.isfinite([item.y[0] for item in samples]).all()


def test_a_plant_that_always_runs_away_asks_for_a_recording() -> None:
    """Where the usual heat is enough to ignite there is no generic run; one line says what to give."""
    model = stated(EXPLOSIVE.replace("LEVEL", "10"))
    spec = build_spec(model)
    with pytest.raises(StructureError, match=r"chain reaction has no finite solution over 300 samples.*--data"):
        usual_operation(model, spec, build_engine(model.plant.graph)[1], 300)


def test_a_pendulum_upside_down_asks_for_a_recording() -> None:
    """Numbers that stay finite but run away are no use of a plant: the filter loses it, and one line says so."""
    model = stated(
        "name: pendulum\nsample_time: 0.02 s\ninputs: {u: {unit: N*m}}\ncomponents:\n"
        "  drive: {type: Se, law: e = u}\n  J: {type: I, parameters: {J: 0.2 kg*m^2}}\n"
        "  gravity: {type: C, law: e = -M*q, parameters: {M: 3 N*m}}\njunctions: {shaft: 1}\n"
        "bonds: [drive -> shaft -> J, shaft -> gravity]\n"
        "sensors: {angle: {reads: gravity.q, unit: rad, noise: 0.001 rad}}\n"
    )
    spec = build_spec(model)
    with pytest.raises(StructureError, match=r"with u near the usual values, or one that runs away.*--data"):
        usual_operation(model, spec, build_engine(model.plant.graph)[1], 640)


def test_inputs_that_settle_stand_still_in_between() -> None:
    """Along the usual run of the tank most samples of the flow count, since a valve moves every 48 samples only."""
    model = example("tank")
    spec = build_spec(model)
    run = next(usual_runs(model, spec, 400))
    moved = np.flatnonzero(np.diff([item.u[0] for item in run.samples]))
    assert len(moved) > 3
    assert set(np.diff(moved)) == {48}
    engine = build_engine(model.plant.graph)[1]
    flow = [item.name for item in spec.outputs].index("flow")
    assert np.mean(operate(model, spec, engine, run.samples).counted[100:, flow]) > 0.6
