"""Logic circuits and scenarios of the diagnosis competition (DXC): system catalogue XML and `.scn` text.

Ports, probes and wires are wiring: what they connect is one signal. Gates, inverters and buffers are the suspects.
Source: the competition's synthetic track; docs/commands.md.
"""

import math
import re
import xml.etree.ElementTree as ET  # document types, hence entities, are refused before anything is parsed
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from faultbond.errors import ModelError, RecordingError
from faultbond.model.logic import Gate, GateFunction, GateSet, LogicNetwork, Scenario, TimedObservation

MAX_BYTES = 64_000_000  # a circuit of 3500 gates has 4 MB
MILLISECONDS = 1e-3
WIRING = ("port", "probe", "wire")
FUNCTIONS = {item.value: item for item in GateFunction} | {"inverter": GateFunction.NOT, "buf": GateFunction.BUFFER}
TYPE = re.compile(r"([a-z]+)([0-9]{0,4})")
PIN = re.compile(r"o|i([1-9][0-9]{0,3})")

STATEMENT = re.compile(r"(\w+)\s*(?:@\s*([0-9.]+)\s*)?(.*)", re.DOTALL)
ASSIGNMENT = re.compile(r"([\w.]+)\s*=\s*(\w+)")
BOOLEANS = {"true": True, "false": False, "1": True, "0": False}


def read_circuit(path: str | Path) -> LogicNetwork:
    """Read a circuit: the first system of a system catalogue.

    Parameters
    ----------
    path : XML file; a signal takes the name of its port, else of its probe, else of the pin that drives it

    Raises
    ------
    ModelError
        When the file cannot be read, or is no circuit of known gates whose pins are all connected.
    """
    text = _read(path, ModelError)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ModelError(f"{path}:{_line(text, '<!DOCTYPE')}: a document type is not read. Remove the <!DOCTYPE> part.")
    try:
        root = ET.fromstring(text)  # noqa: S314 - no entities left, see above
    except ET.ParseError as problem:
        raise ModelError(f"{path}:{problem.position[0]}: not XML: {problem}.") from problem
    system = root.find("{*}systems/{*}system")
    if system is None:
        raise ModelError(f"{path}: no circuit in it. Expected <systemCatalog><systems><system>, as the DXC files have.")
    kinds = _kinds(system, text, path)
    nets = _nets(system, kinds, text, path)
    names = _signal_names(nets, kinds)
    gates = _gates(kinds, nets, names, text, path)
    ports = {name: names[nets[name]] for name, kind in kinds.items() if kind == "port"}
    driven = {gate.output for gate in gates}
    copies = [
        Gate(name=port, function=GateFunction.BUFFER, output=port, inputs=(signal,), trusted=True)
        for port, signal in ports.items()
        if port != signal
    ]
    inputs = tuple(port for port, signal in ports.items() if port == signal and signal not in driven)
    outputs = tuple(port for port in ports if port not in inputs)
    fed = {*driven, *inputs}
    for gate in gates:
        for signal in gate.inputs:
            if signal not in fed:
                raise ModelError(
                    f"{path}:{_line(text, f'>{gate.name}<')}: gate {gate.name}: nothing drives its input {signal}. "
                    "Connect it to a port or to the output of a gate."
                )
    title = (system.findtext("{*}systemName") or Path(path).stem).strip()
    return LogicNetwork(name=title, gates=(*gates, *copies), inputs=inputs, outputs=outputs)


def read_scenario(path: str | Path) -> Scenario:
    """Read a scenario: what was observed, and the truth where it is told.

    Parameters
    ----------
    path : text file of statements that end in `;`, their times `@` in milliseconds

    Raises
    ------
    RecordingError
        When the file cannot be read, or has no observation.
    """
    text = _read(path, RecordingError)
    observations: list[TimedObservation] = []
    injected: set[str] = set()
    truth: tuple[GateSet, ...] | None = None
    cardinality = normalization = None
    for line, keyword, moment, rest in _statements(text, path):
        where = f"{path}:{line}"
        match keyword:
            case "sensors":
                values = _booleans(rest, where)
                observations.append(TimedObservation(time=_number(moment, where) * MILLISECONDS, values=values))
            case "faultInjection":
                injected |= {name for name, mode in ASSIGNMENT.findall(_braces(rest, where)) if mode == "faulty"}
            case "ambiguityGroup":
                truth = _group(rest, where)
                least = re.search(r"\bminCardinality\s*=\s*([0-9]+)", rest)
                cardinality = int(least[1]) if least else None
            case "normalizationFactor":
                normalization = _number(rest.removeprefix("=").strip(), where)
                if not 0 < normalization < math.inf:
                    raise RecordingError(f"{where}: normalizationFactor {normalization:g} is not positive and finite.")
    if not observations:
        raise RecordingError(f"{path}: no observation. Expected lines such as: sensors @0 {{ i1 = true, o1 = false }};")
    return Scenario(
        name=Path(path).stem,
        observations=tuple(sorted(observations, key=lambda item: item.time)),
        injected=frozenset(injected),
        cardinality=cardinality,
        diagnoses=truth,
        normalization=normalization,
    )


def _read(path: str | Path, error: type[ModelError] | type[RecordingError]) -> str:
    """Give the text of a file of bearable size."""
    try:
        size = Path(path).stat().st_size
        if size > MAX_BYTES:
            raise error(f"{path}: {size / 1e6:.0f} MB are more than the {MAX_BYTES / 1e6:.0f} MB that are read.")
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as problem:
        raise error(f"{path}: {problem.strerror or problem}.") from problem
    except UnicodeDecodeError as problem:
        raise error(f"{path}: not UTF-8 text. Save it as UTF-8.") from problem


# Circuits


def _texts(system: ET.Element, items: str) -> Iterator[dict[str, str]]:
    """Give the texts of the children of each of some elements, by their tags without namespace."""
    for element in system.iterfind(items):
        yield {child.tag.rpartition("}")[2]: (child.text or "").strip() for child in element}


def _kinds(system: ET.Element, text: str, path: str | Path) -> dict[str, str]:
    """Give the type of each component by its name."""
    kinds: dict[str, str] = {}
    for component in _texts(system, "{*}components/{*}component"):
        name = component.get("name", "")
        if not name or name in kinds:
            problem = f"component {name} stands twice" if name else "a component has no name"
            raise ModelError(f"{path}:{_line(text, f'>{name}<', bool(name))}: {problem}. Give each a name of its own.")
        kinds[name] = component.get("componentType", "")
    return kinds


def _nets(system: ET.Element, kinds: Mapping[str, str], text: str, path: str | Path) -> dict[str, str]:
    """Give a representative for each wiring component: those of one representative are connected."""
    parent = {name: name for name, kind in kinds.items() if kind in WIRING}

    def root(name: str) -> str:
        while parent[name] != name:
            parent[name] = name = parent[parent[name]]
        return name

    for connection in _texts(system, "{*}connections/{*}connection"):
        ends = (connection.get("c1", ""), connection.get("c2", ""))
        for end in ends:
            if end not in parent:
                raise ModelError(
                    f"{path}:{_line(text, f'>{end}<')}: connection to {end!r}, which is no port, probe or wire. "
                    "Declare it under <components>."
                )
        parent[root(ends[0])] = root(ends[1])
    return {name: root(name) for name in parent}


def _signal_names(nets: Mapping[str, str], kinds: Mapping[str, str]) -> dict[str, str]:
    """Give the name of each net by its representative: the first port, else probe, else driving pin, else any."""
    order = {"port": 0, "probe": 1, "wire": 3}
    chosen: dict[str, tuple[int, str]] = {}
    for name, net in nets.items():
        rank = 2 if name.endswith(".o") else order[kinds[name]]
        if net not in chosen or rank < chosen[net][0]:
            chosen[net] = rank, name
    return {net: name for net, (_, name) in chosen.items()}


def _gates(
    kinds: Mapping[str, str], nets: Mapping[str, str], names: Mapping[str, str], text: str, path: str | Path
) -> list[Gate]:
    """Give the gates with the signals at their pins."""
    pins: dict[str, dict[int, str]] = defaultdict(dict)  # 0 is the output
    for name, net in nets.items():
        gate, _, pin = name.rpartition(".")
        if match := PIN.fullmatch(pin):
            pins[gate][int(match[1] or 0)] = names[net]
    gates = []
    for name, kind in kinds.items():
        if kind in WIRING:
            continue
        match = TYPE.fullmatch(kind)
        if match is None or match[1] not in FUNCTIONS:
            raise ModelError(
                f"{path}:{_line(text, f'>{name}<')}: {name} is of type {kind!r}. "
                f"Known are {', '.join(FUNCTIONS)}, with their number of inputs (and2), and {', '.join(WIRING)}."
            )
        function = FUNCTIONS[match[1]]
        count = 1 if function.is_unary else int(match[2] or len(pins[name]) - 1)
        if count < 1 or sorted(pins[name]) != list(range(count + 1)):
            raise ModelError(
                f"{path}:{_line(text, f'>{name}<')}: {kind} {name} needs the wires {name}.o and {name}.i1"
                f"{f' to {name}.i{count}' if count > 1 else ''}. Declare them."
            )
        inputs = tuple(pins[name][number] for number in range(1, count + 1))
        gates.append(Gate(name=name, function=function, output=pins[name][0], inputs=inputs))
    if not gates:
        raise ModelError(f"{path}: no gate in it.")
    return gates


def _line(text: str, part: str, known: bool = True) -> int:
    """Give the line in which a part of the text first stands."""
    return text.count("\n", 0, max(text.find(part), 0)) + 1 if known else 1


# Scenarios


def _statements(text: str, path: str | Path) -> Iterable[tuple[int, str, str, str]]:
    """Give (line, keyword, time, rest) of each statement."""
    begin = 0
    while (end := text.find(";", begin)) >= 0:
        statement = text[begin:end]
        first = begin + len(statement) - len(statement.lstrip())
        line = text.count("\n", 0, first) + 1
        if statement := statement.strip():
            match = STATEMENT.fullmatch(statement)
            if match is None:
                raise RecordingError(f"{path}:{line}: {statement[:40]!r} is no statement of a scenario.")
            yield line, match[1], match[2] or "", match[3].strip()
        begin = end + 1
    if rest := text[begin:].strip():
        line = text.count("\n", 0, text.find(rest, begin)) + 1
        raise RecordingError(f"{path}:{line}: {rest[:40]!r} does not end in `;`. Is the file cut off?")


def _braces(text: str, where: str) -> str:
    """Give what stands in the first braces of a text without braces in them."""
    match = re.search(r"\{([^{}]*)\}", text)
    if match is None:
        raise RecordingError(f"{where}: expected values in braces {{ .. }}.")
    return match[1]


def _booleans(text: str, where: str) -> dict[str, bool]:
    """Read `{ i1 = true, o1 = false }`."""
    values: dict[str, bool] = {}
    for item in filter(None, (part.strip() for part in _braces(text, where).split(","))):
        match = ASSIGNMENT.fullmatch(item)
        if match is None or match[2].lower() not in BOOLEANS:
            raise RecordingError(f"{where}: {item[:40]!r} is no observation. Expected a port and true or false.")
        if match[1] in values:
            raise RecordingError(f"{where}: {match[1]} is observed twice in one statement. Keep one.")
        values[match[1]] = BOOLEANS[match[2].lower()]
    return values


def _group(text: str, where: str) -> tuple[GateSet, ...]:
    """Read the true diagnoses of `size = 2, minCardinality = 1, diagnoses = { { gate1 }, { gate2 } }`."""
    match = re.search(r"diagnoses\s*=\s*\{((?:[^{}]*\{[^{}]*\})*[^{}]*)\}", text)
    if match is None:
        raise RecordingError(f"{where}: expected diagnoses = {{ {{ gate1 }}, .. }}.")
    found = [frozenset(re.findall(r"[\w.]+", inner)) for inner in re.findall(r"\{([^{}]*)\}", match[1])]
    size = re.search(r"\bsize\s*=\s*([0-9]+)", text)
    if size is not None and int(size[1]) != len(found):
        raise RecordingError(f"{where}: size = {size[1]}, but {len(found)} diagnoses. Is the file cut off?")
    return tuple(found)


def _number(text: str, where: str) -> float:
    """Read a number."""
    try:
        return float(text)
    except ValueError as problem:
        raise RecordingError(f"{where}: {text[:40]!r} is not a number.") from problem
