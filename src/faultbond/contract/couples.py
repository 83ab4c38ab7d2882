"""Couples: a fault with a slot, and a parameter that changed beside it; the likeliest are tested."""

from dataclasses import dataclass

from faultbond.contract.spec import EngineSpec

MIXED, DRIFTING = 24, 4  # couples that are tested: with an instrument, and of a drift beside a step
PER_COUPLE = 3  # lanes of each; the third, in which a store keeps its content, is one of stores only


@dataclass(frozen=True, slots=True, kw_only=True)
class Couple:
    """A fault with a slot and a parameter.

    slot : hypothesis, an instrument or a single parameter, whose lanes with a slot are carried on
    parameter : which becomes a suspect beside it
    hypothesis : that which both are; of a parameter that drifts beside another one that of both as steps
    """

    slot: int
    parameter: int
    hypothesis: int


def plan_couples(spec: EngineSpec) -> tuple[Couple, ...]:
    """Give all couples: instruments with a parameter, then drifts of a parameter beside each other one."""
    if not spec.coupled:
        return ()
    first = len(spec.hypotheses)
    own = spec.n_begun + len(spec.reserve)
    with_instrument = (
        Couple(slot=first + instrument, parameter=index, hypothesis=own + k)
        for k, (instrument, index) in enumerate(spec.mixed)
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
    return (*with_instrument, *both_steps)


def n_coupled(spec: EngineSpec) -> tuple[int, int]:
    """Give how many couples can be tested: with an instrument, and of a drift beside a step."""
    return min(MIXED, len(spec.mixed)), min(DRIFTING, len(plan_couples(spec)) - len(spec.mixed))
