"""Ladders of resistors and capacitors, and tanks in a row, of any size, for tests and benchmarks."""

from collections.abc import Sequence

from benchmarks.shared.plants import graph_of
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model

TANKS = 6


def ladder(sections: int, sensors: str = "ends") -> ComponentNetwork:
    """Give a ladder fed by a voltage u.

    sensors: `ends` is the voltage of the last section, `ends+i` the current of the first as well, `all` every voltage,
    `none` no sensor.
    """
    return components_of(ladder_text(sections, sensors))


def ladder_text(sections: int, sensors: str = "ends") -> str:
    """Give the model file of a ladder."""
    parts, junctions, bonds = ["  source: {type: Se, law: e = u}"], [], ["source -> line1"]
    for k in range(1, sections + 1):
        parts.append(f"  R{k}: {{type: R, parameters: {{R{k}: 2 ohm}}}}")
        parts.append(f"  C{k}: {{type: C, parameters: {{C{k}: 3 F}}}}")
        junctions += [f"line{k}: 1", f"node{k}: 0"]
        bonds += [f"line{k} -> R{k}", f"line{k} -> node{k}", f"node{k} -> C{k}"]
        bonds += [f"node{k} -> line{k + 1}"] if k < sections else []
    read = [sections] if sensors != "all" else range(1, sections + 1)
    found = {f"v{k}": f"{{reads: node{k}.e, unit: V, noise: 1 mV}}" for k in read if sensors != "none"}
    found |= {"i": "{reads: line1.f, unit: A, noise: 1 mA}"} if sensors == "ends+i" else {}
    sensing = ", ".join(f"{name}: {text}" for name, text in found.items())
    return _model("ladder", "u: {unit: V}", parts, junctions, bonds, sensing)


def example(folder: str) -> ComponentNetwork:
    """Give the component network of an example."""
    return components_of(graph_of(folder))


def components_of(model: BondGraph | str) -> ComponentNetwork:
    """Give the component network of a model, or of a model file."""
    graph = parse_model(model) if isinstance(model, str) else model
    return build_components(graph, build_network(graph, assign_causality(graph)))


def six_tanks() -> str:
    """Give a model of 20 components and 3 sensors: tanks in a row with turbulent pipes and leaks."""
    parts = ["  pump: {type: Se, law: e = P0, parameters: {P0: 50000 Pa}}"]
    junctions, bonds, last = [], [], "pump"
    for k in range(1, TANKS + 1):
        parts.append(f"  pipe{k}: {{type: R, law: e = R{k}*f*abs(f), parameters: {{R{k}: 2e11 Pa*s^2/m^6}}}}")
        parts.append(f"  tank{k}: {{type: C, law: e = q*A{k}, parameters: {{A{k}: 1.3e5 Pa/m^3}}}}")
        parts.append(f"  leak{k}: {{type: Sf, law: f = L{k}, parameters: {{L{k}: 1e-5 m^3/s}}}}")
        junctions += [f"line{k}: 1", f"node{k}: 0"]
        bonds += [f"{last} -> line{k} -> pipe{k}", f"line{k} -> node{k} -> tank{k}", f"node{k} -> leak{k}"]
        last = f"node{k}"
    parts.append("  out: {type: Sf, law: f = K*u, parameters: {K: 2.35e-6 m^3/s/percent}}")
    sensors = (
        "f1: {reads: line1.f, unit: m^3/s, noise: 3e-6 m^3/s}, p3: {reads: node3.e, unit: Pa, noise: 180 Pa}, "
        "p6: {reads: node6.e, unit: Pa, noise: 180 Pa}"
    )
    inputs = "u: {unit: percent}"
    return _model("six tanks", inputs, parts, junctions, [*bonds, f"{last} -> out"], sensors)


def _model(
    name: str, inputs: str, parts: Sequence[str], junctions: Sequence[str], bonds: Sequence[str], sensors: str
) -> str:
    """Give a model file, a sample a second."""
    lines = (f"name: {name}", "sample_time: 1 s", f"inputs: {{{inputs}}}", "components:", *parts)
    joined = (f"junctions: {{{', '.join(junctions)}}}", f"bonds: [{', '.join(bonds)}]", f"sensors: {{{sensors}}}", "")
    return "\n".join((*lines, *joined))
