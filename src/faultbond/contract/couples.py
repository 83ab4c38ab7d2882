"""Couples: a fault with a slot, and a parameter that changed or an instrument that is off beside it; the likeliest."""

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
    """

    slot: int
    hypothesis: int
    parameter: int = -1
    beside: int = -1


def plan_couples(spec: EngineSpec) -> tuple[Couple, ...]:
    """Give all couples: instruments with a parameter, two instruments, drifts of a parameter beside each other one."""
    if not spec.coupled:
        return ()
    first = len(spec.hypotheses)
    own = spec.n_begun + len(spec.reserve)
    with_instrument = (
        Couple(slot=first + instrument, parameter=index, hypothesis=own + k)
        for k, (instrument, index) in enumerate(spec.mixed)
    )
    two_instruments = (
        Couple(slot=first + one, beside=first + two, hypothesis=own + len(spec.mixed) + k)
        for k, (one, two) in enumerate(spec.both)
    )
    singles = {chosen[0]: k for k, chosen in enumerate(spec.hypotheses) if len(chosen) == 1}
    pairs = [
        (chosen, k)
        for sets, start in ((spec.hypotheses, 0), (spec.reserve, spec.n_begun))
        for k, chosen in enumerate(sets, start)
        if len(chosen) == 2
    ]
    both_steps = (
        Couple(slot=singles[drifting], parameter=other, hypothesis=k)
        for chosen, k in pairs
        for drifting, other in (chosen, chosen[::-1])
        if drifting in singles
    )
    return (*with_instrument, *two_instruments, *both_steps)


def n_coupled(spec: EngineSpec) -> tuple[int, int, int]:
    """Give how many couples can be tested: an instrument with a parameter, two instruments, a drift beside a step."""
    drifting = len(plan_couples(spec)) - len(spec.mixed) - len(spec.both)
    return min(MIXED, len(spec.mixed)), min(BOTH, len(spec.both)), min(DRIFTING, drifting)
