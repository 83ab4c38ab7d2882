"""Ladders of resistors and capacitors as component networks, for tests and benchmarks."""

from pathlib import Path

from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.model.text import parse_model

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


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
    return "\n".join(
        [
            "name: ladder",
            "sample_time: 1 s",
            "inputs: {u: {unit: V}}",
            "components:",
            *parts,
            f"junctions: {{{', '.join(junctions)}}}",
            f"bonds: [{', '.join(bonds)}]",
            f"sensors: {{{', '.join(f'{name}: {text}' for name, text in found.items())}}}",
            "",
        ]
    )


def example(folder: str) -> ComponentNetwork:
    """Give the component network of an example."""
    return components_of((EXAMPLES / folder / "model.yaml").read_text(encoding="utf-8"))


def components_of(text: str) -> ComponentNetwork:
    """Give the component network of a model file."""
    graph = parse_model(text)
    return build_components(graph, build_network(graph, assign_causality(graph)))
