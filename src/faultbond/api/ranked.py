"""A candidate of a diagnosis as people read it: values in the units of the model file, and beside them in SI."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from types import MappingProxyType

from faultbond.contract.findings import Candidate, Diagnosis, Suspect
from faultbond.model.graph import BondGraph, Unit
from faultbond.report.numbers import figure, probability_text
from faultbond.report.suspects import unit_of


@dataclass(frozen=True, slots=True, kw_only=True)
class SuspectValue:
    """A parameter of a candidate, or what is wrong with a sensor or input, such as `flow.bias`.

    nominal, estimate, sd, rate: in `unit`, the rate per second; `_si` is the same in SI. nominal is None where there is
    none, as of the value at which a sensor is stuck; rate of what does not drift.
    """

    name: str
    component: str
    unit: str
    nominal: float | None
    estimate: float
    sd: float
    rate: float | None
    nominal_si: float | None
    estimate_si: float
    sd_si: float
    rate_si: float | None

    def __str__(self) -> str:
        began = "" if self.nominal is None else f"{figure(self.nominal, digits=4).number()} -> "
        return f"{self.name} {began}{figure(self.estimate, self.sd, digits=4).both()} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedCandidate:
    """A tested set of suspects, in the words of the records.

    components: owners of what is suspected. parameters: by name. probability: of this set. group: whether it cannot be
    told from the best. kind: the likeliest kind of fault, to which the values belong; None where there is none, as of
    gates. kinds: all, with their shares. present: False while a fault that comes and goes is gone.
    """

    components: tuple[str, ...]
    parameters: Mapping[str, SuspectValue]
    probability: float
    group: bool
    kind: str | None
    kinds: Mapping[str, float]
    present: bool

    def __str__(self) -> str:
        return f"{self.words}, {probability_text(self.probability)} %"

    def _repr_html_(self) -> str:
        return table_html([self], 1, is_contradicted=False)

    @property
    def words(self) -> str:
        """What is suspected, and its values."""
        values = ", ".join(map(str, self.parameters.values()))
        return " and ".join(self.components) + (f": {values}" if values else "")


def ranked(diagnosis: Diagnosis | None, graph: BondGraph | None) -> tuple[RankedCandidate, ...]:
    """Give the candidates of a diagnosis, best first; none without one. graph: tells the units."""
    return tuple(_ranked(item, graph) for item in diagnosis.candidates) if diagnosis is not None else ()


def _ranked(candidate: Candidate, graph: BondGraph | None) -> RankedCandidate:
    return RankedCandidate(
        components=candidate.components,
        parameters=MappingProxyType({item.parameter: _value(item, graph) for item in candidate.suspects}),
        probability=candidate.probability,
        group=candidate.group,
        kind=candidate.kind.value if candidate.kinds else None,
        kinds=MappingProxyType({kind.value: share for kind, share in candidate.kinds}),
        present=candidate.present,
    )


def _value(suspect: Suspect, graph: BondGraph | None) -> SuspectValue:
    unit = Unit("") if graph is None else unit_of(graph, suspect.parameter)
    return SuspectValue(
        name=suspect.parameter,
        component=suspect.component,
        unit=unit.text,
        nominal=None if suspect.nominal is None else unit.from_si(suspect.nominal),
        estimate=unit.from_si(suspect.estimate),
        sd=unit.difference_from_si(suspect.sd),
        rate=None if suspect.rate is None else unit.difference_from_si(suspect.rate),
        nominal_si=suspect.nominal,
        estimate_si=suspect.estimate,
        sd_si=suspect.sd,
        rate_si=suspect.rate,
    )


def table_html(candidates: Sequence[RankedCandidate], most: int, *, is_contradicted: bool) -> str:
    """Give the first candidates as a table of HTML; where the data contradict all of them, none is told as likely."""
    rows = "".join(
        f"<tr><td>{escape(' + '.join(item.components))}</td>"
        f"<td>{'<br>'.join(escape(str(value)) for value in item.parameters.values())}</td>"
        f"<td>{escape(item.kind or '')}</td>"
        f"<td>{'' if is_contradicted else probability_text(item.probability)}</td></tr>"
        for item in candidates[:most]
    )
    left = f"<p>... and {len(candidates) - most} more</p>" if len(candidates) > most else ""
    head = f"<tr><th>component</th><th>parameter</th><th>kind</th><th>{'' if is_contradicted else '%'}</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>{left}" if candidates else ""
