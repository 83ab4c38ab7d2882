"""The motor with other sets of suspects: all tested, or many in reserve of which few or none get lanes."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import pytest

from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.runtime.core import Core
from faultbond.synthesis.engine import build_core
from made import graph_of, spec_of

GRAPH, MOTOR = graph_of("dc_motor_current"), spec_of("dc_motor_current")
SINGLES = tuple((k,) for k in range(5))
PAIRS, TRIPLES = tuple(combinations(range(5), 2)), tuple(combinations(range(5), 3))
WHOLE = replace(MOTOR, hypotheses=(*SINGLES, *PAIRS, *TRIPLES), reserve=())
WAITING = replace(MOTOR, hypotheses=(*SINGLES, *PAIRS), reserve=TRIPLES, coupled=False)
FEW = replace(MOTOR, hypotheses=SINGLES, reserve=(*PAIRS, *TRIPLES), coupled=False)


@cache
def core_of(spec: EngineSpec, grown: int = 0) -> Core:
    """The core of the motor with these sets, of whose reserve so many get lanes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("faultbond.contract.reserve.GROWN", grown)
        return build_core(build_plant(GRAPH), spec)
