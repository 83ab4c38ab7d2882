"""What a further suspect says counts for sure only beyond what a model may be off by."""

from math import exp

import numpy as np
import pytest

from diagnosed import SPEC, Diagnosed, share_of
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes

STEPS, SETTINGS = plan_lanes(SPEC), SPEC.thresholds
OFF = 0.5 * core_settings()["OFF_AT_EACH"] ** 2  # nats a sample that a model's errors are worth
LEFT = core_settings()["LEFT_OF_IT"]
PAIR = next(k for k, members in enumerate(SPEC.hypotheses) if len(members) == 2)
PARTS = [SPEC.hypotheses.index((member,)) for member in SPEC.hypotheses[PAIR]]
OTHER = next(k for k in range(len(SPEC.hypotheses)) if k not in PARTS and k != PAIR and len(SPEC.hypotheses[k]) == 1)


def alarmed(gains: dict[int, float], after: int) -> Diagnosed:
    """A state, so long after an alarm, whose hypotheses say so many nats, costs apart; others say nothing."""
    state = Diagnosed()
    state.far_off()
    values = np.full(state.n_steps + state.n_slots, -1e6)
    for k, gain in gains.items():
        cost = SETTINGS.cost_per_suspect * len(SPEC.hypotheses[k])
        values[np.flatnonzero(STEPS.hypothesis == k)] = (gain + cost) / share_of(after)
    state["clock.index"] = state["clock.alarm"] + after
    state.likelihoods(values)
    return state


def shares(state: Diagnosed) -> dict[int, float]:
    """The probabilities of all hypotheses that have lanes."""
    found = state.diagnose()
    rows = found["candidates"][: found["n_candidates"]]
    return {int(row["hypothesis"]): float(row["probability"]) for row in rows}


def told(gains: dict[int, float], after: int) -> dict[int, float]:
    """The probabilities where hypotheses say so much."""
    return shares(alarmed(gains, after))


@pytest.mark.parametrize("after", [50, 1000, 9000])
@pytest.mark.parametrize("times", [0.2, 0.9, 1.1, 2.0])
def test_a_part_lags_by_what_a_models_errors_do_not_make_up_for(after: int, times: float) -> None:
    """Two suspects that say less than these are likelier than one, but not for sure; such that say more soon are."""
    allowed = OFF * after * share_of(after)
    gain = LEFT + times * allowed
    found = told({PARTS[0]: 0.0, PAIR: gain}, after)
    left = LEFT + max(gain - LEFT - allowed, 0.0)
    assert found[PARTS[0]] / found[PAIR] == pytest.approx(exp(-left), rel=1e-6)


def test_a_pair_that_is_hardly_likelier_than_a_part_of_it_is_left_as_it_is() -> None:
    """A part is never raised above what is left to it, and one that leads is none the likelier for a set."""
    for gain in (-3.0, 0.0, 1.0):
        found = told({PARTS[0]: 0.0, PAIR: gain}, 1000)
        assert found[PAIR] / found[PARTS[0]] == pytest.approx(exp(gain), rel=1e-6)


def test_parts_keep_their_distance_and_what_is_no_part_its_own() -> None:
    """Raised is what the pair has of the better part, and as much of the other one; nothing else comes nearer."""
    found = told({PARTS[0]: 0.0, PARTS[1]: -2.0, OTHER: 3.0, PAIR: 8.0}, 9000)
    assert found[PARTS[0]] / found[PAIR] == pytest.approx(exp(-LEFT), rel=1e-6)
    assert found[PARTS[1]] / found[PARTS[0]] == pytest.approx(exp(-2.0), rel=1e-6)
    assert found[OTHER] / found[PAIR] == pytest.approx(exp(-5.0), rel=1e-6)


def test_what_is_rejected_is_not_raised_and_raises_nothing() -> None:
    """Without the pair its part has what it says; without the part the pair is out, too."""
    state = alarmed({PARTS[0]: 0.0, OTHER: 3.0, PAIR: 20.0}, 9000)
    assert state.decide("reject", PAIR)[0] == 0
    share = shares(state)
    assert share[PARTS[0]] / share[OTHER] == pytest.approx(exp(-3.0), rel=1e-6)
    assert share[PAIR] == 0.0
    assert state.decide("reject", PARTS[0])[0] == 0
    share = shares(state)
    assert share[PARTS[0]] == share[PAIR] == 0.0
    assert share[OTHER] == pytest.approx(1.0)
