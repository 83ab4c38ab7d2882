"""The part of the core that ranks and decides, compiled for a model, with a state that tests write into by name."""

import ctypes
from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np

from bare_core import compiled, in_c
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import parse_model
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec
from faultbond.types import FaultKind

KINDS = tuple(FaultKind)
CIRCUIT = """\
name: circuit
sample_time: 0.1 s
constants: {C1: 0.1 F, B: 40 V/A^3}
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  one: {type: R, parameters: {R1: {nominal: 10 ohm, limit: [5 ohm, 20 ohm]}}}
  two: {type: R, parameters: {R2: 20 ohm}}
  cell: {type: C, law: e = q/C1}
  load: {type: R, law: e = R3*f + B*f**3, parameters: {R3: 30 ohm}}
  leak: {type: Sf, law: f = L, parameters: {L: {nominal: 0 A, accuracy: 1 mA, change: 50 mA}}}
junctions: {line: 1, node: 0, branch: 1}
bonds: [source -> line -> one, line -> node -> cell, node -> leak, node -> branch, branch -> two, branch -> load]
sensors: {i: {reads: line.f, unit: A, noise: 5 mA}, v: {reads: node.e, unit: V, noise: 10 mV}}
"""
MODEL = build_plant(parse_model(CIRCUIT))
WIDE_MODEL = build_step_model(MODEL, all_inputs=True)
PLAIN = build_spec(build_step_model(MODEL))
N_P = len(PLAIN.parameters)
SINGLES, PAIRS = (tuple(combinations(range(N_P), size)) for size in (1, 2))
RESERVE = (*PAIRS[2:], *combinations(range(N_P), 3))
ZEROS = (0.0, -0.2)  # where the unit of each sensor has its 0, SI
OUTPUTS = tuple(replace(item, unit_offset=zero) for item, zero in zip(PLAIN.outputs, ZEROS, strict=True))
SPEC = replace(PLAIN, hypotheses=(*SINGLES, *PAIRS[:2]), reserve=RESERVE, outputs=OUTPUTS)


FAR = 100.0  # a factor that no healthy parameter has


def slot_of(**wanted: Any) -> int:
    """Give the first lane with a slot that is so."""
    lanes = enumerate(plan_slots(SPEC).lanes)
    return next(k for k, lane in lanes if all(getattr(lane, name) == value for name, value in wanted.items()))


_CALLS = """
int64_t size_of(int64_t k)
{
    const int64_t sizes[] = {sizeof(State), sizeof(Diagnosis), sizeof(RankingMemory), sizeof(Candidate),
                             FB_ROOM(MOST_LIMITS), LARGEST_SET, MOST_CANDIDATES, N_FIELDS, N_STEPS, N_SLOT_LANES};
    return sizes[k];
}
const char *field_name(int64_t k) { return FIELDS[k].name; }
void field(int64_t k, int64_t *found)
{
    found[0] = FIELDS[k].offset, found[1] = FIELDS[k].count, found[2] = FIELDS[k].is_whole;
}
double *step(State *state, int64_t lane, int64_t k) { return number_of_step(&state->bank, lane, k); }
double *slot(State *state, int64_t lane, int64_t k) { return number_of_slot(&state->bank, lane, k); }
double *row(State *state, int64_t number, int64_t k) { return k < 0 ? &row_of(&state->past, number)->time
                                                                    : &row_of(&state->past, number)->lane[k]; }
void t_forecast(const double *known, double *found)
{
    Suspect suspect;
    no_suspect(&suspect);
    suspect.estimate = known[2];
    suspect.rate = known[3];
    suspect.nominal = known[7];
    const Forecast told = forecast(known[0], known[1], &suspect, &known[4]);
    memcpy(found, &told, sizeof told);
}
void diagnose(const State *state, Diagnosis *found, RankingMemory *memory) { conclude(state, found, memory); }
int64_t decide(int64_t what, State *state, int64_t k, Candidate *candidate, Diagnosis *found, RankingMemory *memory)
{
    return what ? accept(state, k, 0, candidate, found, memory) : reject(state, k, candidate, found, memory);
}
"""


@cache
def text_of(spec: EngineSpec = SPEC) -> str:
    """Give the core of a specification of the circuit, with the calls that are tested."""
    return core_text(spec, WIDE_MODEL) + in_c(_CALLS)


def share_of(n: int) -> float:
    """The part of differences of log-likelihoods that counts, so many samples after the alarm."""
    settings = core_settings()
    return 1.0 / (1.0 + min(n, settings["MOST_AS_MANY"]) / settings["AS_MANY"])


def raised(evidence: FloatArray, spec: EngineSpec = SPEC, after: int = 400) -> FloatArray:
    """Raise what parts of sets are worth to where a model that may be off leaves them; by hypothesis, no logarithms."""
    suspects = [(*spec.members(k), *(item.name for item in spec.instruments_in(k))) for k in range(len(evidence))]
    sets = [frozenset(chosen) for chosen in suspects]
    settings = core_settings()
    allowed = np.exp(0.5 * settings["OFF_AT_EACH"] ** 2 * after * share_of(after))
    found = evidence.copy()
    for k, whole in enumerate(sets):
        parts = [i for i, other in enumerate(sets) if other < whole and evidence[i] > 0.0]
        if not parts or evidence[k] < evidence.max() * np.exp(-settings["FAR_BEHIND"]):
            continue
        times = min(evidence[k] * np.exp(-settings["LEFT_OF_IT"]) / max(evidence[parts]), allowed)
        found[parts] = np.maximum(found[parts], evidence[parts] * times)
    return found


class Diagnosed:
    """A state of zeros, with an alarm at sample 100, now 500: numbers by name, lanes, and what is made of it."""

    def __init__(self, spec: EngineSpec = SPEC, *options: str) -> None:
        """Compile the circuit with these sets of suspects; see `compiled` of the options."""
        self.library, self.spec = compiled(text_of(spec), *options), spec
        for name in ("size_of", "decide"):
            getattr(self.library, name).restype = ctypes.c_int64
        self.library.field_name.restype = ctypes.c_char_p
        for name in ("step", "slot", "row"):
            getattr(self.library, name).restype = ctypes.POINTER(ctypes.c_double)
        sizes = [int(self.library.size_of(ctypes.c_int64(k))) for k in range(10)]
        self.n_steps, self.n_slots = sizes[8:]
        self.state, self.found, self.memory, self.one = (np.zeros(size // 8) for size in sizes[:4])
        self.record = _record(*sizes[4:7], n_parameters=len(spec.parameters))
        assert self.record.itemsize == sizes[1]
        self.fields: dict[str, Any] = {}
        for k in range(sizes[7]):
            place = (ctypes.c_int64 * 3)()
            self.library.field(ctypes.c_int64(k), place)
            numbers = self.state[place[0] // 8 : place[0] // 8 + place[1]]
            name = self.library.field_name(ctypes.c_int64(k)).decode()
            self.fields[name] = numbers.view(np.int64) if place[2] else numbers
        self["clock.index"], self["clock.alarm"], self["bank.grown"] = 500, 100, -1
        self["bank.coupled"] = self["bank.base"] = self["alarm.walker"] = self["settled.hypothesis"] = -1
        self["normal.noise"] = self["normal.gain"] = self["sensors.nis"] = self["normal.input_gain"] = 1.0
        roles = spec.slotted.role_fields
        for k in range(self.n_slots):  # what comes and goes has gone, and a ramp took its time
            self.lane("slot", k)[roles["returns"].start], self.lane("slot", k)[roles["took"].start] = 1.0, 1e3

    def __getitem__(self, name: str) -> Any:
        """Give the numbers of a name."""
        return self.fields[name]

    def __setitem__(self, name: str, value: Any) -> None:
        """Set the numbers of a name."""
        self.fields[name][:] = np.ravel(value)

    def lane(self, what: str, index: int) -> Any:
        """Give the numbers of a lane of `step` or `slot`, or of a `row` of the past (-1: its time)."""
        diagnosed = self

        class Numbers:
            def _at(self, k: int) -> Any:
                call = getattr(diagnosed.library, what)
                return call(_pointer(diagnosed.state), ctypes.c_int64(index), ctypes.c_int64(k))

            def __getitem__(self, k: int) -> float:
                return float(self._at(k)[0])

            def __setitem__(self, k: int, value: float) -> None:
                self._at(k)[0] = value

        return Numbers()

    def write(self, what: str, index: int, numbers: FloatArray) -> None:
        """Write all numbers of a lane."""
        lane = self.lane(what, index)
        for k, value in enumerate(numbers):
            lane[k] = float(value)

    def likelihoods(self, values: FloatArray) -> None:
        """Set the log-likelihoods of all lanes, steps first."""
        for k, value in enumerate(values):
            what, lane = ("step", k) if k < self.n_steps else ("slot", k - self.n_steps)
            self.lane(what, lane)[(self.spec if what == "step" else self.spec.slotted).n_numbers - 1] = float(value)

    def far_off(self) -> None:
        """Let the suspects of all lanes be far from healthy, within their ranges, and all else as declared."""
        steps, slots = plan_lanes(self.spec), plan_slots(self.spec).lanes
        for index, item in enumerate(self.spec.parameters):
            for k in range(self.n_steps):
                is_suspect = k >= steps.n_lanes or steps.suspected[index, k]
                self.lane("step", k)[self.spec.parameter_slice.start + index] = FAR if is_suspect else item.healthy
            for k, slot in enumerate(slots):
                is_suspect = slot.parameter == index
                self.lane("slot", k)[self.spec.slotted.parameter_slice.start + index] = (
                    FAR if is_suspect else item.healthy
                )

    def only(self, lane: int) -> None:
        """Let one lane explain the data, steps first."""
        values = np.full(self.n_steps + self.n_slots, -1000.0)
        values[lane] = 50.0
        self.likelihoods(values)

    def diagnose(self) -> Any:
        """Give the diagnosis of the state, which it may not change, whatever stood where it writes."""
        before = self.state.copy()
        self.found[:] = self.memory[:] = np.nan
        self.library.diagnose(*map(_pointer, (self.state, self.found, self.memory)))
        assert np.array_equal(before.view(np.int64), self.state.view(np.int64))
        return self.found.view(self.record)[0]

    def decide(self, what: str, hypothesis: int) -> tuple[int, Any]:
        """Accept or reject; give the answer and the candidate."""
        parts = map(_pointer, (self.one, self.found, self.memory))
        number = ctypes.c_int64(what == "accept")
        answer = self.library.decide(number, _pointer(self.state), ctypes.c_int64(hypothesis), *parts)
        return int(answer), self.one.view(self.record["candidates"].base)[0]


def _pointer(array: Any) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _record(n_limits: int, largest: int, most: int, *, n_parameters: int) -> Any:
    """Give the layout of a diagnosis; all numbers have eight bytes."""

    def numbers(kind: str, *names: str) -> list[Any]:
        return [(name, kind) for name in names]

    forecast = numbers("f8", "limit", "time", "earliest", "latest")
    suspect = numbers("i8", "parameter", "input", "output", "word")
    values = ("nominal", "estimate", "sd", "rate", "rate_sd", "began", "ended", "moved", "stopped")
    suspect += [*numbers("f8", *values), ("n_forecasts", "i8")]
    suspect += [("forecasts", forecast, (n_limits,))]
    candidate = [*numbers("i8", "hypothesis", "lane", "group", "present", "n_kinds"), ("kinds", "i8", (len(KINDS),))]
    candidate += [("n_suspects", "i8"), ("probability", "f8"), ("shares", "f8", (len(KINDS),))]
    candidate += [("suspects", suspect, (largest,))]
    head = numbers("i8", "n_candidates", "is_over", "is_unexplained", "has_untested", "untested_sets")
    head += numbers("i8", "signal", "n_superseded", "n_elsewhere", "n_strained")
    rest = numbers("f8", "unexplained_sd", "since", "until", "untested_probability", "within_accuracy", "mismatch")
    before = [("superseded_until", "f8"), ("superseded", "i8", (max(largest, 1),))]
    before += [(name, "i8", (max(n_parameters, 1),)) for name in ("elsewhere", "strained")]
    return np.dtype([("time", "f8"), *head, *rest, *before, ("candidates", candidate, (most,))])
