"""When a model, or one of its sensors, holds: conditions on inputs and constants.

Inputs alone say in which state a plant is: what is judged must not say when it is. A reading would leave out those rows
in which its noise is on one side, and a fault that moves it would switch off what is to find it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from faultbond.errors import ModelError
from faultbond.model.blocks import BlockReader
from faultbond.model.dimensions import Checker, Demand
from faultbond.model.expression import JOINS, TABLE, Binary, Call, Expression, names, walk
from faultbond.model.graph import BondGraph, Input, Validity
from faultbond.model.keys import VALID_KEYS
from faultbond.model.laws import LawReader, check_finite
from faultbond.model.parser import constant_value, parse_condition, to_text
from faultbond.model.source import closest, shown
from faultbond.model.spot import Spot


class ValidityReader:
    """Reads `valid_when`.

    Parameters
    ----------
    laws : of the model, which knows its names
    sensors : names of its sensors

    demands : of dimensions, which grow with what is read
    """

    def __init__(self, laws: LawReader | BlockReader, sensors: frozenset[str]) -> None:
        self._laws, self._sensors = laws, sensors
        self._inputs: Mapping[str, Input] = {item.name: item for item in laws.values.inputs}
        self.demands: list[Demand] = []

    def read(self, place: Spot) -> Validity:
        """Read when the model, or a sensor, holds.

        Raises
        ------
        ModelError
            where it is no condition, or names anything but inputs and constants.
        """
        fields = place.fields(VALID_KEYS)
        when = fields["when"]
        where = when.where(": ")
        condition = parse_condition(when.text(), where)
        used = names(condition)
        for name in used:
            if name not in self._inputs and name not in {item.name for item in self._laws.values.constants}:
                raise ModelError(where + self._refused(name))
        if not any(name in self._inputs for name in used):
            problem = f"`{shown(to_text(condition))}` is the same in every row, since it names no input"
            raise ModelError(f"{where}{problem}; name one, such as `{next(iter(self._inputs), 'mode')} == 1`")
        if any(isinstance(item, Call) and item.function.startswith(TABLE) for item in walk(condition)):
            raise ModelError(f"{where}a condition has no `table`; compare what goes into it")
        for item in _comparisons(condition):
            check_finite(item.left, self._laws.values.nominals, where)
            check_finite(item.right, self._laws.values.nominals, where)
            self._check_number(item, where)
            self.demands.append(partial(Checker.law, left=item.left, right=item.right, where=where))
        settling = 0.0
        if "settling" in fields:
            settling = fields["settling"].seconds()
            if settling < 0.0:
                raise fields["settling"].error(" is a time of 0 or more, such as `30 s`")
        return Validity(condition=condition, settling=settling)

    def _refused(self, name: str) -> str:
        if name in self._sensors:
            advice = f"state it once more under inputs, `{name}_state: {{column: {name}}}`"
            problem = f"`{name}` is a sensor, and a fault that moves it would switch off what is to find it"
            return f"{problem}; name an input. If its column tells in which state the plant is, {advice}"
        if self._laws.is_signal(name):
            return f"`{name}` is a signal of the model, which is not known where the model does not hold; name an input"
        if name in self._laws.values.measures:
            return f"`{name}` is a parameter, which a fault may change; name an input, or state a constant"
        near = closest(name, [*self._inputs, *(item.name for item in self._laws.values.constants)])
        return f"unknown name `{shown(name)}`; {near or 'state its column under inputs'}"

    def _check_number(self, item: Binary, where: str) -> None:
        """Refuse a number beside an input that has another unit than SI: it would not be taken in that."""
        for number, other in ((item.left, item.right), (item.right, item.left)):
            value = constant_value(number)
            if value is None:
                continue
            for name in names(other):
                unit = self._inputs[name].unit if name in self._inputs else None
                if unit is not None and ((value != 0.0 and unit.factor != 1.0) or unit.offset != 0.0):
                    problem = f"{name} is in {unit.text}, but numbers in conditions are SI, as in laws"
                    example = f"`limit: {value:g} {unit.text}`"
                    raise ModelError(f"{where}{problem}; state the number under constants, {example}, and name that")


def _comparisons(condition: Expression) -> Iterator[Binary]:
    """Give the comparisons that a condition joins."""
    if isinstance(condition, Binary) and condition.operator in JOINS:
        yield from _comparisons(condition.left)
        yield from _comparisons(condition.right)
    elif isinstance(condition, Binary):
        yield condition


def without_states(graph: BondGraph) -> BondGraph:
    """Give the same plant as if it always held, as for an analysis that is of no recording."""
    sensors = tuple(replace(item, valid_when=None) for item in graph.sensors)
    return replace(graph, valid_when=None, sensors=sensors)


def trust_states(graph: BondGraph) -> BondGraph:
    """Give the same plant with inputs trusted that only say in which state it is, since no reading tells of them."""
    stated = graph.conditions
    saying = {name for item in stated for name in names(item.condition)} - graph.acting_inputs
    inputs = tuple(replace(item, suspect=False) if item.name in saying else item for item in graph.inputs)
    return replace(graph, inputs=inputs)
