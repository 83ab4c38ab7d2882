"""The core of a motor, some of its sets in reserve, on a trail with two faults: its lanes of steps, for tests."""

import ctypes
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bare_core import compiled, in_c
from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.spec import EngineSpec, pack
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import load_model
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec

GRAPH = load_model(Path(__file__).parents[2] / "examples" / "dc_motor_current" / "model.yaml")
PAIRS = tuple(combinations(range(5), 2))
BEGUN = (*((k,) for k in range(5)), (0, 2), (1, 2), (3, 4))
RESERVE, GROWN = (*(pair for pair in PAIRS if pair not in BEGUN), (0, 1, 2), (0, 1, 3)), 4
FIRST, ALARM, ROWS = 120, 60, 70  # first row of the trail; place of the alarm, and samples in it
CHANGE, BEGINS = 30, (FIRST + 30) * 0.02  # place of the faults, and their time, s
FAULTS = (Fault(parameter="R", factor=2.0, start=BEGINS), Fault(parameter="J", factor=1.5, start=BEGINS))
OLDEST = 5  # number of the first sample of the trail
WRAPPERS = """
#define EACH_LANE for (int64_t l = 0; l < N_STEPS; l++) for (int64_t k = 0; k < PLAIN_NUMBERS; k++)
#define ROW (int64_t)(sizeof(Row) / 8)
static State S; static BankMemory M; static Filters F; static Trail T; static PlainBlock group;
static int64_t best[FB_ROOM(N_SETS)];
void t_sizes(int64_t *to) { to[0] = N_STEPS; to[1] = N_PLANNED; to[2] = N_LANES; }
void t_trail(int64_t n, int64_t alarm, const double *rows)
{
    memset(&S, 0, sizeof S); memset(&T, 0, sizeof T);
    T.past = &S.past; T.oldest = 5; T.n = n; T.alarm = alarm;
    S.clock.index = T.oldest + n - 1; S.clock.alarm = T.oldest + alarm;
    for (int64_t k = 0; k < n; k++) memcpy(row_of(&S.past, T.oldest + k), rows + k * ROW, sizeof(Row));
    prepare_filters(&F);
}
void t_drift(const double *rates, const double *wander)
{
    memcpy(S.normal.rates, rates, sizeof S.normal.rates); memcpy(S.normal.wander, wander, sizeof S.normal.wander);
}
void t_suspect(int64_t lane, int tied, const double *healthy, double *to)
{ Start start; planned_start(lane, &start); start.tied = tied; suspect_lane(&start, healthy, to); }
void t_begin(int64_t lane, int64_t place, double *to)
{
    for (int64_t l = 0; l < GROUP; l++) planned_start((lane + l) % N_PLANNED, &M.steps.starts[l]);
    begin_steps(M.steps.starts, &T, place, &S.normal, group, &M.steps, &F.plain);
    run_steps(group, &T, place, T.n, place, &S.normal, M.steps.sample, &F.plain);
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) to[k] = group[k][0];
}
void t_begin_all(int64_t change) { begin_bank(&S, &T, change); work_for(&S, INT64_MAX, &M, &F); }
/* Let lanes begin again, for the last time or an earlier one: first say which, then do all of it. */
void t_again(int last) { S.job.renewals = last ? N_RENEWALS - 1 : 0; begin_again(&S, &T, &M); }
void t_all(void) { work_for(&S, INT64_MAX, &M, &F); }
/* Let the next group begin again: its lanes, and where they began from far away, and from closer. */
void t_group(int64_t *lane, int64_t *began, int64_t *begins)
{
    do work_a_little(&S, &T, INT64_MAX, &M, &F);
    while (S.job.pass != OPENING);
    memcpy(lane, S.job.lane, sizeof S.job.lane);
    memcpy(began, S.job.began, sizeof S.job.began); memcpy(begins, S.job.begins, sizeof S.job.begins);
}
void t_grown(int64_t *grown) { memcpy(grown, S.bank.grown, sizeof S.bank.grown); }
void t_reject(int64_t hypothesis) { S.bank.rejected[hypothesis] = 1; }
void t_onsets(int64_t *to) { memcpy(to, S.bank.onset, N_STEPS * sizeof *to); }
void t_put_onset(int64_t lane, int64_t place) { S.bank.onset[lane] = S.job.oldest + place; }
/* Forget since when lanes are judged, and ask for it. */
void t_unjudged(void) { for (int64_t l = 0; l < N_STEPS; l++) S.bank.since[0][0][l] = -1.0; }
void t_changed(uint8_t *to)
{ for (int64_t l = 0; l < N_STEPS; l++) to[l] = S.bank.since[0][0][l] == (double)S.clock.index; }
void t_get(double *to) { EACH_LANE to[l * PLAIN_NUMBERS + k] = *number_of_step(&S.bank, l, k); }
void t_put(const double *from) { EACH_LANE *number_of_step(&S.bank, l, k) = from[l * PLAIN_NUMBERS + k]; }
void t_one(const double *sample, double *lane) { advance_one(lane, sample, &S.normal, NULL, &F.plain); }
void t_advance(int64_t n_begun, const double *packed, double *innovations)
{
    double (*to)[FB_ROOM(N_LANES)] = (double (*)[FB_ROOM(N_LANES)])innovations;
    advance_steps(&S.bank, n_begun, packed, &S.normal, to, &M.steps, &F.plain);
}
void t_gain(int64_t lane, int index, const double *healthy, double *found)
{ memcpy(S.bank.healthy, healthy, sizeof S.bank.healthy); found[0] = gain_of(&S.bank, lane, index, &found[1]); }
/* A set of the reserve by the closed form: its likelihood, then the factors of its members. */
void t_extended(int64_t set, const double *healthy, double *found)
{
    Choice choice = {set, 0.0, -1, -1, 0, {0.0}};
    int64_t entry = 0;
    memcpy(S.bank.healthy, healthy, sizeof S.bank.healthy);
    for (int64_t k = 0; k < N_SETS; k++) best[k] = likeliest_lane(&S.bank, k);
    while (entry < N_EXTENSIONS &&
           (EXTENSION_RESERVE[entry] != set || EXTENSION_ROW[entry + 1] - EXTENSION_ROW[entry] != 1))
        entry++;
    found[0] = extend(&S.bank, best, &entry, &choice);
    find_values(&S.bank, best, &choice);
    memcpy(found + 1, choice.value, sizeof choice.value);
}
void t_choice(int64_t set, double value, int part, const double *healthy, double *to)
{
    double factors[LARGEST_SET];
    Start start;
    for (int k = 0; k < LARGEST_SET; k++) factors[k] = value;
    start_of_choice(set, factors, part, healthy, &start);
    suspect_lane(&start, healthy, to);
}
"""


def _given(item: NDArray[Any] | int | float) -> Any:
    """What C takes: an array by its address."""
    if isinstance(item, np.ndarray):
        return ctypes.c_void_p(item.ctypes.data)
    return ctypes.c_double(item) if isinstance(item, float) else ctypes.c_int64(item)


class Core:
    """The motor's core with wrappers, on a trail with a fault; arrays are those of C, lanes as rows."""

    def __init__(self, library: ctypes.CDLL, spec: EngineSpec) -> None:
        self.library, self.spec = library, spec
        sizes = np.zeros(3, dtype=np.int64)
        self("t_sizes", sizes)
        self.n_steps, self.n_planned, self.n_lanes = map(int, sizes)
        self.samples, self.lanes = self._trail()
        self.begin_trail()

    def __call__(self, name: str, *arguments: NDArray[Any] | int | float) -> int:
        return int(getattr(self.library, name)(*map(_given, arguments)))

    def _trail(self) -> tuple[FloatArray, FloatArray]:
        """Packed samples, the first of the trail after a run of healthy ones, and healthy lanes after each."""
        spec, place = self.spec, self.spec.sample_fields
        time: FloatArray = np.asarray(np.arange(FIRST + ROWS) * 0.02, dtype=np.float64)
        u = random_steps(time, np.random.default_rng(6), low=2, high=12, shortest=0.4, longest=1.2)[:, None]
        made = simulate(GRAPH, Inputs(time=time, values=u), FAULTS, seed=2)
        samples, lanes = np.zeros((len(time), spec.n_sample)), np.zeros((len(time), spec.n_numbers))
        samples[1:, place["dt"]], samples[1:, place["u_before"]] = 0.02, made.inputs[:-1]
        samples[:, place["u"]], samples[:, place["y"]], samples[:, place["scale"]] = made.inputs, made.outputs, 1.0
        samples[:, place["use"]] = np.random.default_rng(1).random(made.outputs.shape) > 0.1
        samples[:, place["bound"]] = 6.0
        samples[:, place["fresh"]] = spec.input_variance
        lane = np.zeros(spec.n_numbers)
        lane[spec.parameter_slice] = 1.0
        lane[spec.covariance_slice] = pack(np.diag([1.0, 1.0, *[item.accuracy**2 for item in spec.parameters], 0.0]))
        for k, sample in enumerate(samples):
            self("t_one", sample, lane)
            lanes[k] = lane
        return samples[FIRST:].copy(), lanes[FIRST:].copy()

    def begin_trail(self) -> None:
        """Begin with an empty bank."""
        self("t_trail", ROWS, ALARM, np.concatenate([self.samples, self.lanes, np.zeros((ROWS, 2))], axis=1))

    def begin_bank(self) -> FloatArray:
        """Begin with the bank of all hypotheses, which is given."""
        self.begin_trail()
        self("t_begin_all", CHANGE)
        return self.bank()

    def bank(self) -> FloatArray:
        """All lanes of steps, (n_steps, n_numbers)."""
        lanes = np.zeros((self.n_steps, self.spec.n_numbers))
        self("t_get", lanes)
        return lanes

    def begun(self, lane: int, place: int) -> FloatArray:
        """A lane of the plan begun at one onset, after all samples."""
        found = np.zeros(self.spec.n_numbers)
        self("t_begin", lane, place, found)
        return found

    def onsets(self) -> IntArray:
        """The places in the trail at which the lanes of steps began."""
        found = np.zeros(self.n_steps, dtype=np.int64)
        self("t_onsets", found)
        return found - OLDEST

    def renewed(self, *, last: bool = False) -> tuple[FloatArray, BoolArray]:
        """The bank after a renewal, and which lanes are judged anew."""
        changed = np.zeros(self.n_steps, dtype=np.uint8)
        self("t_unjudged")
        self("t_again", int(last))
        self("t_all")
        self("t_changed", changed)
        return self.bank(), changed > 0

    def grown(self) -> IntArray:
        """The sets that the last renewal chose from the reserve."""
        grown = np.zeros(GROWN, dtype=np.int64)
        self("t_grown", grown)
        return grown


@cache
def core(width: int = 8) -> Core:
    """The core of so many lanes at a time, with some sets of the motor in reserve."""
    plant = build_plant(GRAPH)
    wide = build_step_model(plant, all_inputs=True)
    spec = replace(build_spec(build_step_model(plant)), hypotheses=BEGUN, reserve=RESERVE)
    text = core_text(spec, wide).replace(f"#define N_GROWN {len(RESERVE)}", f"#define N_GROWN {GROWN}")
    return Core(compiled(text + in_c(WRAPPERS), f"-DFB_LANES={width}"), spec)
