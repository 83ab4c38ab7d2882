"""Which faults show in a model at all, and which can be told apart, by structure alone.

A fault is detectable if its equation is checked by others: if it is in the over-determined part M+ of the model. Fault
f is isolable from g if f is detectable by what does not contain the equation of g. Where the differential equations
`rate = d quantity / dt` may be used in one direction only, M+ is smaller.

Sources: Krysander and Frisk, Sensor placement for fault diagnosis, IEEE Trans. SMC-A 38 (2008). Frisk, Bregon, Aslund,
Krysander, Pulido and Biswas, Diagnosability analysis considering causal interpretations for differential constraints,
IEEE Trans. SMC-A 42 (2012).
"""

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum

import numpy as np

from faultbond.arrays import BoolArray
from faultbond.diagnosability.classes import classes
from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import match, redundant, undetermined


class Interpretation(Enum):
    """How an equation `rate = d quantity / dt` may be used: to integrate, to differentiate, or either way."""

    MIXED = "mixed"
    INTEGRAL = "integral"
    DERIVATIVE = "derivative"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Isolability:
    """What the structure says of the faults of a model; True means yes.

    detectable : bool array, shape (n_faults,)
    isolable : bool array, shape (n_faults, n_faults); [f, g]: f can be told from g; False on the diagonal
    """

    detectable: BoolArray
    isolable: BoolArray


def isolability(model: StructuralModel, interpretation: Interpretation = Interpretation.MIXED) -> Isolability:
    """Give which faults are structurally detectable and which isolable from which.

    Source
    ------
    f is isolable from g if and only if e_f is in (M without e_g)+ (Krysander and Frisk 2008), M+ as the interpretation
    has it (Frisk and others 2012). In mixed causality that is so if e_f is in M+ and not in the class of e_g, so one
    search answers for all faults.
    """
    faults = np.array(model.faults, dtype=np.intp)
    if interpretation is Interpretation.MIXED or not model.differentials:
        label = np.array(classes(model.equations, match(model.equations, model.n_variables)), dtype=np.intp)[faults]
        detectable: BoolArray = label >= 0
        isolable = detectable[:, None] & (label[:, None] != label)
    else:
        # What e_g checks, and what checks it, is in M+, so M+ without e_g is all that need be looked at.
        checked = checked_equations(model, interpretation, range(len(model.equations)))
        detectable = np.array([equation in checked for equation in model.faults], dtype=np.bool_)
        isolable = np.zeros((len(faults), len(faults)), dtype=np.bool_)
        for g, removed in enumerate(model.faults):
            left = checked_equations(model, interpretation, checked - {removed}) if removed in checked else checked
            isolable[:, g] = [equation in left for equation in model.faults]
    detectable.setflags(write=False)
    isolable.setflags(write=False)
    return Isolability(detectable=detectable, isolable=isolable)


def checked_equations(
    model: StructuralModel, interpretation: Interpretation, equations: Collection[int]
) -> frozenset[int]:
    """Give those of some equations of a model that the others check: M+ in an interpretation."""
    chosen = sorted(equations)
    if interpretation is Interpretation.INTEGRAL:
        return _integral(model, chosen)
    if interpretation is Interpretation.DERIVATIVE:
        return _derivative(model, chosen)
    return _mixed(model, chosen)


def _mixed(model: StructuralModel, chosen: list[int]) -> frozenset[int]:
    rows = [model.equations[equation] for equation in chosen]
    return frozenset(chosen[row] for row in redundant(rows, match(rows, model.n_variables)))


def _integral(model: StructuralModel, chosen: list[int]) -> frozenset[int]:
    """Give M+ in integral causality: no rate follows from its quantity, by the algorithm of Frisk and others 2012."""
    quantity_of = {equation: quantity for equation, _, quantity in model.differentials}
    left = _mixed(model, chosen)
    while True:
        # G := G+;  G1 := G without the edges from differential equations to rates
        rows = [(quantity_of[e],) if e in quantity_of else model.equations[e] for e in sorted(left)]
        contained = {variable for equation in left for variable in model.equations[equation]}
        lost = contained & undetermined(rows, model.n_variables, match(rows, model.n_variables))
        # G := G - C(G, X(G1-)), the equations with variables that G1 leaves undetermined;  until there are none
        kept = [equation for equation in left if lost.isdisjoint(model.equations[equation])]
        if len(kept) == len(left):
            return left
        left = _mixed(model, sorted(kept))


def _derivative(model: StructuralModel, chosen: list[int]) -> frozenset[int]:
    """Give M+ in derivative causality: no quantity follows from its rate, by the algorithm of Frisk and others 2012.

    A rate follows once its quantity is known, so a differential equation is never part of an algebraic loop.
    """
    quantity_of = {equation: quantity for equation, _, quantity in model.differentials}
    known: set[int] = set()  # Xc, the variables that can be computed
    while True:
        # Gni := G - Xc, without the differential equations whose quantity is not known
        usable = [e for e in chosen if e not in quantity_of or quantity_of[e] in known]
        rows = [[variable for variable in model.equations[e] if variable not in known] for e in usable]
        contained = {variable for row in rows for variable in row}
        found = contained - undetermined(rows, model.n_variables, match(rows, model.n_variables))
        # Xc := Xc with X(Gni+) and X(Gni0);  until nothing new is found
        if not found:
            return _mixed(model, [e for e in chosen if known.issuperset(model.equations[e])])
        known |= found
