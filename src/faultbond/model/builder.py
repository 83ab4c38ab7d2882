"""A plant in Python: the same words, checks and result as the model file, so that four equal tanks are a loop."""

from collections.abc import Mapping, Sequence
from typing import Self

from faultbond.model.graph import BondGraph
from faultbond.model.resolve import resolve
from faultbond.model.source import Entry, Items, Node, Source, Table, Text, shown
from faultbond.model.words import stated_node

Scalar = str | float | bool
Fields = Mapping[str, "Scalar | Sequence[Scalar] | Fields | None"]


class ModelBuilder:
    """Collects the parts of a plant; `build` checks them.

    Every text is written as in the model file, `64650 Pa`. A number alone is taken as a number without unit.

    Parameters
    ----------
    name : the model's name, which starts every error message
    sample_time : `1 s`, or `variable`, or `none` for a static block network
    max_faults, accuracy, warm_up, time, time_between_false_alarms, false_alarms, instrument_faults, valid_when,
    row_time : as in the model file; None leaves the default in force

    Example
    -------
    >>> tank = ModelBuilder("tank", sample_time="1 s")
    >>> graph = (
    ...     tank.input("Q", unit="m^3/s")
    ...     .component("pump", "Sf", law="f = Q")
    ...     .component("vessel", "C", law="e = q/A", parameters={"A": "2 m^2"})
    ...     .bond("pump -> vessel")
    ...     .sensor("level", "vessel.e", unit="m", noise="1 cm")
    ...     .build()
    ... )
    >>> graph.parameter("A").nominal
    2.0
    """

    def __init__(
        self,
        name: str,
        *,
        sample_time: Scalar,
        max_faults: int | None = None,
        accuracy: Scalar | None = None,
        warm_up: Scalar | None = None,
        time: Scalar | Fields | None = None,
        time_between_false_alarms: Scalar | None = None,
        false_alarms: int | None = None,
        instrument_faults: bool | None = None,
        valid_when: Scalar | Fields | None = None,
        row_time: Scalar | None = None,
    ) -> None:
        self._source = Source(f"model {shown(str(name))}", has_lines=False)
        settings = {"sample_time": sample_time, "max_faults": max_faults, "accuracy": accuracy, "warm_up": warm_up}
        settings |= {"time_between_false_alarms": time_between_false_alarms, "instrument_faults": instrument_faults}
        self._settings: Fields = {
            "name": name,
            **settings,
            "false_alarms": false_alarms,
            "time": time,
            "valid_when": valid_when,
            "row_time": row_time,
        }
        self._sections: dict[str, dict[str, Node]] = {}
        self._bonds: list[Text] = []

    def constant(self, name: str, value: Scalar) -> Self:
        """Add a trusted number, never a suspect."""
        return self._add("constants", name, value)

    def correlation(self, one: str, other: str, value: float) -> Self:
        """Add how what is not known of two healthy parameters goes together, from -1 to 1."""
        row = self._sections.setdefault("correlations", {})
        stated = row.get(one)
        entries = stated.entries if isinstance(stated, Table) else ()
        row[one] = Table((*entries, Entry(other, stated_node(value, f"correlation of {shown(one)}", self._source))))
        return self

    def table(
        self,
        name: str,
        *,
        points: Sequence[Sequence[Scalar]] | None = None,
        file: str | None = None,
        x: str | None = None,
        y: str | None = None,
        between: str | None = None,
        beyond: str | None = None,
    ) -> Self:
        """Add a measured curve, for `table(x, NAME)` in laws."""
        fields = {"points": points, "file": file, "x": x, "y": y, "between": between, "beyond": beyond}
        return self._add("tables", name, fields)

    def input(
        self,
        name: str,
        *,
        unit: str | None = None,
        column: str | None = None,
        noise: Scalar | None = None,
        noise_of: str | None = None,
        settling: Scalar | None = None,
        hold: str | None = None,
        lag: Scalar | Fields | None = None,
        rate_limit: Scalar | Fields | None = None,
        range: Scalar | Sequence[Scalar] | None = None,
        unknown: str | None = None,
        usual: Scalar | None = None,
        suspect: bool | None = None,
        healthy_bias: Scalar | None = None,
        fitted_range: Sequence[Scalar] | None = None,
    ) -> Self:
        """Add a measured or commanded input, or one that nobody measures: `unknown`."""
        fields: Fields = {"unit": unit, "column": column, "noise": noise, "settling": settling, "hold": hold}
        fields = {**fields, "noise_of": noise_of, "lag": lag, "rate_limit": rate_limit, "range": range}
        found = {
            "unknown": unknown,
            "usual": usual,
            "suspect": suspect,
            "healthy_bias": healthy_bias,
            "fitted_range": fitted_range,
        }
        return self._add("inputs", name, {**fields, **found})

    def component(
        self,
        name: str,
        type: str,
        *,
        law: str | Sequence[str] | None = None,
        parameters: Mapping[str, Scalar | Fields] | None = None,
        start: Mapping[str, Scalar] | None = None,
    ) -> Self:
        """Add an element, its law (two for TF and GY) and the parameters that it owns."""
        return self._add("components", name, {"type": type, "law": law, "parameters": parameters, "start": start})

    def block(
        self,
        name: str,
        law: str | Sequence[str],
        *,
        parameters: Mapping[str, Scalar | Fields] | None = None,
        signals: Sequence[str] | None = None,
        start: Mapping[str, Scalar] | None = None,
        suspect: bool | None = None,
    ) -> Self:
        """Add a block: its laws, `y = K*x`, the parameters that it owns, and unknowns that no law defines."""
        fields: Fields = {"law": law, "parameters": parameters, "signals": signals, "start": start, "suspect": suspect}
        return self._add("blocks", name, fields)

    def junction(self, name: str, type: Scalar) -> Self:
        """Add a 0- or 1-junction."""
        return self._add("junctions", name, type)

    def bond(self, chain: str) -> Self:
        """Add the bonds of a chain `a -> b -> c`; power counts positive along the arrows."""
        self._bonds.append(Text(str(chain)))
        return self

    def sensor(
        self,
        name: str,
        reads: str,
        *,
        noise: Scalar | None = None,
        unit: str | None = None,
        lag: Scalar | Fields | None = None,
        column: str | None = None,
        range: Scalar | Sequence[Scalar] | None = None,
        suspect: bool | None = None,
        valid_when: Scalar | Fields | None = None,
        healthy_bias: Scalar | None = None,
        fitted_range: Sequence[Scalar] | None = None,
    ) -> Self:
        """Add a measured output: a law of signals, and the standard deviation of its noise (static networks: 0)."""
        fields: Fields = {"reads": reads, "unit": unit, "noise": noise, "lag": lag, "column": column}
        fields = {**fields, "range": range, "suspect": suspect, "valid_when": valid_when}
        fitted = {"healthy_bias": healthy_bias, "fitted_range": fitted_range}
        return self._add("sensors", name, {**fields, **fitted})

    def slow_error(
        self,
        target: str,
        size: Scalar,
        *,
        after: Sequence[str] | None = None,
        each: Scalar | Sequence[Scalar] | None = None,
    ) -> Self:
        """Add a known imperfection of a signal or sensor, `2 % over 600 s`."""
        return self._add("slow_error", target, {"size": size, "after": after, "each": each})

    def check(
        self,
        name: str,
        *,
        cost: Scalar | None = None,
        move: Scalar | None = None,
        reads: str | None = None,
        unit: str | None = None,
        noise: Scalar | None = None,
    ) -> Self:
        """Add what can be checked by hand: a component, an input (`move`), or under a new name a signal (`reads`)."""
        return self._add("checks", name, {"cost": cost, "move": move, "reads": reads, "unit": unit, "noise": noise})

    def build(self) -> BondGraph:
        """Give the checked bond graph.

        Raises
        ------
        ModelError
            at the first thing that is not a complete, consistent model; the message starts with `model NAME: `.
        """
        entries = [
            Entry(key, stated_node(value, key, self._source))
            for key, value in self._settings.items()
            if value is not None
        ]
        for key, section in self._sections.items():
            entries.append(Entry(key, Table(tuple(Entry(name, value) for name, value in section.items()))))
        if self._bonds or "blocks" not in self._sections:
            entries.append(Entry("bonds", Items(tuple(self._bonds))))
        return resolve(Table(tuple(entries)), self._source, "model")

    def _add(self, section: str, name: str, value: object) -> Self:
        table = self._sections.setdefault(section, {})
        if name in table:
            raise self._source.error(0, f"{section}: `{shown(str(name))}` is added twice; choose another name")
        table[str(name)] = stated_node(value, f"{section}: {shown(str(name))}", self._source)
        return self
