"""Random plants: electrical networks of every element, and block networks, as the mapping that a model file holds."""

import json
from itertools import pairwise
from typing import Any

from hypothesis import strategies as st

from faultbond.types import ElementType

Mapping = dict[str, Any]

UNITS = {  # of the parameter X of the laws below, where efforts are in V and flows in A
    ElementType.R: ("ohm", "kohm", "V/A", "mohm"),
    ElementType.C: ("F", "uF", "mF", "A*s/V"),
    ElementType.I: ("H", "mH", "V*s/A"),
    ElementType.TF: ("1", "rad", "V/V"),
    ElementType.GY: ("ohm", "kohm"),
    ElementType.SE: ("V", "kV", "mV"),
    ElementType.SF: ("A", "mA", "V/ohm"),
}
LAWS: dict[ElementType, tuple[str | list[str] | None, ...]] = {
    ElementType.R: (None, "e = X*f", "f = e/X", "e - X*f = 0", "e/f = X", "e = X*where(f > 0, f, 2*f)"),
    ElementType.C: (None, "q = X*e", "e = q/X", "e = q/X + 1 - cos(0)"),
    ElementType.I: (None, "p = X*f", "f = p/X", "p = X*min(f, 2*f)"),
    ElementType.TF: (None, ["e1 = X*e2", "f2 = X*f1"], ["e2 = e1/X", "f2/f1 = X"]),
    ElementType.GY: (None, ["e1 = X*f2", "e2 = X*f1"], ["f2 = e1/X", "f1 = e2/X"]),
    ElementType.SE: ("e = X", "e = -X + 2*X", "e = X*V/V"),
    ElementType.SF: ("f = X", "f = X*sqrt(V/V)", "f = max(X, 0)"),
}
ELEMENTS = tuple(element for element in ElementType if element is not ElementType.BLOCK)
ONE_PORTS = tuple(element for element in ElementType if element.n_ports == 1)
TWO_PORTS = tuple(element for element in ElementType if element.n_ports == 2)

sizes = st.floats(1e-6, 1e6, allow_nan=False).map(lambda value: f"{value:.6g}") | st.floats(1e-3, 1e3).map(repr)
percents = st.floats(0.1, 900.0).map(lambda value: f"{value:.4g} %")
seconds = st.sampled_from(["1 s", "20 ms", "0.025 s", "2 min", "1.7 s"])


@st.composite
def parameters(draw: st.DrawFn, unit: str) -> str | Mapping:
    """A parameter in one of its forms."""
    nominal = draw(st.sampled_from(["", "-"])) + draw(sizes)
    if draw(st.booleans()):
        return f"{nominal} {unit}"
    found: Mapping = {"nominal": f"{nominal} {unit}"}
    if draw(st.booleans()):
        found["accuracy"] = draw(percents | sizes.map(lambda size: f"{size} {unit}"))
    if draw(st.booleans()):
        found["change"] = draw(percents | sizes.map(lambda size: f"{size} {unit}"))
    if draw(st.booleans()):
        found["healthy_change"] = draw(percents | sizes.map(lambda size: f"{size} {unit}"))
    if draw(st.booleans()):
        ends = sorted([float(nominal), 2 * float(nominal)])
        found["range"] = draw(st.sampled_from(["any", ["-inf", f"{ends[1]!r}"], [f"{ends[0]!r} {unit}", "inf"]]))
    if unit and draw(st.booleans()):  # blocks may be static, where nothing drifts
        within = f"{1.5 * float(nominal)!r} {unit}"
        found["limit"] = draw(st.sampled_from([within, [within]]))
    if draw(st.booleans()):
        found["suspect"] = draw(st.sampled_from(["yes", "no"]))
    return found


@st.composite
def components(draw: st.DrawFn, element: ElementType, parameter: str) -> Mapping:
    """A component of a type that owns one parameter."""
    law = draw(st.sampled_from(LAWS[element]))
    found: Mapping = {"type": element.value}
    if law is not None:
        texts = [text.replace("X", parameter) for text in ([law] if isinstance(law, str) else law)]
        found["law"] = texts if len(texts) > 1 else texts[0]
    found["parameters"] = {parameter: draw(parameters(draw(st.sampled_from(UNITS[element]))))}
    if element.is_store and draw(st.booleans()):
        key = "q" if element is ElementType.C else "p"
        found["start"] = {key: draw(sizes), "sd": draw(sizes)}
    return found


@st.composite
def plants(draw: st.DrawFn) -> Mapping:
    """A complete model: a chain of junctions, joined directly or by TF and GY, with elements at each."""
    n_junctions = draw(st.integers(1, 4))
    junctions = {f"n{i}": draw(st.sampled_from("01")) for i in range(n_junctions)}
    parts: Mapping = {}
    bonds: list[str] = []
    for i in range(n_junctions):
        for element in draw(st.lists(st.sampled_from(ONE_PORTS), min_size=1, max_size=3)):
            name = f"{element.value}_{len(parts)}"
            parts[name] = draw(components(element, f"P{len(parts)}"))
            bonds.append(f"{name} -> n{i}" if element.is_source and draw(st.booleans()) else f"n{i} -> {name}")
        joint = draw(st.sampled_from([None, *TWO_PORTS]))
        if i and joint is None:
            bonds.append(f"n{i - 1} -> n{i}")
        elif i and joint is not None:
            name = f"{joint.value}_{len(parts)}"
            parts[name] = draw(components(joint, f"P{len(parts)}"))
            bonds.append(f"n{i - 1} -> {name} -> n{i}")
    common = {"0": ("e", "V"), "1": ("f", "A")}
    signals = [(f"{name}.{common[kind][0]}", common[kind][1]) for name, kind in junctions.items()]
    found: Mapping = {"name": draw(st.sampled_from(["plant", "tank: 1", "Behälter #2", '"x"']))}
    found |= {"sample_time": draw(seconds | st.just("variable")), "inputs": {"V": draw(inputs())}}
    found |= {"components": parts, "junctions": junctions, "bonds": bonds, "sensors": draw(sensors(signals))}
    if draw(st.booleans()):
        found["checks"] = draw(checks(sorted(parts), signals))
    found |= draw(settings())
    if draw(st.booleans()):
        found["correlations"] = draw(correlations([name for part in parts.values() for name in part["parameters"]]))
    if draw(st.booleans()):
        found["slow_error"] = draw(slow_errors(signals, found["sensors"]))
    return found


BLOCK_LAWS = (
    "{new} = X*{old}",
    "{new} = {old}**2 - X",
    "{new} = max({old}, X)",
    "0 = {old} - X*{new}",
    "der({new}) = {old}/X",
)
GATES = ("{new} = {old} & {older}", "{new} = ~({old} | {older})", "{new} = {old} ^ ~{older} ^ 1", "{old} ^ {new} = 0")


@st.composite
def networks(draw: st.DrawFn) -> Mapping:
    """A complete block network of numbers: a chain of blocks with one law or two, static or not."""
    static = draw(st.booleans())
    laws = BLOCK_LAWS[:-1] if static else BLOCK_LAWS
    parts: Mapping = {}
    signals = ["u", "v"]
    for _ in range(draw(st.integers(1, 5))):
        name = f"b{len(parts)}"
        found: Mapping = {"law": [], "parameters": {}}
        for law in draw(st.lists(st.sampled_from(laws), min_size=1, max_size=2)):
            new, parameter = f"x{len(signals)}", f"P{len(signals)}"
            found["law"].append(law.format(new=new, old=draw(st.sampled_from(signals))).replace("X", parameter))
            found["parameters"][parameter] = draw(parameters(""))
            signals.append(new)
            if law.startswith("0"):
                found.setdefault("signals", []).append(new)
        stores = [text[4 : text.index(")")] for text in found["law"] if text.startswith("der")]
        if len(stores) == 1 and draw(st.booleans()):
            found["start"] = {stores[0]: draw(sizes), "sd": draw(sizes)}
        if draw(st.booleans()) and not any(isinstance(item, dict) for item in found["parameters"].values()):
            found["suspect"] = draw(st.sampled_from(["yes", "no"]))
        parts[name] = found
    read = draw(st.sampled_from(signals[2:]))
    sensor = {"reads": f"{read} - 3"} | ({} if static and draw(st.booleans()) else {"noise": draw(sizes)})
    model: Mapping = {"sample_time": "none" if static else draw(seconds), "inputs": {"u": {}, "v": {}}}
    if not static and draw(st.booleans()):
        model["warm_up"] = draw(seconds)
    return model | {"blocks": parts, "sensors": {"s": sensor, read: {"reads": read, "noise": "1"}}}


@st.composite
def gates(draw: st.DrawFn) -> Mapping:
    """A complete logic network: a chain of gates."""
    parts: Mapping = {}
    signals = ["u", "v"]
    for _ in range(draw(st.integers(1, 6))):
        law, new = draw(st.sampled_from(GATES)), f"x{len(signals)}"
        old, older = draw(st.sampled_from(signals)), draw(st.sampled_from(signals))
        found: Mapping = {"law": law.format(new=new, old=old, older=older)}
        if not found["law"].startswith(new):
            found["signals"] = new
        if draw(st.booleans()):
            found["suspect"] = draw(st.sampled_from(["yes", "no"]))
        parts[f"g{len(parts)}"] = found
        signals.append(new)
    logic = {"unit": "logic"}
    sensors = {"s": logic | {"reads": f"~{draw(st.sampled_from(signals[2:]))}", "column": "out, raw"}}
    return {"sample_time": "none", "inputs": {"u": logic, "v": logic}, "blocks": parts, "sensors": sensors}


@st.composite
def lags(draw: st.DrawFn) -> object:
    """The time constant of an input or a sensor, as a number or as a table."""
    optional: Mapping = {key: draw(percents) for key in ("accuracy", "change", "healthy_change")}
    optional["range"] = ["0 s", "inf"]
    optional["suspect"] = draw(st.sampled_from(["yes", "no"]))
    table = {"value": "250 ms"} | {key: value for key, value in optional.items() if draw(st.booleans())}
    return draw(st.sampled_from(["3", "0.25 min", table]))


@st.composite
def inputs(draw: st.DrawFn) -> Mapping:
    """An input in volts."""
    unit = draw(st.sampled_from(["V", "mV", "kV"]))
    optional: dict[str, object] = {"column": "V in, raw", "noise": f"{draw(sizes)} {unit}", "settling": draw(seconds)}
    optional["suspect"] = draw(st.sampled_from(["yes", "no"]))
    optional["range"] = draw(st.sampled_from(["any", [f"-1 {unit}", "inf"]]))
    optional["lag"], optional["hold"] = draw(lags()), draw(st.sampled_from(["last", "linear"]))
    optional["healthy_bias"], optional["fitted_range"] = f"{draw(sizes)} {unit}", [f"-2 {unit}", f"1e3 {unit}"]
    return {"unit": unit} | {key: value for key, value in optional.items() if draw(st.booleans())}


@st.composite
def sensors(draw: st.DrawFn, signals: list[tuple[str, str]]) -> Mapping:
    """One to three sensors, each with or without a unit."""
    found: Mapping = {}
    for signal, unit in draw(st.lists(st.sampled_from(signals), min_size=1, max_size=3, unique=True)):
        scale = draw(st.sampled_from(["", "m", "k"]))
        noise = draw(st.sampled_from([f"{draw(sizes)} {scale}{unit}", f"{draw(percents)} of {draw(sizes)} {unit}"]))
        reads = draw(st.sampled_from([signal, f"-{signal} + 3"]))
        stated: Mapping = {"reads": reads, "unit": f"{scale}{unit}", "noise": noise}
        stated["range"] = draw(st.sampled_from(["any", ["-inf", draw(sizes)], [f"-{draw(sizes)} {unit}", "inf"]]))
        bare: Mapping = {"reads": reads, "noise": draw(sizes)}
        trusted = {"suspect": "no"} if draw(st.booleans()) else {}
        lag = {"lag": draw(lags())} if draw(st.booleans()) else {}
        fitted = {"healthy_bias": draw(sizes), "fitted_range": ["-2", "1e3"]} if draw(st.booleans()) else {}
        found[f"s_{len(found)}"] = draw(st.sampled_from([stated, bare])) | trusted | lag | fitted
    return found


@st.composite
def checks(draw: st.DrawFn, parts: list[str], signals: list[tuple[str, str]]) -> Mapping:
    """Checks of some components, of the input, and of a signal."""
    cost = {"cost": draw(st.sampled_from(["1", "0.5", "3"]))}
    found: Mapping = {name: draw(st.sampled_from([{}, "2", cost])) for name in draw(st.sets(st.sampled_from(parts)))}
    if draw(st.booleans()):
        found["V"] = draw(st.sampled_from([{}, cost])) | draw(st.sampled_from([{}, {"move": f"{draw(sizes)} mV"}]))
    if draw(st.booleans()):
        signal, unit = draw(st.sampled_from(signals))
        found["by_hand"] = {"reads": f"2*{signal}", "unit": f"m{unit}", "noise": draw(sizes)} | cost
    return found


@st.composite
def correlations(draw: st.DrawFn, names: list[str]) -> Mapping:
    """Correlations of parameters with the next one, small enough that they cannot contradict each other."""
    values = st.sampled_from(["0.45", "-0.3", "1e-3", "0"])
    return {one: {other: draw(values)} for one, other in pairwise(names) if draw(st.booleans())}


@st.composite
def slow_errors(draw: st.DrawFn, signals: list[tuple[str, str]], measured: Mapping) -> Mapping:
    """A slow error of a signal, and one of a sensor that grows after a change of the input."""
    signal, unit = draw(st.sampled_from(signals))
    memory = draw(seconds)
    size = draw(st.sampled_from([draw(percents), f"{draw(sizes)} {unit}", draw(sizes)]))
    sensor = {"size": f"{draw(sizes)} over {memory}", "after": ["V"], "each": draw(sizes)}
    return {signal: f"{size} over {memory}", draw(st.sampled_from(sorted(measured))): sensor}


@st.composite
def settings(draw: st.DrawFn) -> Mapping:
    """Some of the optional keys of the model."""
    optional = {
        "max_faults": draw(st.sampled_from(["1", "3"])),
        "accuracy": draw(percents),
        "warm_up": draw(seconds),
        "instrument_faults": draw(st.sampled_from(["yes", "no"])),
        "time_between_false_alarms": draw(st.sampled_from(["30 days", "1 h", "2 weeks"])),
        "time": draw(st.sampled_from([{"column": "t_ms", "unit": "ms"}, {"unit": "min"}, {"column": "clock"}])),
        "constants": {"g": "9.81 m/s^2", "k": "7"},
    }
    return {key: value for key, value in optional.items() if draw(st.booleans())}


@st.composite
def shuffled(draw: st.DrawFn, plant: Mapping) -> Mapping:
    """The same model with its sections, and the entries of each, in another order."""
    found = {}
    for key in draw(st.permutations(sorted(plant))):
        value = plant[key]
        if isinstance(value, dict):
            value = {name: value[name] for name in draw(st.permutations(sorted(value)))}
        found[key] = value
    return found


def as_text(plant: Mapping) -> str:
    """Give a mapping as the text of a model file (JSON is YAML)."""
    return json.dumps(plant, indent=1, ensure_ascii=False)
