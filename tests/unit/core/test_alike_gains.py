"""A wrong gain of an input, and a change of the parameter with which alone it acts: nobody knows which of both."""

from functools import cache

import numpy as np
import pytest

from bare_core import Bare, bare
from faultbond.arrays import FloatArray
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
WANDERS, STAYS = "{nominal: 2e-5 m^3/s/percent, wander: 5 % over 1 h}", "2e-5 m^3/s/percent"
TANK = """\
name: tank
sample_time: 1 s
max_faults: 1
inputs: {u: {unit: percent}}
components:
  pump: {type: Sf, law: f = G*u, parameters: {G: COEFFICIENT}}
  vessel: {type: C, law: q = A*e, parameters: {A: 1e-4 m^3/Pa}}
  outlet: {type: R, law: f = K*e, parameters: {K: 1e-7 m^3/s/Pa}}
junctions: {node: 0}
bonds: [pump -> node -> vessel, node -> outlet]
sensors: {level: {reads: node.e, unit: Pa, noise: 20 Pa}, drain: {reads: outlet.f, noise: 1e-5 m^3/s}}
"""
CALLS = """
static Ranking ranking;
/* Scores of all hypotheses where lanes of gains of the input, those of G, and those in which G comes and goes,
   have these log-likelihoods. */
void t_score(State *state, const double *said, const double *ruled_out, double *scores)
{
    for (int64_t k = 0; k < N_STEPS; k++)
        *number_of_step(&state->bank, k, PLAIN_LIKELIHOOD) = LANE_HYPOTHESIS[k] == 0 ? said[1] : -1e3;
    for (int64_t k = 0; k < N_SLOT_LANES; k++) {
        const double own = SLOT_PARAMETER[k] != 0 ? -1e3 : SLOT_KIND[k] == KIND_INTERMITTENT ? said[2] : said[1];
        *number_of_slot(&state->bank, k, WIDE_LIKELIHOOD) = SLOT_INPUT[k] == 0 && SLOT_SCALES[k] ? said[0] : own;
    }
    for (int64_t i = 0; i < N_PARAMETERS; i++) {
        for (int64_t k = 0; k < N_STEPS; k++) *number_of_step(&state->bank, k, AT_PARAMETERS + i) = HEALTHY[i];
        for (int64_t k = 0; k < N_SLOT_LANES; k++) *number_of_slot(&state->bank, k, AT_PARAMETERS + i) = HEALTHY[i];
    }
    state->clock.index = state->clock.alarm = 100;
    state->bank.rejected[0] = *ruled_out != 0.0;
    score_all(state, OUT_REJECTED, &ranking);
    memcpy(scores, ranking.score, sizeof ranking.score);
}
"""


@cache
def core(coefficient: str) -> Bare:
    """The core of a tank whose pump has this coefficient."""
    return bare(CALLS, TANK.replace("COEFFICIENT", coefficient))


def scores(
    coefficient: str, gains: float, changes: float, *, returning: float = -1e3, ruled_out: bool = False
) -> tuple[FloatArray, float, float]:
    """Scores of all hypotheses, that of a change of G, and that of the input, where their lanes say so much."""
    plant = core(coefficient)
    found = np.zeros(plant.spec.n_hypotheses)
    plant.call("t_score", np.array([gains, changes, returning]), np.array([float(ruled_out)]), found)
    place = [item.name for item in plant.spec.instruments].index("u")
    assert plant.spec.hypotheses[0] == (0,)
    return found, float(found[0]), float(found[len(plant.spec.hypotheses) + place])


@pytest.mark.parametrize("coefficient", [WANDERS, STAYS])
@pytest.mark.parametrize(("gains", "changes"), [(40.0, 10.0), (10.0, 40.0), (25.0, 25.0)])
def test_both_say_what_either_of_them_says(coefficient: str, gains: float, changes: float) -> None:
    """Which of them is at fault is as likely as before, up to the other ways in which each of them fails."""
    _, parameter, instrument = scores(coefficient, gains, changes)
    _, even, alike = scores(coefficient, 40.0, 40.0)
    assert parameter - instrument == pytest.approx(even - alike, abs=0.5)
    assert parameter == pytest.approx(even, abs=0.2)  # beside the likeliest of all; each drifts in its own ways


def test_a_coefficient_that_is_at_fault_now_and_then_is_none_of_them() -> None:
    """Only the input can be wrong where it says much: no gain comes and goes as the coefficient does."""
    _, parameter, instrument = scores(STAYS, 40.0, 10.0, returning=30.0)
    _, even, alike = scores(STAYS, 40.0, 40.0)
    assert parameter - instrument == pytest.approx(even - alike, abs=0.5)


def test_what_is_ruled_out_says_nothing() -> None:
    """Then the gain stands by itself."""
    _, parameter, instrument = scores(WANDERS, 10.0, 40.0, ruled_out=True)
    _, _, alone = scores(WANDERS, 10.0, -1e3)
    assert parameter < -1e3
    assert instrument == pytest.approx(alone - 30.0, abs=1e-6)  # beside the likeliest lane, though it is ruled out
