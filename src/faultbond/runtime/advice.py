"""What to do next: the check that would tell most about which candidate is right, for its cost.

A check parts the candidates in groups that would still be together after it. What it is expected to tell is the entropy
of the groups' probabilities, in bits. Looking at a part separates the candidates that hold it from the others. A
measurement by hand, and a move of an input, separate candidates that predict different values: their lanes are run on,
without measurements, under the inputs that the move would bring.
Source: de Kleer and Williams, Artificial Intelligence 32 (1987) 97 (probing by expected entropy).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Advice, Candidate, Diagnosis
from faultbond.contract.spec import CheckSpec, Engine, EngineSpec
from faultbond.runtime.monitor import Monitor
from faultbond.types import CheckKind

AHEAD = 300  # samples for which candidates are predicted under a move
MOVES = (0.2, 0.4, 0.6)  # of an input, in its largest value or 100 percent, where the model file gives no move
LEAST = 0.01  # probability below which a candidate is left out
MOST = 8  # candidates looked at
APART = 1.5  # standard deviations by which predictions have to differ
WORTH = 0.1  # bits that a check has to tell; a move, more than waiting would

Probe = Callable[[FloatArray, FloatArray], FloatArray]  # (lane, inputs) -> values of the signals measured by hand, SI


@dataclass(frozen=True, slots=True, eq=False)
class _Inputs:
    """Where the inputs stand, and have been; (n_inputs,) each, SI."""

    held: FloatArray
    lowest: FloatArray
    highest: FloatArray

    @property
    def peak(self) -> FloatArray:
        """Largest size of each input; 0 where none was seen."""
        return np.where(self.lowest <= self.highest, np.maximum(np.abs(self.lowest), np.abs(self.highest)), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rival:
    """A candidate, its lane, and the engine that runs it."""

    candidate: Candidate
    probability: float
    lane: FloatArray
    engine: Engine


def advise(monitor: Monitor, diagnosis: Diagnosis, probe: Probe | None = None) -> tuple[Advice, ...]:
    """Give what to do next, the best for its cost first; nothing while one candidate stands alone.

    Parameters
    ----------
    monitor : after the sample of the diagnosis
    diagnosis : the candidates
    probe : gives what each candidate expects of the signals that the model file lists as checks; None: there are none
    """
    spec, rivals = monitor.spec, _rivals(monitor, diagnosis)
    if len(rivals) < 2:
        return ()
    inputs = _Inputs(*(monitor.numbers(f"inputs.{name}") for name in ("held", "lowest", "highest")))
    found = [*_looks(spec, rivals), *_moves(spec, inputs, rivals)]
    if probe is not None:
        found += _measurements(spec, inputs, rivals, probe)
    return tuple(sorted(found, key=lambda item: (-item.gain / max(item.cost, 1e-9), item.target)))


def _rivals(monitor: Monitor, diagnosis: Diagnosis) -> list[_Rival]:
    """Give the candidates that matter, with probabilities that add up to 1."""
    kept = [item for item in diagnosis.candidates[:MOST] if item.probability >= LEAST]
    total = sum(item.probability for item in kept)
    rivals = []
    for item in kept:
        lane, core = monitor.lane(item.lane), monitor.core
        plain = len(lane) == monitor.spec.n_numbers
        rivals.append(
            _Rival(candidate=item, probability=item.probability / total, lane=lane, engine=core if plain else core.slot)
        )
    return rivals


def _looks(spec: EngineSpec, rivals: Sequence[_Rival]) -> Iterator[Advice]:
    """Looking at one part tells whether it is among the faulty ones."""
    costs = {item.name: item.cost for item in spec.checks if item.kind is CheckKind.COMPONENT}
    for part in dict.fromkeys(name for rival in rivals for name in rival.candidate.components):
        with_it = [k for k, rival in enumerate(rivals) if part in rival.candidate.components]
        without = [k for k in range(len(rivals)) if k not in with_it]
        yield from _advice(rivals, [with_it, without], CheckKind.COMPONENT, part, costs.get(part, 1.0))


def _moves(spec: EngineSpec, inputs: _Inputs, rivals: Sequence[_Rival]) -> Iterator[Advice]:
    """Moving an input lets candidates go apart that agree now."""
    step = spec.sample_time or 1.0
    waited = _entropy(rivals, _told_apart(spec, rivals, _ahead(spec, inputs, inputs.held)))
    listed = {item.name: item for item in spec.checks if item.kind is CheckKind.INPUT}
    for k, item in enumerate(spec.inputs):
        check = listed.get(item.name)
        moves = []
        for value in _values(spec, inputs, k, check):
            held = inputs.held.copy()
            held[k] = value
            groups = _told_apart(spec, rivals, _ahead(spec, inputs, held))
            cost = 1.0 if check is None else check.cost
            moves += _advice(
                rivals, groups, CheckKind.INPUT, item.name, cost, value=value, within=AHEAD * step, least=waited + WORTH
            )
        yield from sorted(moves, key=lambda move: -round(move.gain, 2))[:1]


def _values(spec: EngineSpec, inputs: _Inputs, index: int, check: CheckSpec | None) -> list[float]:
    """Give the values to which an input may be moved, the nearest first: up and down, not beyond where it has been.

    Zero counts as a place where it has been, but for that of degC, which is no special one. Percentages may go from 0
    to 100; how far a stated move may go is left to whoever stated it.
    """
    item, now = spec.inputs[index], float(inputs.held[index])
    low, high = float(inputs.lowest[index]), float(inputs.highest[index])
    full = high - low
    if not item.unit_offset:
        low, high, full = min(low, 0.0), max(high, 0.0), float(inputs.peak[index])
    if item.percent:
        low, high, full = 0.0, 100.0, 100.0
    sizes = [part * full for part in MOVES]
    if check is not None and check.move is not None:
        sizes = [check.move]
        low, high = (low, high) if item.percent else (-np.inf, np.inf)
    wanted = dict.fromkeys(float(np.clip(now + sign * size, low, high)) for size in sizes for sign in (1.0, -1.0))
    return [value for value in wanted if abs(value - now) > 0.5 * sizes[0] > 0.0]


def _ahead(spec: EngineSpec, inputs: _Inputs, held: FloatArray) -> FloatArray:
    """Give samples without measurements under held inputs; what settles first is not counted."""
    fields, step = spec.sample_fields, spec.sample_time or 1.0
    samples = np.zeros((AHEAD, spec.n_sample))
    samples[:, fields["dt"]] = step
    samples[:, fields["u"]] = samples[:, fields["u_before"]] = held
    samples[0, fields["u_before"]] = inputs.held
    samples[:, fields["scale"]] = 1.0
    samples[:, fields["again"]] = 1.0
    settling = np.array([item.settling for item in spec.inputs])
    moved = np.where(held != inputs.held, settling, 0.0)
    for j, output in enumerate(spec.outputs):
        blank = max((float(moved[i]) for i in output.direct_inputs), default=0.0)
        samples[: int(np.ceil(blank / step)), fields["scale"].start + j] = spec.thresholds.blank_factor
    return samples


def _told_apart(spec: EngineSpec, rivals: Sequence[_Rival], samples: FloatArray) -> list[list[int]]:
    """Give the groups of candidates whose predictions do not come apart."""
    n_y = len(spec.outputs)
    means, variances = [], []
    for rival in rivals:
        _, innovations = rival.engine.advance(rival.lane[:, None], samples)
        means.append(-innovations[:, :n_y, 0])
        variances.append(innovations[:, n_y:, 0])
    noise = spec.output_noise**2 * samples[:, spec.sample_fields["scale"]]
    return _groups(len(rivals), lambda i, j: _separation(means[i] - means[j], variances[i] + variances[j], noise))


def _separation(apart: FloatArray, variance: FloatArray, noise: FloatArray) -> float:
    """Give how far apart two predictions are, in standard deviations.

    The predictions' own uncertainty, which is what `variance` is beyond twice the noise, is taken as wholly correlated
    in time, in the direction of the difference.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        scaled = np.nan_to_num(apart / np.sqrt(noise), nan=0.0, posinf=1e6, neginf=-1e6)
        own = np.nan_to_num(np.sqrt(np.maximum(variance / noise - 2.0, 0.0)), nan=1e6, posinf=1e6)
    size = float(np.linalg.norm(scaled))
    if size == 0.0:
        return 0.0
    along = float(np.sum(np.abs(scaled) * own)) / size
    return size / float(np.sqrt(1.0 + along**2))


def _measurements(spec: EngineSpec, inputs: _Inputs, rivals: Sequence[_Rival], probe: Probe) -> Iterator[Advice]:
    """Measuring a signal by hand tells candidates apart that expect different values of it."""
    values = np.stack([probe(rival.lane, inputs.held) for rival in rivals])
    signals = [item for item in spec.checks if item.kind is CheckKind.SIGNAL]
    for k, item in enumerate(signals):
        scaled = (values[:, k] / max(item.noise, 1e-300)).tolist()
        groups = _groups(len(rivals), partial(_apart, scaled))
        yield from _advice(rivals, groups, CheckKind.SIGNAL, item.name, item.cost)


def _apart(values: Sequence[float], i: int, j: int) -> float:
    return abs(values[i] - values[j])


def _groups(count: int, separation: Callable[[int, int], float]) -> list[list[int]]:
    """Give groups in which each member is close to another one."""
    groups: list[list[int]] = []
    for k in range(count):
        near = [group for group in groups if any(not separation(k, other) >= APART for other in group)]
        groups = [group for group in groups if group not in near] + [[*(m for group in near for m in group), k]]
    return groups


def _entropy(rivals: Sequence[_Rival], groups: Sequence[Sequence[int]]) -> float:
    """Give what it tells to know the group of the right candidate, in bits."""
    parts = np.array([sum(rivals[k].probability for k in group) for group in groups])
    parts = parts[parts > 0.0]
    return float(-np.sum(parts * np.log2(parts)))


def _advice(
    rivals: Sequence[_Rival],
    groups: Sequence[Sequence[int]],
    kind: CheckKind,
    target: str,
    cost: float,
    *,
    value: float | None = None,
    within: float | None = None,
    least: float = WORTH,
) -> list[Advice]:
    """Give the advice, if it tells enough."""
    gain = _entropy(rivals, groups)
    if gain < least:
        return []
    names = tuple(tuple(rivals[k].candidate.components for k in sorted(group)) for group in groups if group)
    return [Advice(kind=kind, target=target, gain=gain, cost=cost, separates=names, value=value, within=within)]
