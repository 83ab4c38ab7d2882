"""The one door to the thesis: its method `classic` as a watcher, and its search for a route, step by step."""

from dataclasses import replace

import numpy as np

from faultbond.algebra.routes.questions import parameters
from faultbond.app.method_face import Numbers, Watcher
from faultbond.arrays import BoolArray
from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.contract.json_records import Record
from faultbond.contract.samples import Reports, Samples
from faultbond.contract.spec import EngineSpec
from faultbond.equations.component_network import ComponentNetwork, frame_name
from faultbond.errors import ModelError, StructureError
from faultbond.model.graph import BondGraph
from faultbond.runtime.allowed import fitting
from faultbond.thesis.offline.build import build_classic
from faultbond.thesis.online import decision, rule, watch
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.ranking import current_limits
from faultbond.thesis.online.state import ALLOWED, ClassicState, init
from faultbond.thesis.search import RouteSearch, search_route
from faultbond.thesis.trace import trace_lines


def build_classic_watcher(graph: BondGraph, saved: Numbers | None = None) -> Watcher:
    """Give the method at work on a plant, at its beginning, or as it was saved.

    Raises
    ------
    ModelError
        Where the model, or a sensor, does not always hold.
    StructureError
        Where no parameter is a suspect.
    """
    if graph.conditions:
        raise ModelError(f"{graph.file}: method `classic` knows no `valid_when`; use method `bank`")
    spec, plan = build_classic(graph)
    if not plan.tested:
        raise StructureError(f"{graph.file}: method `classic` tests sets of parameters, and none is a suspect")
    return Classic(spec, plan, saved)


class Classic:
    """The method `classic`, that of the thesis.

    Parameters
    ----------
    spec, plan : the model
    saved : what another watcher saved; None begins anew
    """

    def __init__(self, spec: EngineSpec, plan: ClassicPlan, saved: Numbers | None = None) -> None:
        self.spec = spec
        self.title = f"the thesis' algorithms, {len(plan.formulas)} functions"
        self.asleep, self.lag = plan.delay + plan.depth + spec.thresholds.warm_up_samples, plan.delay
        self.in_use: BoolArray = np.ones(len(spec.outputs), dtype=bool)
        self._plan = plan
        self._told: Diagnosis | None = None
        fresh = init(spec, plan)
        self._state = fresh if saved is None else ClassicState.restore(fitting(fresh.save(), saved, ALLOWED))

    def resume(self) -> None:
        """Expect a sample after a time of unknown length."""
        self._state = decision.after_pause(self._state)

    def take(self, samples: Samples) -> Reports:
        """Take the first of some samples; the statistic is that part of its limit which it is of the bank's."""
        self._state, report = watch.step(self.spec, self._plan, self._state, samples.first)
        limits = current_limits(self.spec, self._plan, self._state)
        self._told = report.diagnosis
        return replace(report, cusum=report.cusum / limits * self.spec.thresholds.cusum_limit).alone

    def finish(self) -> Diagnosis | None:
        """Give the last diagnosis, if a fault was detected."""
        return watch.finish(self.spec, self._plan, self._state)

    def sure(self, level: float) -> int | None:
        """Tell the rule of the diagnosis that was due, and give the hypothesis that it accepts now; None: none yet."""
        if self._told is None:
            return None
        self._state, hypothesis = rule.take_diagnosis(self._state, self._told, level)
        return hypothesis

    def accept(self, hypothesis: int, *, repaired: bool = False) -> Candidate:
        """Take a hypothesis as the new healthy model, or as repaired, and give the candidate as it stood."""
        self._state, candidate = decision.accept(self.spec, self._plan, self._state, hypothesis, repaired=repaired)
        return candidate

    def reject(self, hypothesis: int) -> Candidate:
        """Rule a hypothesis out, and give the candidate as it stood."""
        self._state, candidate = decision.reject(self.spec, self._plan, self._state, hypothesis)
        return candidate

    def save(self) -> Numbers:
        """Give what is remembered, by name."""
        return self._state.save()


def trace_of(graph: BondGraph, network: ComponentNetwork, names: tuple[str, ...]) -> tuple[list[str], Record]:
    """Search the shortest route to a set of parameters as the thesis does; give its lines and its record."""
    found = search_route(network, parameters(network, names))
    return list(trace_lines(found)), _trace_record(graph, found)


def _trace_record(graph: BondGraph, found: RouteSearch) -> Record:
    """Give the course of the thesis' search."""
    route = found.route
    return {
        "record": "trace",
        "model": graph.name,
        "targets": [item if isinstance(item, str) else frame_name(item) for item in found.question.targets],
        "ending": found.ending.value,
        "expanded": found.expanded,
        "distinct": found.distinct,
        "steps": [frame_name((step.equation, step.frame)) for step in route.steps] if route is not None else None,
        "observations": route.observations if route is not None else None,
    }
