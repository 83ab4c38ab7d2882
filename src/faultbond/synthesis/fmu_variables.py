"""The variables of an FMU: what a simulator tells a monitor, and what that says; and variables.h, their numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from math import isfinite, nan

from faultbond.contract.samples import STATUSES
from faultbond.contract.spec import EngineSpec
from faultbond.errors import ModelError
from faultbond.io.recording import ROUNDING
from faultbond.model.graph import BondGraph, Input, Sensor, Unit
from faultbond.synthesis.plan_tables import numbers
from faultbond.types import FaultKind

NONE = -1  # number of the best hypothesis and its kind where there is none
TIME = "time"  # FMI 3 has it among the variables


class Sort(Enum):
    """What the values of a variable are; the value is the element of FMI 3, whose words those of FMI 2 follow."""

    REAL = "Float64"
    WHOLE = "Int64"
    FLAG = "Boolean"
    TEXT = "String"
    CHOICE = "Enumeration"


@dataclass(frozen=True, slots=True, kw_only=True)
class Word:
    """One value of an enumeration."""

    name: str
    value: int
    description: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A variable of an FMU.

    macro : its number in C; of those that are numbered one after the other, only the first has one
    start : value before the first sample; nan is a missing one
    unit : of the model file; values are SI
    choices : of an enumeration, whose name is that of the variable
    """

    name: str
    description: str
    macro: str = ""
    sort: Sort = Sort.REAL
    is_input: bool = False
    start: float | int | bool | str = 0.0
    unit: Unit | None = None
    choices: tuple[Word, ...] = ()


def fmu_variables(graph: BondGraph, spec: EngineSpec) -> tuple[Variable, ...]:
    """Give the variables of an FMU in the order of their numbers, from 1 on; 0 is the time.

    Raises
    ------
    ModelError
        Where an input or a sensor has the name of another variable.
    """
    told = tuple(_told(graph))
    found = (*told, *_findings(spec), *_parameters(graph))
    seen = {TIME, *(item.name for item in found[len(told) :])}
    lines = [item.line for item in (*graph.inputs, *graph.sensors)]
    for item, line in zip(told, lines, strict=True):
        if item.name in seen:
            raise ModelError(
                f"{graph.file}:{line}: an FMU has another variable called `{item.name}`. Give this one another name in "
                f"the model; `column: {item.name}` lets a recording stay as it is."
            )
        seen.add(item.name)
    return found


def _told(graph: BondGraph) -> Iterator[Variable]:
    """Give what a simulator tells: inputs of the plant, then readings."""
    for first, what, items in (("VR_INPUTS", "input", graph.inputs), ("VR_READINGS", "sensor", graph.sensors)):
        for k, item in enumerate(items):
            yield Variable(
                name=item.name,
                description=f"{what} of the plant; NaN: no value",
                macro=first if k == 0 else "",
                is_input=True,
                start=nan,
                unit=item.unit,
            )


def _findings(spec: EngineSpec) -> tuple[Variable, ...]:
    """Give what a monitor says, beside the values of parameters."""
    none = Word(name="none", value=NONE, description="there is no diagnosis yet")
    kinds = tuple(Word(name=kind.value, value=k) for k, kind in enumerate(FaultKind))
    names = enumerate(hypothesis_titles(spec))
    return (
        Variable(name="alarm", description="a fault was detected", macro="VR_ALARM", sort=Sort.FLAG, start=False),
        Variable(
            name="status",
            description="what the monitor does",
            macro="VR_STATUS",
            sort=Sort.CHOICE,
            start=0,
            choices=tuple(
                Word(name=item.name.lower(), value=k, description=item.value) for k, item in enumerate(STATUSES)
            ),
        ),
        Variable(name="samples", description="samples taken", macro="VR_SAMPLES", sort=Sort.WHOLE, start=0),
        Variable(
            name="alarm_time", description="when the alarm was raised; 0 before", macro="VR_ALARM_TIME", unit=_SECOND
        ),
        Variable(
            name="change_time",
            description="when the fault began, as far as the alarm can tell; 0 before",
            macro="VR_CHANGE_TIME",
            unit=_SECOND,
        ),
        Variable(
            name="diagnosis_time",
            description="sample of the last diagnosis; 0 before",
            macro="VR_DIAGNOSIS_TIME",
            unit=_SECOND,
        ),
        Variable(
            name="best",
            description="the likeliest hypothesis: what is at fault",
            macro="VR_BEST",
            sort=Sort.CHOICE,
            start=NONE,
            choices=(none, *(Word(name=name, value=k) for k, name in names)),
        ),
        Variable(
            name="best_name",
            description="the likeliest hypothesis by name; empty: none",
            macro="VR_BEST_NAME",
            sort=Sort.TEXT,
            start="",
        ),
        Variable(
            name="kind",
            description="how it misbehaves",
            macro="VR_KIND",
            sort=Sort.CHOICE,
            start=NONE,
            choices=(none, *kinds),
        ),
        Variable(name="probability", description="that the likeliest hypothesis is true", macro="VR_PROBABILITY"),
        Variable(
            name="group",
            description="hypotheses that data cannot tell apart yet, the likeliest among them",
            macro="VR_GROUP",
            sort=Sort.WHOLE,
            start=0,
        ),
        Variable(
            name="within_accuracy",
            description="probability that nothing is at fault but what the declared accuracy allows",
            macro="VR_WITHIN_ACCURACY",
        ),
        Variable(name="mismatch", description="probability that the model is off", macro="VR_MISMATCH"),
    )


def _parameters(graph: BondGraph) -> Iterator[Variable]:
    """Give values and standard deviations of the parameters, by the likeliest hypothesis."""
    for k, item in enumerate(graph.parameters):
        yield Variable(
            name=f"{item.name}.estimate",
            description=f"{item.name} of {item.owner}; the nominal value where the likeliest hypothesis has it healthy",
            macro="VR_ESTIMATES" if k == 0 else "",
            start=item.nominal,
            unit=item.unit,
        )
    for k, item in enumerate(graph.parameters):
        yield Variable(
            name=f"{item.name}.sd",
            description=f"standard deviation of {item.name}.estimate; the declared accuracy alike",
            macro="VR_SDS" if k == 0 else "",
            start=item.accuracy,
            unit=Unit(item.unit.text, item.unit.factor),
        )


def hypothesis_titles(spec: EngineSpec) -> list[str]:
    """Give each hypothesis by its parameters and instruments, in the order of their numbers."""
    found = []
    for k in range(spec.n_hypotheses):
        instruments = [f"{'sensor' if item.is_output else 'input'} {item.name}" for item in spec.instruments_in(k)]
        found.append(", ".join([*instruments, *(spec.parameters[i].name for i in spec.members(k))]))
    return found


def variables_header(graph: BondGraph, spec: EngineSpec, token: str) -> str:
    """Give variables.h: numbers of the variables, names of the hypotheses, nominal values and ranges."""
    variables = fmu_variables(graph, spec)
    places = {item.macro: k for k, item in enumerate(variables, start=1) if item.macro}
    arrays = ("VR_INPUTS", "VR_READINGS", "VR_ESTIMATES", "VR_SDS")
    macros = {"VR_TIME": 0, **dict.fromkeys(arrays, 0), **places}
    names = ",\n    ".join(f'"{name}"' for name in hypothesis_titles(spec)) or '""'
    inputs, readings = _ends(graph.inputs, inwards=False), _ends(graph.sensors, inwards=True)
    return "\n".join(
        [
            "/* The variables of the FMU: their numbers, and what is known of them. Generated by faultbond. */",
            "#ifndef VARIABLES_H",
            "#define VARIABLES_H",
            "",
            f'#define FMU_TOKEN "{token}"',
            "",
            *(f"#define {name} {number}u" for name, number in macros.items()),
            "",
            "/* The hypotheses by name. */",
            f"static const char *const HYPOTHESIS_NAME[] = {{\n    {names}}};",
            "",
            "/* Parameters while nothing is known of a fault, SI. */",
            numbers("NOMINAL_VALUE", (item.nominal for item in graph.parameters)),
            numbers("NOMINAL_SD", (item.accuracy for item in graph.parameters)),
            "",
            "/* Ends of the ranges, SI: a reading there or beyond is no value, of an input one beyond. */",
            numbers("INPUT_LEAST", (low for low, _ in inputs)),
            numbers("INPUT_MOST", (high for _, high in inputs)),
            numbers("READING_LOWEST", (low for low, _ in readings)),
            numbers("READING_HIGHEST", (high for _, high in readings)),
            "",
            "#endif",
            "",
        ]
    )


def _ends(items: Sequence[Input | Sensor], *, inwards: bool) -> list[tuple[float, float]]:
    """Give the ends of ranges in SI, moved inwards or outwards by what units round, as those of a recording."""
    found = []
    for item in items:
        width = ROUNDING * max((abs(end) for end in (item.lower, item.upper) if isfinite(end)), default=0.0)
        width = width if inwards else -width
        found.append((item.lower + width, item.upper - width))
    return found


_SECOND = Unit("s")
