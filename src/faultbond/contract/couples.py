"""Couples: a fault with a slot, and a parameter that changed or an instrument that is off beside it; the likeliest."""

from collections.abc import Sequence
from dataclasses import dataclass

from faultbond.contract.spec import EngineSpec

MIXED, BOTH, DRIFTING = 24, 8, 4  # that are tested: an instrument with a parameter, two of them, a drift and a step
PER_COUPLE = 3  # lanes of each; in the third a store keeps its content, or an instrument has a further kind of fault


@dataclass(frozen=True, slots=True, kw_only=True)
class Couple:
    """A fault with a slot, and a parameter or an instrument.

    slot : hypothesis, an instrument or a single parameter, whose lanes with a slot are carried on
    parameter : which becomes a suspect beside it; -1: it is an instrument
    beside : hypothesis of that instrument; -1: it is a parameter
    hypothesis : that which both are; of a parameter that drifts beside another one that of both as steps
    alike : of an input that acts with one parameter alone, the hypothesis of that parameter beside the
    other suspect: a wrong gain is the same as a step of that; -1: there is none
    gains : hypothesis of that input; -1: there is none
    """

    slot: int
    hypothesis: int
    parameter: int = -1
    beside: int = -1
    alike: int = -1
    gains: int = -1


def plan_couples(spec: EngineSpec) -> tuple[Couple, ...]:
    """Give all couples: instruments with a parameter, two instruments, drifts of a parameter beside each other one."""
    if not spec.coupled:
        return ()
    first = len(spec.hypotheses)
    own = spec.n_begun + len(spec.reserve)
    pairs = [
        (chosen, k)
        for sets, start in ((spec.hypotheses, 0), (spec.reserve, spec.n_begun))
        for k, chosen in enumerate(sets, start)
        if len(chosen) == 2
    ]
    with_instrument = (
        Couple(
            slot=first + instrument,
            parameter=index,
            hypothesis=own + k,
            alike=alike,
            gains=first + instrument if alike >= 0 else -1,
        )
        for k, (instrument, index) in enumerate(spec.mixed)
        for alike in [_alike(spec, instrument, index, pairs)]
    )
    mixed = {chosen: own + k for k, chosen in enumerate(spec.mixed)}
    two_instruments = (
        Couple(
            slot=first + one,
            beside=first + two,
            hypothesis=own + len(spec.mixed) + k,
            alike=mixed.get((other, _factor(spec, gaining)), -1),
            gains=first + gaining if (other, _factor(spec, gaining)) in mixed else -1,
        )
        for k, (one, two) in enumerate(spec.both)
        for gaining, other in [(one, two) if _factor(spec, one) >= 0 else (two, one)]
    )
    singles = {chosen[0]: k for k, chosen in enumerate(spec.hypotheses) if len(chosen) == 1}
    both_steps = (
        Couple(slot=singles[drifting], parameter=other, hypothesis=k)
        for chosen, k in pairs
        for drifting, other in (chosen, chosen[::-1])
        if drifting in singles
    )
    return (*with_instrument, *two_instruments, *both_steps)


def _alike(spec: EngineSpec, instrument: int, parameter: int, pairs: Sequence[tuple[tuple[int, ...], int]]) -> int:
    """Give the hypothesis of two parameters that looks as a gain of an input beside one of them does; -1: none."""
    both = tuple(sorted((_factor(spec, instrument), parameter)))
    return next((k for chosen, k in pairs if tuple(sorted(chosen)) == both), -1)


def _factor(spec: EngineSpec, instrument: int) -> int:
    """Give the parameter with which alone an instrument acts, if it is such an input; -1: none."""
    item = spec.instruments[instrument]
    return -1 if item.is_output else spec.inputs[item.index].factor


def n_coupled(spec: EngineSpec) -> tuple[int, int, int]:
    """Give how many couples can be tested: an instrument with a parameter, two instruments, a drift beside a step."""
    drifting = len(plan_couples(spec)) - len(spec.mixed) - len(spec.both)
    return min(MIXED, len(spec.mixed)), min(BOTH, len(spec.both)), min(DRIFTING, drifting)
