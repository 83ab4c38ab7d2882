"""A wrong gain of an input, and a change of the parameter with which alone it acts: nobody knows which of both."""

from functools import cache

import numpy as np
import pytest

from bare_core import Bare, bare
from faultbond.arrays import FloatArray
from faultbond.synthesis.compile import find_compiler
from faultbond.types import FaultKind

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
/* Whether two candidates say the same: the kind of each, and of its suspect parameter, input, and what is wrong. */
void t_same(State *state, const double *one, const double *other, double *same)
{
    static Candidate found[2];
    const double *told[2] = {one, other};
    (void)state;
    memset(found, 0, sizeof found);
    for (int k = 0; k < 2; k++) {
        found[k].n_suspects = found[k].n_kinds = 1;
        found[k].kinds[0] = (int64_t)told[k][0];
        found[k].suspects[0].parameter = (int64_t)told[k][1];
        found[k].suspects[0].input = (int64_t)told[k][2];
        found[k].suspects[0].output = -1;
        found[k].suspects[0].word = (int64_t)told[k][3];
    }
    same[0] = say_the_same(&found[0], &found[1]);
}
/* Whether a hypothesis is contradicted after `t_score`, where sums of gains of the input, and others, are so large. */
void t_contradicted(State *state, const double *sums, const double *hypothesis, double *found)
{
    int side, signal;
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        const int64_t slot = lane - N_STEPS;
        const int is_gain = slot >= 0 && slot < N_SLOT_LANES && SLOT_INPUT[slot] == 0 && SLOT_SCALES[slot];
        for (int j = 0; j < N_OUTPUTS; j++) state->bank.sums[0][j][lane] = sums[is_gain ? 0 : 1];
    }
    const int64_t lane = judged_lane(&state->bank, &ranking, (int64_t)hypothesis[0]);
    found[0] = largest_sum(&state->bank, lane, &side, &signal) > CUSUM_LIMIT;
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


STEP, GAIN, INTERMITTENT = map([*FaultKind].index, (FaultKind.STEP, FaultKind.GAIN, FaultKind.INTERMITTENT))
IS_BIAS, IS_GAIN = 1, 3  # words of a suspect, as `core/found.h` numbers them


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ((STEP, 0, -1, 0), (GAIN, -1, 0, IS_GAIN), True),
        ((GAIN, -1, 0, IS_GAIN), (STEP, 0, -1, 0), True),
        ((STEP, 1, -1, 0), (GAIN, -1, 0, IS_GAIN), False),  # another parameter
        ((STEP, 0, -1, 0), (GAIN, -1, 0, IS_BIAS), False),
        ((INTERMITTENT, 0, -1, 0), (GAIN, -1, 0, IS_GAIN), False),
    ],
)
def test_no_move_tells_a_gain_from_its_coefficient(one: tuple[int, ...], other: tuple[int, ...], *, same: bool) -> None:
    """However far their lanes are apart: that is of how they began."""
    found = np.zeros(1)
    core(STAYS).call("t_same", np.array(one, dtype=np.float64), np.array(other, dtype=np.float64), found)
    assert bool(found[0]) == same


@pytest.mark.parametrize("which", ["parameter", "instrument"])
@pytest.mark.parametrize(("gains", "changes"), [(1e3, 0.0), (0.0, 1e3), (1e3, 1e3), (0.0, 0.0)])
def test_what_one_of_them_explains_the_other_does(gains: float, changes: float, which: str) -> None:
    """Neither is contradicted by lanes of its own that begin elsewhere, unless what was ruled out spoke for it."""
    plant = core(STAYS)
    place = [item.name for item in plant.spec.instruments].index("u")
    number = 0 if which == "parameter" else len(plant.spec.hypotheses) + place
    for ruled_out in (False, True):
        scores(STAYS, 40.0, 40.0, ruled_out=ruled_out)
        found = np.zeros(1)
        plant.call("t_contradicted", np.array([gains, changes]), np.array([float(number)]), found)
        own = changes if which == "parameter" else gains
        assert bool(found[0]) == ((own if ruled_out else min(gains, changes)) > 0.0)


def test_what_is_ruled_out_says_nothing() -> None:
    """Then the gain stands by itself."""
    _, parameter, instrument = scores(WANDERS, 10.0, 40.0, ruled_out=True)
    _, _, alone = scores(WANDERS, 10.0, -1e3)
    assert parameter < -1e3
    assert instrument == pytest.approx(alone - 30.0, abs=1e-6)  # beside the likeliest lane, though it is ruled out
