"""modelDescription.xml and buildDescription.xml of an FMU, by the versions 2.0 and 3.0 of the standard.

Source: Functional Mock-up Interface, versions 2.0.5 and 3.0.2, https://fmi-standard.org.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isnan
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from faultbond.errors import ModelError
from faultbond.model.graph import Unit
from faultbond.model.units import Dimension, measure
from faultbond.synthesis.fmu_variables import TIME, Sort, Variable

_BASES = {"kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "mole": "mol", "candela": "cd"}
_OF_FMI2 = {Sort.REAL: "Real", Sort.WHOLE: "Integer"}  # where FMI 3 has other words


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuTitle:
    """What an FMU is called.

    name : of the model
    identifier : the same as a name in C, of the library
    token : that the library asks for
    version : of faultbond
    step : sample time, s
    """

    name: str
    identifier: str
    token: str
    version: str
    step: float


def model_description(fmi: int, title: FmuTitle, variables: Sequence[Variable], sources: Sequence[str]) -> bytes:
    """Give modelDescription.xml.

    Parameters
    ----------
    fmi : 2 or 3
    title : what the FMU is called
    variables : in the order of their numbers, from 1 on
    sources : files that are to be compiled; FMI 3 has them in buildDescription.xml
    """
    root = Element("fmiModelDescription", _head(fmi, title))
    simulation = SubElement(root, "CoSimulation", _abilities(fmi, title))
    if fmi == 2:
        files = SubElement(simulation, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    _add_units(root, variables)
    _add_types(root, fmi, variables)
    SubElement(
        SubElement(root, "LogCategories"), "Category", name="logStatusError", description="why a call is refused"
    )
    SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(title.step))
    _add_variables(root, fmi, variables)
    _add_outputs(root, fmi, variables)
    return _text(root)


def build_description(title: FmuTitle, sources: Sequence[str]) -> bytes:
    """Give buildDescription.xml of FMI 3: which files are compiled, and that they need the library of mathematics."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=title.identifier)
    files = SubElement(build, "SourceFileSet", language="C99")
    for name in sources:
        SubElement(files, "SourceFile", name=name)
    SubElement(build, "Library", name="m", external="true", description="C library of mathematics")
    return _text(root)


def unit_name(unit: Unit | None) -> str:
    """Give the name of the SI unit of a variable whose unit in the model file is this; empty where it has none.

    It is the word of the model file where that is SI itself, as of `Pa*s^2/m^6`.
    """
    dimension = _dimension(unit)
    if unit is None or dimension is None:
        return ""
    return unit.text if (unit.factor, unit.offset) == (1.0, 0.0) else str(dimension)


def _head(fmi: int, title: FmuTitle) -> dict[str, str]:
    token = {2: "guid", 3: "instantiationToken"}[fmi]
    return {
        "fmiVersion": f"{fmi}.0",
        "modelName": title.name,
        token: title.token,
        "description": "watches a plant, detects faults and tells what is wrong",
        "generationTool": f"faultbond {title.version}",
        "variableNamingConvention": "structured",
    }


def _abilities(fmi: int, title: FmuTitle) -> dict[str, str]:
    common = {"modelIdentifier": title.identifier, "canHandleVariableCommunicationStepSize": "true"}
    if fmi == 2:
        own = ("canNotUseMemoryManagementFunctions", "canGetAndSetFMUstate", "canSerializeFMUstate")
        return common | dict.fromkeys(own, "true")
    states = dict.fromkeys(("canGetAndSetFMUState", "canSerializeFMUState"), "true")
    return common | states | {"fixedInternalStepSize": repr(title.step)}


def _dimension(unit: Unit | None) -> Dimension | None:
    """Give the dimension of a unit; None where it is not stated, or is no unit of a quantity."""
    if unit is None or not unit.text:
        return None
    try:
        return measure(unit.text).dimension
    except ModelError:  # logic, say
        return None


def _add_units(root: Element, variables: Sequence[Variable]) -> None:
    """Add each unit once, with those of the model file that it is displayed in."""
    display: dict[str, dict[str, Unit]] = {}
    dimensions: dict[str, Dimension] = {}
    for item in variables:
        name, dimension = unit_name(item.unit), _dimension(item.unit)
        if item.unit is None or dimension is None:
            continue
        dimensions[name] = dimension
        others = display.setdefault(name, {})
        if item.unit.text != name and (item.unit.text not in others or item.unit.offset):
            others[item.unit.text] = item.unit
    definitions = SubElement(root, "UnitDefinitions") if dimensions else root
    for name, dimension in dimensions.items():
        element = SubElement(definitions, "Unit", name=name)
        base = _base(dimension)
        if base is not None:
            SubElement(element, "BaseUnit", base)
        for text, unit in display[name].items():
            offset = {"offset": repr(-unit.offset / unit.factor)} if unit.offset else {}
            SubElement(element, "DisplayUnit", {"name": text, "factor": repr(1.0 / unit.factor), **offset})


def _base(dimension: Dimension) -> dict[str, str] | None:
    """Give the powers of a unit; None where the standard has none for it. A percentage is a number, a hundredth."""
    powers = dict(dimension.powers)
    percent = powers.pop("percent", Fraction(0))
    if any(power.denominator != 1 for power in (*powers.values(), percent)):
        return None
    factor = {"factor": repr(0.01 ** int(percent))} if percent else {}
    return {**{_BASES[base]: str(power) for base, power in powers.items()}, **factor}


def _add_types(root: Element, fmi: int, variables: Sequence[Variable]) -> None:
    """Add each enumeration, under the name of its variable."""
    types = SubElement(root, "TypeDefinitions")
    for item in (one for one in variables if one.sort is Sort.CHOICE):
        name = _type_name(item)
        if fmi == 2:
            parent = SubElement(SubElement(types, "SimpleType", name=name), "Enumeration")
        else:
            parent = SubElement(types, "EnumerationType", name=name)
        for choice in item.choices:
            about = {"description": choice.description} if choice.description else {}
            SubElement(parent, "Item", {"name": choice.name, "value": str(choice.value), **about})


def _type_name(variable: Variable) -> str:
    return f"{variable.name}_words"


def _add_variables(root: Element, fmi: int, variables: Sequence[Variable]) -> None:
    parent = SubElement(root, "ModelVariables")
    if fmi == 3:
        about = {"valueReference": "0", "causality": "independent", "variability": "continuous"}
        SubElement(parent, Sort.REAL.value, {"name": TIME, **about})
    for number, item in enumerate(variables, start=1):
        about = {
            "name": item.name,
            "valueReference": str(number),
            "description": item.description,
            "causality": "input" if item.is_input else "output",
            "variability": "discrete",
            **({} if item.is_input else {"initial": "exact"}),
        }
        if fmi == 2:
            element = SubElement(parent, "ScalarVariable", about)
            SubElement(element, _OF_FMI2.get(item.sort, item.sort.value), {**_type_of(item), "start": _start(item)})
        elif item.sort is Sort.TEXT:
            SubElement(SubElement(parent, item.sort.value, about), "Start", value=_start(item))
        else:
            SubElement(parent, item.sort.value, {**about, **_type_of(item), "start": _start(item)})


def _type_of(variable: Variable) -> Mapping[str, str]:
    """Give the unit of a variable, or the name of its enumeration."""
    if variable.sort is Sort.CHOICE:
        return {"declaredType": _type_name(variable)}
    name = unit_name(variable.unit)
    if variable.unit is None or not name:
        return {}
    return {"unit": name, **({"displayUnit": variable.unit.text} if variable.unit.text != name else {})}


def _start(variable: Variable) -> str:
    """Give the value before the first sample as XML Schema writes it."""
    value = variable.start
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return "NaN" if isnan(value) else repr(value)
    return str(value)


def _add_outputs(root: Element, fmi: int, variables: Sequence[Variable]) -> None:
    """Add the outputs, none of which depends on an input at the same time: a step takes what was told before it."""
    structure = SubElement(root, "ModelStructure")
    parent = SubElement(structure, "Outputs") if fmi == 2 else structure
    for number, item in enumerate(variables, start=1):
        if item.is_input:
            continue
        if fmi == 2:
            SubElement(parent, "Unknown", index=str(number), dependencies="")
        else:
            SubElement(parent, "Output", valueReference=str(number), dependencies="")


def _text(root: Element) -> bytes:
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
