"""Plants and runs that the tests of the analysis share."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from faultbond.analysis.sensitivity import Experiment, Sensitivity, build_recursion, sensitivity
from faultbond.arrays import FloatArray
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[2] / "examples"

TANK_SENSORS = "  flow:     {reads: sqrt(orifice.e/K_meter), unit: m^3/s, noise: 2.8e-6 m^3/s}\n"

LAMP = """\
name: lamp
sample_time: 0.1 s
max_faults: 1
constants: {Vt: 0.1 V}
inputs: {V: {unit: V, noise: 1 mV}}
components:
  source: {type: Se, law: e = V}
  series: {type: R, parameters: {R1: 10 ohm}}
  cell: {type: C, parameters: {C1: 0.1 F}}
  wire: {type: R, parameters: {R2: 5 ohm}}
  lamp: {type: R, parameters: {Is: 1e-6 A}, law: "f = Is*(exp(e/Vt) - 1)"}
junctions: {first: 1, node: 0, branch: 1}
bonds: [source -> first, first -> series, first -> node, node -> cell, node -> branch, branch -> wire, branch -> lamp]
sensors: {i: {reads: branch.f, unit: A, noise: 1 mA}, v: {reads: node.e, unit: V, noise: 10 mV}}
"""
TWO_STORES = """\
name: two stores
sample_time: 1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 ohm}}
  C1: {type: C, parameters: {C1: 1 F}}
  C2: {type: C, parameters: {C2: 1.5 F}}
junctions: {loop: 1}
bonds: [source -> loop -> R, loop -> C1, loop -> C2]
sensors: {V_C: {reads: C1.e + C2.e, unit: V, noise: 1e-6 V}}
"""
NINE_SENSORS = """\
name: two cells
sample_time: 0.1 s
inputs: {V: {unit: V, noise: 1 mV}}
components:
  source: {type: Se, law: e = V}
  r1: {type: R, parameters: {R1: 10 ohm}}
  c1: {type: C, parameters: {C1: 1 F}}
  r2: {type: R, parameters: {R2: 10 ohm}}
  c2: {type: C, parameters: {C2: 1 F}}
junctions: {a: 1, n: 0, b: 1, m: 0}
bonds: [source -> a, a -> r1, a -> n, n -> c1, n -> b, b -> r2, b -> m, m -> c2]
sensors:
  s0: {reads: a.f, unit: A, noise: 1 mA}
  s1: {reads: n.e, unit: V, noise: 1 mV}
  s2: {reads: m.e, unit: V, noise: 2 mV}
  s3: {reads: b.f, unit: A, noise: 1 mA}
  s4: {reads: r1.e, unit: V, noise: 1 mV}
  s5: {reads: r2.e, unit: V, noise: 1 mV}
  s6: {reads: n.e, unit: V, noise: 5 mV}
  s7: {reads: c1.f, unit: A, noise: 1 mA}
  s8: {reads: m.e, unit: V, noise: 1 mV}
"""
HOT_DRIVE = """\
name: hot drive
sample_time: 0.25 s
accuracy: 5 %
constants: {alpha: 0.0039 1/K, cold: 20 degC, ratio: 20, creep: 0.05 rad/s}
inputs: {voltage: {unit: V}, load: {unit: N*m}, t_amb: {unit: degC}}
components:
  supply:  {type: Se, law: e = voltage}
  winding: {type: R, law: e = R*(1 + alpha*(copper.e - cold))*f, parameters: {R: 0.5 ohm}}
  motor:   {type: GY, parameters: {K: 1.2 V*s/rad}}
  rotor:   {type: I, parameters: {J: 0.15 kg*m^2}}
  gear:    {type: TF, law: [e2 = ratio*e1, f1 = ratio*f2]}
  rope:    {type: C, law: e = k*q, parameters: {k: 300 N*m/rad}}
  damper:  {type: R, parameters: {d: 30 N*m*s/rad}}
  drum:    {type: I, parameters: {J2: 60 kg*m^2}}
  bearing: {type: R, law: e = T*tanh(f/creep), parameters: {T: 80 N*m}}
  driven:  {type: Se, law: e = load}
  joule:   {type: Sf, law: f = winding.e*winding.f}
  mass:    {type: C, law: q = C*(e - cold), parameters: {C: 4000 J/K}}
  cooling: {type: R, law: f = G*e, parameters: {G: 4 W/K}}
  ambient: {type: Se, law: e = t_amb}
junctions: {armature: 1, shaft: 1, pull: 0, stretch: 1, out: 1, copper: 0, loss: 1}
bonds: [supply -> armature -> winding, armature -> motor -> shaft -> rotor, shaft -> gear -> pull -> stretch -> rope,
        stretch -> damper, pull -> out -> drum, out -> bearing, out -> driven,
        joule -> copper -> mass, copper -> loss -> cooling, loss -> ambient]
sensors:
  i: {reads: armature.f, unit: A, noise: 0.15 A}
  w: {reads: shaft.f, unit: rad/s, noise: 0.25 rad/s}
  w2: {reads: out.f, unit: rad/s, noise: 0.02 rad/s}
  T: {reads: copper.e, unit: degC, noise: 0.3 K}
"""


def hot_motor(*, lag: str = "") -> str:
    """Give a motor whose winding warms up, and resists more then; with more that is stated of its thermometer.

    At 0 K, where a start that nobody states begins, its resistance is below zero.
    """
    return f"""\
name: hot motor
sample_time: 0.25 s
accuracy: 5 %
constants: {{alpha: 0.0039 1/K, cold: 20 degC}}
inputs: {{voltage: {{unit: V}}, load: {{unit: N*m}}, t_amb: {{unit: degC}}}}
components:
  supply:  {{type: Se, law: e = voltage}}
  winding: {{type: R, law: e = R*(1 + alpha*(copper.e - cold))*f, parameters: {{R: 0.5 ohm}}}}
  motor:   {{type: GY, parameters: {{K: 1.2 V*s/rad}}}}
  rotor:   {{type: I, parameters: {{J: 0.3 kg*m^2}}}}
  bearing: {{type: R, parameters: {{b: 0.02 N*m*s/rad}}}}
  driven:  {{type: Se, law: e = load}}
  joule:   {{type: Sf, law: f = winding.e*winding.f}}
  mass:    {{type: C, law: q = C*(e - cold), parameters: {{C: 4000 J/K}}}}
  cooling: {{type: R, law: f = G*e, parameters: {{G: 4 W/K}}}}
  ambient: {{type: Se, law: e = t_amb}}
junctions: {{armature: 1, shaft: 1, copper: 0, loss: 1}}
bonds: [supply -> armature -> winding, armature -> motor -> shaft -> rotor, shaft -> bearing, shaft -> driven,
        joule -> copper -> mass, copper -> loss -> cooling, loss -> ambient]
sensors:
  i: {{reads: armature.f, unit: A, noise: 0.15 A}}
  w: {{reads: shaft.f, unit: rad/s, noise: 0.25 rad/s}}
  T: {{reads: copper.e, unit: degC, noise: 0.3 K{lag}}}
"""


def pumped_tank(*, speed: str = "", meter: str = "") -> str:
    """Give a tank that a pump fills, with more that is stated of its speed and of the meter of its flow."""
    return f"""\
name: pumped tank
sample_time: 1 s
accuracy: 4 %
constants: {{all: 100 percent}}
inputs: {{u: {{unit: percent{speed}}}}}
blocks:
  pump: {{law: F = K*u/all, parameters: {{K: 0.5 l/s}}}}
  tank: {{law: der(h) = (F - C*h)/A, parameters: {{C: 0.3 l/s/m, A: 0.2 m^2}}}}
sensors:
  flow: {{reads: F, unit: l/s, noise: 0.001 l/s{meter}}}
  level: {{reads: h, unit: m, noise: 0.01 m}}
slow_error: {{F: 1 % over 5 min}}
"""


def example(name: str, *changes: tuple[str, str]) -> StepModel:
    """A built-in plant, by its folder or its file, some words of it changed."""
    path = EXAMPLES / (name if name.endswith(".yaml") else f"{name}/model.yaml")
    if not changes:
        return build_step_model(build_plant(load_model(path)))
    text = path.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return stated(text)


def stated(text: str) -> StepModel:
    """The plant of a model text."""
    return build_step_model(build_plant(parse_model(text)))


def circuit(components: str, junctions: str, bonds: str, sensors: str, extra: str = "") -> StepModel:
    """A circuit with the voltage V as its input."""
    return stated(
        f"name: circuit\nsample_time: 0.1 s\nmax_faults: 2\ninputs: {{V: {{unit: V}}}}\n{extra}components:\n"
        f"  source: {{type: Se, law: e = V}}\n{components}\njunctions: {{{junctions}}}\nbonds: [{bonds}]\n"
        f"sensors: {{{sensors}}}\n"
    )


def run(
    model: StepModel,
    inputs: FloatArray,
    dt: float | FloatArray,
    start: Sequence[float] | FloatArray,
    theta: FloatArray | None = None,
) -> Sensitivity:
    """A run with equal steps, or given ones, the first sample at the start."""
    n = len(inputs)
    steps = np.full(n, dt) if isinstance(dt, float) else dt.copy()
    steps[0] = 0.0
    nominal = np.array([item.nominal for item in model.plant.graph.parameters])
    experiment = Experiment(
        start=np.asarray(start, dtype=np.float64),
        inputs=np.asarray(inputs, dtype=np.float64).reshape(n, -1),
        dt=steps,
        theta=nominal if theta is None else theta,
        implicit=model.reference_implicit,
    )
    return sensitivity(build_recursion(model.plant), experiment)


def positions(model: StepModel, *names: str) -> tuple[int, ...]:
    """Where parameters stand."""
    return tuple([item.name for item in model.plant.graph.parameters].index(name) for name in names)


def named(model: StepModel, sets: Iterable[tuple[int, ...]]) -> list[tuple[str, ...]]:
    """Sets by the names of their parameters."""
    names = [item.name for item in model.plant.graph.parameters]
    return [tuple(names[k] for k in chosen) for chosen in sets]
