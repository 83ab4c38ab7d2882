"""What a model decides of the on-line part, as tables in C: suspects, hypotheses, lanes and where they start, settings.

What each table means stands where the core uses it; numbers are in SI, or in factors where `EngineSpec` has them so.
"""

from collections.abc import Iterable, Sequence
from textwrap import fill

import numpy as np

from faultbond.contract.couples import PER_COUPLE, n_coupled, plan_couples
from faultbond.contract.familiar import familiar_range
from faultbond.contract.findings import MAX_CANDIDATES, MOST_RIVALS
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.reserve import PER_SET, extensions, n_grown
from faultbond.contract.slots import BIASES, INPUT_BIASES, NOISES, plan_slots
from faultbond.contract.spec import EngineSpec, Thresholds
from faultbond.synthesis.emit import literal
from faultbond.types import SURE, CheckKind, FaultKind

_WIDTH = 118  # columns of a line of C


def plan_sizes(spec: EngineSpec) -> dict[str, int | str]:
    """Give the sizes and settings, by the names of their macros."""
    settings = spec.thresholds
    return {
        **{f"KIND_{kind.name}": k for k, kind in enumerate(FaultKind)},
        "N_KINDS": len(FaultKind),
        **{f"CHECK_{kind.name}": k for k, kind in enumerate(CheckKind)},
        "N_PARTS": len(spec.parts),
        "N_SIGNALS": len(spec.checked(CheckKind.SIGNAL)),
        "N_SETS": len(spec.hypotheses),
        "N_INSTRUMENTS": len(spec.instruments),
        "N_RESERVE": len(spec.reserve),
        "N_GROWN": n_grown(spec),
        "PER_SET": PER_SET,
        "N_MIXED": len(spec.mixed),
        "N_BOTH": len(spec.both),
        "N_COUPLES": len(plan_couples(spec)),
        "MOST_MIXED": n_coupled(spec)[0],
        "MOST_BOTH": n_coupled(spec)[1],
        "N_COUPLED": sum(n_coupled(spec)),
        "PER_COUPLE": PER_COUPLE,
        "LARGEST_SET": max(map(len, (*spec.hypotheses, *spec.reserve, *spec.mixed, *spec.both)), default=1),
        "MOST_LIMITS": max((len(item.limits) for item in spec.parameters), default=0),
        "N_PLANNED": plan_lanes(spec).n_lanes,
        "N_SINGLE_LANES": int(np.sum(plan_lanes(spec).sizes[plan_lanes(spec).hypothesis] == 1)),
        "N_SLOT_LANES": plan_slots(spec).n_lanes,
        "RAMPED": plan_slots(spec).ramped,
        "SWITCHED": plan_slots(spec).switched,
        "STEPS_LAG": int(any(lane.lag > 0.0 for lane in plan_slots(spec).lanes)),
        "DRIFTS_KEEP": int(any(lane.keeps for lane in plan_slots(spec).lanes)),
        "SAMPLE_TIME": literal(spec.sample_time or 0.0),
        **sum_settings(settings),
        "LEARNING_BOUND": literal(settings.learning_bound),
        "BANK_BOUND": literal(settings.bank_bound),
        "WILDEST": literal(settings.bank_bound**2),
        "GROUP_NATS": literal(settings.group_nats),
        "BLANK_FACTOR": literal(settings.blank_factor),
        "WARM_UP_SAMPLES": settings.warm_up_samples,
        "FALSE_ALARMS": spec.false_alarms,
        "HISTORY_SAMPLES": settings.history_samples,
        "MOST_NOISES": len(NOISES),
        "INPUT_CHANGE": literal(INPUT_BIASES[-1]),
        "OUTPUT_CHANGE": literal(BIASES[-1]),
        "MAX_CANDIDATES": MAX_CANDIDATES,
        "MOST_RIVALS": MOST_RIVALS,
        "SURE": literal(SURE),
        **({"TIED": 1} if spec.correlations else {}),
    }


def sum_settings(settings: Thresholds) -> dict[str, str]:
    """Give the drifts and limits of the sums of the detector."""
    return {
        "CUSUM_DRIFT": literal(settings.cusum_drift),
        "CUSUM_LIMIT": literal(settings.cusum_limit),
        "CUSUM_CLIP": literal(settings.cusum_clip),
        "FAST_DRIFT": literal(settings.fast_drift),
        "FAST_LIMIT": literal(settings.fast_limit),
        "SCATTER_RATIO": literal(settings.scatter_ratio),
        "SCATTER_LIMIT": literal(settings.scatter_limit),
    }


def plan_tables(spec: EngineSpec) -> Iterable[str]:
    """Give the tables, one definition each."""
    yield from _plant_tables(spec)
    yield from _hypothesis_tables(spec)
    yield from _lane_tables(spec)
    yield from _slot_tables(spec)
    yield from _couple_tables(spec)
    yield from _check_tables(spec)


def _plant_tables(spec: EngineSpec) -> Iterable[str]:
    yield numbers("START_MEAN", (item.start_mean for item in spec.states))
    yield numbers("START_SD", (np.nan if item.start_sd is None else item.start_sd for item in spec.states))
    yield numbers("STATE_USUAL", (item.usual for item in spec.states))
    yield numbers("STATE_REACH", (item.reach for item in spec.states))
    yield integers("START_INPUT", (item.follows for item in spec.states))
    yield numbers("STATE_NOISE", (item.noise for item in spec.states))
    yield numbers("STATE_DRIFT", (item.drift for item in spec.states))
    yield from ragged_table("JUMP", [[j for j, _ in item.jumps] for item in spec.states], "PARAMETER")
    yield numbers("JUMP_EXPONENT", (power for item in spec.states for _, power in item.jumps))
    yield numbers("SLOW_SD", (item.sd for item in spec.slow_errors))
    yield numbers("SLOW_LIMIT", spec.slow_limits)
    yield numbers("SLOW_WATCHED", spec.slow_watched)
    largest = {item.output: k for k, item in sorted(enumerate(spec.slow_errors), key=lambda item: item[1].sd)}
    yield integers("SLOW_OF_OUTPUT", (largest.get(j, -1) for j in range(len(spec.outputs))))
    yield from ragged_table("AFTER", [[k for k, _ in item.after] for item in spec.slow_errors], "INPUT")
    yield numbers("AFTER_EACH", (each for item in spec.slow_errors for _, each in item.after))
    yield numbers("LOOP_GUESS", spec.loops)
    for name in ("nominal", "scale", "healthy", "accuracy", "change", "healthy_change"):
        yield numbers(name.upper(), (getattr(item, name) for item in spec.parameters))
    for name in ("least", "most"):
        yield numbers(f"RANGE_{name.upper()}", (getattr(item, name) for item in spec.parameters))
    if spec.correlations:
        yield from _tie_tables(spec)
    yield from ragged_table("LIMIT", [item.limits for item in spec.parameters], None)
    yield numbers("LIMIT", (limit for item in spec.parameters for limit in item.limits))
    yield numbers("INPUT_NOISE", (item.noise for item in spec.inputs))
    yield numbers("INPUT_SETTLING", (item.settling for item in spec.inputs))
    yield numbers("INPUT_STEP", (item.step for item in spec.inputs))
    yield numbers("INPUT_STEP_PART", (item.step_part for item in spec.inputs))
    yield numbers("INPUT_HEALTHY_BIAS", (item.healthy_bias for item in spec.inputs))
    yield numbers("INPUT_ZERO", (item.unit_offset for item in spec.inputs))
    yield integers("INPUT_FACTOR", (item.factor for item in spec.inputs))
    yield integers("INPUT_TERM", (item.term for item in spec.inputs))
    yield numbers("INPUT_TERM_PART", (item.term_part for item in spec.inputs))
    familiar = [familiar_range(item.fitted_range, item.unit_offset) for item in spec.inputs]
    for end, name in enumerate(("LOW", "HIGH")):
        yield numbers(f"INPUT_FAMILIAR_{name}", (item[end] for item in familiar))
    yield integers("INPUT_RANGED", (item.ranged for item in spec.inputs))
    yield numbers("OUTPUT_NOISE", (item.noise for item in spec.outputs))
    yield numbers("OUTPUT_HEALTHY_BIAS", (item.healthy_bias for item in spec.outputs))
    yield numbers("OUTPUT_ZERO", (item.unit_offset for item in spec.outputs))
    yield integers("OUTPUT_RANGED", (item.ranged for item in spec.outputs))
    yield from ragged_table("DIRECT", [item.direct_inputs for item in spec.outputs], "INPUT")


def _tie_tables(spec: EngineSpec) -> Iterable[str]:
    """Of each parameter those that go with it: their covariance, entries of its inverse, and these by its own entry."""
    prior, n = spec.prior, len(spec.parameters)
    linked = (prior != 0.0) | np.eye(n, dtype=bool)
    for _ in range(n.bit_length()):
        linked = linked @ linked
    places = np.arange(n)
    tied = [np.flatnonzero(linked[k] & (places != k)) if prior[k, k] > 0.0 else places[:0] for k in range(n)]
    inverse = np.zeros((n, n))
    for k in range(n):
        group = np.flatnonzero(linked[k])
        if prior[k, k] > 0.0:
            inverse[np.ix_(group, group)] = np.linalg.inv(prior[np.ix_(group, group)])
    yield from ragged_table("TIE", tied, "PARAMETER")
    own = np.diag(inverse)
    yield numbers("OWN_PRECISION", own)
    pairs = [(k, int(j)) for k, row in enumerate(tied) for j in row]
    yield numbers("TIE_COVARIANCE", (prior[pair] for pair in pairs))
    yield numbers("TIE_PRECISION", (inverse[pair] for pair in pairs))
    yield numbers("TIE_WEIGHT", (inverse[pair] / own[pair[0]] for pair in pairs))


def _hypothesis_tables(spec: EngineSpec) -> Iterable[str]:
    settings = spec.thresholds
    yield from ragged_table("SET", spec.hypotheses, "MEMBER")
    yield from ragged_table("RESERVE", spec.reserve, "MEMBER")
    own = [settings.cost_per_sensor if item.is_output else settings.cost_per_suspect for item in spec.instruments]
    sizes = [settings.cost_per_suspect * len(chosen) for chosen in spec.hypotheses]
    mixed = [settings.cost_per_suspect + own[instrument] for instrument, _ in spec.mixed]
    both = [own[one] + own[two] for one, two in spec.both]
    yield numbers("COST", [*sizes, *own, *spec.reserve_costs, *mixed, *both])
    found = [entry for parts in extensions(spec) for entry in zip(*parts, strict=True)]
    yield f"#define N_EXTENSIONS {len(found)}"
    yield integers("EXTENSION_RESERVE", (row for row, _, _ in found))
    yield integers("EXTENSION_SET", (base for _, base, _ in found))
    yield from ragged_table("EXTENSION", [more for _, _, more in found], "MEMBER")


def _lane_tables(spec: EngineSpec) -> Iterable[str]:
    plan = plan_lanes(spec)
    members = [spec.hypotheses[k] for k in plan.hypothesis]
    yield integers("FIRST_LANE", (*plan.first, plan.n_lanes))
    yield integers("LANE_HYPOTHESIS", plan.hypothesis)
    yield integers("LANE_START", np.cumsum([0, *map(len, members)]))
    places = [(index, lane) for lane, chosen in enumerate(members) for index in chosen]
    starts = [(float(plan.values[place]), float(plan.sds[place])) for place in places]
    different = list(dict.fromkeys(starts))  # a handful, where lanes are many
    yield small_integers("START_OF", (different.index(item) for item in starts))
    yield numbers("START_VALUE", (value for value, _ in different))
    yield numbers("START_SPREAD", (sd for _, sd in different))
    yield from ragged_table("LANE_JUMP", [np.flatnonzero(row) for row in plan.jumps], "STATE")


def _slot_tables(spec: EngineSpec) -> Iterable[str]:
    lanes = plan_slots(spec).lanes
    kinds = tuple(FaultKind)
    yield small_integers("SLOT_KIND", (kinds.index(item.kind) for item in lanes))
    for name in ("hypothesis", "parameter", "input", "output", "acts", "sticks", "scales", "old", "keeps"):
        yield small_integers(f"SLOT_{name.upper()}", (getattr(item, name) for item in lanes))
    for name in ("size", "size_sd", "rate", "rate_sd", "settling", "lag", "noise", "weight"):
        yield numbers(f"SLOT_{name.upper()}", (getattr(item, name) for item in lanes))


def _couple_tables(spec: EngineSpec) -> Iterable[str]:
    couples = plan_couples(spec)
    for name in ("slot", "parameter", "beside", "hypothesis", "alike", "gains"):
        yield integers(f"COUPLE_{name.upper()}", (getattr(item, name) for item in couples))


def _check_tables(spec: EngineSpec) -> Iterable[str]:
    """Parts by number; of what can be checked the cost, and the place among all names, which orders what is alike."""
    looks, moves, signals = (spec.checked(kind) for kind in (CheckKind.COMPONENT, CheckKind.INPUT, CheckKind.SIGNAL))
    inputs = [item.name for item in spec.inputs]
    order = {name: k for k, name in enumerate(sorted({*spec.parts, *inputs, *signals}))}
    yield integers("PARAMETER_PART", (spec.parts.index(item.component) for item in spec.parameters))
    yield integers("INPUT_PART", map(spec.parts.index, inputs))
    yield integers("OUTPUT_PART", (spec.parts.index(item.name) for item in spec.outputs))
    for kind, names, checks in (("PART", spec.parts, looks), ("INPUT", inputs, moves), ("SIGNAL", signals, signals)):
        if kind != "SIGNAL" or signals:  # what is not used is not written
            yield numbers(f"{kind}_COST", (checks[name].cost if name in checks else 1.0 for name in names))
        yield integers(f"{kind}_ORDER", (order[name] for name in names))
    stated = [moves[name].move if name in moves else None for name in inputs]
    yield numbers("INPUT_MOVE", (np.nan if move is None else move for move in stated))
    yield integers("INPUT_PERCENT", (item.percent for item in spec.inputs))
    for end, name in enumerate(("LOW", "HIGH")):
        yield numbers(f"INPUT_FITTED_{name}", (item.fitted_range[end] for item in spec.inputs))
        yield numbers(f"INPUT_END_{name}", (item.ends[end] for item in spec.inputs))
    yield integers("INPUT_HAS_ZERO", (not item.unit_offset for item in spec.inputs))
    if signals:
        yield numbers("SIGNAL_NOISE", (item.noise for item in signals.values()))


def ragged_table(
    name: str, rows: Sequence[Sequence[int] | Sequence[float] | np.ndarray], what: str | None, kind: str = ""
) -> Iterable[str]:
    """Give rows of different length as one table of whole numbers, `name`_`what`, and where each begins, `name`_ROW.

    Each row is a sequence, or an array (n,). `what` None: only where each begins. `kind` ends the names.
    """
    yield integers(f"{name}_ROW{kind}", np.cumsum([0, *map(len, rows)]))
    if what is not None:
        yield integers(f"{name}_{what}{kind}", (int(place) for row in rows for place in row))


def integers(name: str, values: Iterable[int]) -> str:
    """Give a table of whole numbers; one entry, 0, where there is none."""
    return _table("int", name, (str(int(value)) for value in values), "0")


def small_integers(name: str, values: Iterable[int]) -> str:
    """Give a table of whole numbers in as few bytes each as hold them all."""
    found = [int(value) for value in values]
    widths = {"int8_t": 2**7, "int16_t": 2**15}
    fits = (kind for kind, end in widths.items() if all(-end <= value < end for value in found))
    return _table(next(fits, "int"), name, map(str, found), "0")


def numbers(name: str, values: Iterable[float]) -> str:
    """Give a table of numbers; one entry, 0, where there is none."""
    return _table("double", name, (literal(float(value)) for value in values), "0.0")


def _table(kind: str, name: str, values: Iterable[str], spare: str) -> str:
    text = f"static const {kind} {name}[] = {{{', '.join(values) or spare}}};"
    return fill(text, _WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
