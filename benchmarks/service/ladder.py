"""A ladder of 20 signals at 100 Hz: its model, and what a healthy one gives."""

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.model.text import parse_model
from faultbond.simulate import Inputs, simulate

SECTIONS = 6
STEP = 0.01  # s


def model() -> str:
    """Give a ladder of resistors and capacitors that reads each voltage and current: 18 sensors and 2 inputs."""
    parts = ["  source: {type: Se, law: e = u}", "  load: {type: Sf, law: f = i_load}"]
    junctions, bonds, last = list[str](), list[str](), "source"
    sensors = list[str]()
    for k in range(1, SECTIONS + 1):
        parts.append(f"  R{k}: {{type: R, parameters: {{R{k}: 2 ohm}}}}")
        parts.append(f"  C{k}: {{type: C, parameters: {{C{k}: 0.3 F}}}}")
        junctions += [f"line{k}: 1", f"node{k}: 0"]
        bonds += [f"{last} -> line{k} -> R{k}", f"line{k} -> node{k} -> C{k}"]
        sensors.append(f"  v{k}: {{reads: node{k}.e, unit: V, noise: 10 mV}}")
        sensors.append(f"  i{k}: {{reads: line{k}.f, unit: A, noise: 10 mA}}")
        sensors.append(f"  c{k}: {{reads: C{k}.f, unit: A, noise: 10 mA}}")
        last = f"node{k}"
    lines = ("name: ladder", f"sample_time: {STEP} s", "max_faults: 1", "time: {column: time}")
    inputs = ("inputs:", "  u: {unit: V}", "  i_load: {unit: A}", "components:", *parts)
    joined = (f"junctions: {{{', '.join(junctions)}}}", f"bonds: [{', '.join([*bonds, f'{last} -> load'])}]")
    return "\n".join((*lines, *inputs, *joined, "sensors:", *sensors, ""))


def recording(n: int) -> tuple[list[str], FloatArray]:
    """Give names and values (n, 20) of a healthy ladder whose voltage and load move."""
    graph = parse_model(model())
    when: FloatArray = STEP * np.arange(n, dtype=np.float64)
    values = np.column_stack([5.0 + (when // 7 % 2), 0.2 * (when // 11 % 2)])
    made = simulate(graph, Inputs(time=when, values=values), [], seed=1)
    names = [item.name for item in graph.inputs] + [item.name for item in graph.sensors]
    return names, np.column_stack([made.inputs, made.outputs])
