"""Each printed formula of the thesis that does not work, shown beside the reading that does."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from test_classic_watch import run

from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model
from faultbond.simulate import Effects, Fault, Inputs, Simulation, random_steps, simulate
from faultbond.thesis.offline.build import build_classic
from faultbond.thesis.online.curves import point_of, stacked
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.prefilter import filtered
from faultbond.thesis.online.settings import PRINTED, Erratum, Settings
from faultbond.thesis.online.state import ClassicState, init
from faultbond.thesis.online.watch import step
from made import samples_of

EXAMPLES = Path(__file__).parents[3] / "examples"
CIRCUIT = Settings(length=1, noise=0.1, accuracy=1.0)  # thesis 5.3: no prefilter, 10 % noise, a true model


def with_errata(settings: Settings, *errata: Erratum) -> Settings:
    """The same with some printed formulas."""
    fields = {name: getattr(settings, name) for name in Settings.__slots__}
    return Settings(**(fields | {"printed": frozenset(errata)}))


@cache
def circuit(inductance: str = "5") -> BondGraph:
    """The circuit of thesis figure 5.2, or a model of it with another inductance."""
    text = (EXAMPLES / "rlc" / "model.yaml").read_text(encoding="utf-8")
    assert "L: 5 H" in text
    return parse_model(text.replace("L: 5 H", f"L: {inductance} H"), "circuit.yaml")


@cache
def measured(rows: int) -> Simulation:
    """The circuit under two sines, with 10 % noise."""
    time = np.asarray(np.arange(rows) / 40.0, dtype=np.float64)
    voltage = 10 * np.sin(2 * np.pi * 0.25 * time + 1.0) + 4 * np.sin(2 * np.pi * 0.6 * time)
    return simulate(circuit(), Inputs(time=time, values=voltage[:, None]), seed=3)


@cache
def built(name: str) -> tuple[EngineSpec, ClassicPlan]:
    """A plant with its plan; settings that change no function are put into the plan later."""
    graph = circuit(name[-1]) if name.startswith("circuit") else load_model(EXAMPLES / name / "model.yaml")
    return build_classic(graph, Settings(length=1, largest=1) if name.startswith("circuit") else Settings(largest=1))


def curves(name: str, settings: Settings, samples: tuple[Sample, ...]) -> tuple[dict[str, FloatArray], int]:
    """The curves of a run, and the sample of its alarm."""
    spec, plan = built(name)
    plan = replace(plan, settings=settings, accuracy=settings.accuracy or plan.accuracy)
    state, points = init(spec, plan), []
    for sample in samples:
        state, _ = step(spec, plan, state, sample)
        points.append(point_of(spec, plan, state))
    return stacked(points), state.alarm


def test_printed_trust_keeps_the_first_current() -> None:
    """With 1/(1 + 10 T/N) the inductor's current is off for seconds, with 1/(1 + 10 N T) it settles in half a one."""
    record = measured(400)
    samples = samples_of(record.time, record.inputs, record.outputs)
    current = record.states[:, record.state_names.index("L.p")] / 5.0
    errors = []
    for settings in (CIRCUIT, with_errata(CIRCUIT, Erratum.TRUST)):
        found, _ = curves("circuit 5", settings, samples)
        off = found["states"][:, 1] - current
        errors.append(float(np.sqrt(np.mean(off[20:100] ** 2))))
    assert errors[0] < 0.15
    assert errors[1] > 4.0 * errors[0]


def test_printed_accuracy_forgives_nothing() -> None:
    """With a model of 6 H for 5 H, n = 0.93 halves the error only if it is left to the samples in the end."""
    record = measured(800)
    samples = samples_of(record.time, record.inputs, record.outputs)
    plain = with_errata(CIRCUIT, Erratum.LIMIT)
    forgiving = Settings(length=1, noise=0.1, accuracy=0.93, printed=frozenset({Erratum.LIMIT}))
    printed = with_errata(forgiving, Erratum.LIMIT, Erratum.ACCURACY)
    ends = []
    for settings, alarms in ((plain, True), (forgiving, False), (printed, True)):
        found, alarm = curves("circuit 6", settings, samples)
        assert (alarm >= 0) == alarms
        ends.append(float(found["index"][-200:].mean()))
    assert ends[1] < 0.6 * ends[0]
    assert ends[2] == pytest.approx(ends[0], rel=0.05)


def test_a_band_of_one_standard_deviation_filters_little() -> None:
    """Of white noise 0.38 is left with a band of three standard deviations, 0.9 with a band of one."""
    noise = np.random.default_rng(4).normal(size=4000)
    left = [
        float(np.std([filtered(noise[k - 8 : k + 9], 8, band) for k in range(8, 3992)])) for band in (1.0, 3.0, np.inf)
    ]
    assert left == pytest.approx([0.89, 0.38, 0.36], abs=0.03)


def test_propagated_signals_lose_the_resistance() -> None:
    """Of a motor whose resistance doubled, least squares on propagated signals find next to nothing."""
    graph = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    time, generator = np.asarray(np.arange(1500) * 0.02, dtype=np.float64), np.random.default_rng(0)
    voltage = random_steps(time, generator, low=2, high=12, shortest=1.0, longest=4.0)[:, None]
    record = simulate(graph, Inputs(time=time, values=voltage), [Fault(parameter="R", factor=2.0, start=10.0)], seed=1)
    samples = samples_of(record.time, record.inputs, record.outputs)
    estimates = []
    spec, plan = built("dc_motor")
    for printed in ((), (Erratum.SIGNALS,)):
        settings = Settings(printed=frozenset(printed))
        state, _ = run(spec, replace(plan, settings=settings, accuracy=0.98), samples)
        assert state.alarm >= 0
        estimates.append(3.0 * float(state.factors[0, 1]))
    assert 4.0 < estimates[0] < 7.5
    assert estimates[1] < 0.5


@cache
def lagging() -> tuple[Sample, ...]:
    """A healthy tank whose valves need three seconds, stepping."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    time, generator = np.asarray(np.arange(700.0), dtype=np.float64), np.random.default_rng(8)
    u = np.array([random_steps(time, generator, low=low, high=90, shortest=90, longest=150) for low in (20, 20)]).T
    effects = Effects(lag=3.0)
    record = simulate(graph, Inputs(time=time, values=u), seed=1, effects=effects, start={"tank.q": 0.06})
    return samples_of(record.time, record.inputs, record.outputs)


def watched_tank(*errata: Erratum) -> ClassicState:
    """The last state of the method on that tank."""
    spec, plan = built("tank")
    return run(spec, replace(plan, settings=Settings(printed=frozenset(errata))), lagging())[0]


def test_steps_alarm_where_only_falling_indices_are_passed_over() -> None:
    """Valves that lag raise the index at every step; blanked there is no alarm, as printed there is one."""
    assert watched_tank(Erratum.LIMIT).alarm < 0
    assert watched_tank(Erratum.STEPS, Erratum.LIMIT).alarm > 0


def test_everything_as_printed_runs() -> None:
    """All printed formulas together alarm on the healthy tank, and still give numbers."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    spec, plan = build_classic(graph, Settings(largest=1, printed=PRINTED))
    assert plan.points == (1, 1, 16, 16)
    state, _ = run(spec, plan, lagging()[:400])
    assert state.alarm > 0
    assert np.all(np.isfinite(state.sums))
