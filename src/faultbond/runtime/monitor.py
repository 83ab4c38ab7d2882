"""A monitor: the core of a model at work on one plant, with the state that it remembers."""

from ctypes import c_void_p
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import Advice, Candidate, Detection, Diagnosis, Walk
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.reserve import PER_SET, n_grown
from faultbond.contract.samples import Report, Reports, Sample, Samples
from faultbond.contract.spec import EngineSpec
from faultbond.errors import FaultbondError, RecordingError
from faultbond.runtime.candidates import advice_of, candidate_of, diagnosis_of
from faultbond.runtime.core import Core, at, memory
from faultbond.runtime.names import hypothesis_names

_NO_ALARM, _NO_SUCH_NUMBER = -1, -2
_ALARMS_ONLY = 2  # of `fb_init`
BEGIN_ANEW = "Delete its file to begin anew."
_REFUSED = {  # by what `fb_restore` gives
    -1: "this is no state of faultbond",
    -2: "the saved state was made by another version of faultbond",
    -3: "the saved state was made by another version of faultbond, or is of another model",
    -4: "the saved state is damaged",
}


class Monitor:
    """Watches one plant.

    Parameters
    ----------
    core : of the model
    saved : what another monitor saved; None begins anew
    time : of the beginning, s
    quiet : whether no alarm is ever raised
    only_alarms : whether the first alarm is the end: no lanes begin, which takes long where a bank is large

    Raises
    ------
    RecordingError
        Where what was saved is of another model or version, or damaged.
    """

    def __init__(
        self,
        core: Core,
        saved: NDArray[np.uint8] | None = None,
        *,
        time: float = 0.0,
        quiet: bool = False,
        only_alarms: bool = False,
    ) -> None:
        self.core, self.spec = core, core.spec
        self._state = memory(core.sizes["state"])
        self._work = memory(core.sizes["work"])
        self._found = np.zeros(1, core.diagnosis)
        self._candidate = np.zeros(1, core.candidate)
        self._advice = np.zeros(1, core.advice)
        self._row = np.zeros(2 + len(self.spec.inputs) + len(self.spec.outputs))
        self._report = np.zeros(1, core.report)
        addresses = (at(part) for part in (self._state, self._work, self._row, self._report, self._found))
        self._push = partial(core.library.fb_step, *map(c_void_p, addresses))
        plan = plan_lanes(self.spec)
        self._steps = plan.n_lanes + PER_SET * n_grown(self.spec)
        core.library.fb_init(at(self._state), time, _ALARMS_ONLY if only_alarms else int(quiet))
        if saved is not None:
            self._restore(np.ascontiguousarray(saved, dtype=np.uint8))

    def take(self, samples: Samples) -> Reports:
        """Take samples in order, up to one at which something is found; gives reports of those that were taken.

        Raises
        ------
        ValueError
            Where the samples have other numbers of inputs or sensors than the model.
        """
        n_u, n_y, count = len(self.spec.inputs), len(self.spec.outputs), len(samples)
        time, dt = (np.ascontiguousarray(values, dtype=np.float64) for values in (samples.time, samples.dt))
        u, y = (np.ascontiguousarray(values, dtype=np.float64) for values in (samples.u, samples.y))
        if (time.shape, dt.shape, u.shape, y.shape) != ((count,), (count,), (count, n_u), (count, n_y)):
            raise ValueError(f"samples of {n_u} inputs and {n_y} sensors are expected")
        rows = np.zeros(count, self.core.report)
        taken = self.core.library.fb_block(
            at(self._state), at(self._work), count, at(time), at(dt), at(u), at(y), at(rows), at(self._found)
        )
        return self._told(rows[:taken])

    def push(self, sample: Sample) -> bool:
        """Take one sample, and tell whether something was found; `report` says what, and all else that it brought."""
        row, n_u = self._row, len(sample.u)
        row[0], row[1], row[2 : 2 + n_u], row[2 + n_u :] = sample.time, sample.dt, sample.u, sample.y
        return bool(self._push())

    @property
    def report(self) -> Report:
        """What the last sample brought that was pushed."""
        return self._told(self._report).last

    @property
    def cusum(self) -> FloatArray:
        """Of `report` that alone, (n_outputs,)."""
        return np.array(self._report["cusum"][0], dtype=np.float64)

    def step(self, sample: Sample) -> Report:
        """Take one sample."""
        self.push(sample)
        return self.report

    def resume(self) -> None:
        """Expect a sample after a time of unknown length."""
        self.core.library.fb_resume(at(self._state))

    def conclude(self) -> Diagnosis:
        """Give the diagnosis of now, after a detection; without candidates where nothing is a suspect.

        Beginning all filters is spread over the samples after an alarm; where it is not done yet, it is done now.
        """
        self.core.library.fb_diagnosis(at(self._state), at(self._work), at(self._found))
        return diagnosis_of(self.spec, self._found[0])

    def finish(self) -> Diagnosis | None:
        """Give the last diagnosis, if a fault was detected; what is remembered stays as it is."""
        return self.copy().conclude() if self.number("clock.alarm") >= 0 else None

    def advise(self) -> tuple[Advice, ...]:
        """Give what to check next after the diagnosis that was given last, the best for its cost first."""
        self.core.library.fb_advice(at(self._state), at(self._work), at(self._found), at(self._advice))
        return advice_of(self.spec, self._advice[0], self._found[0])

    def sure(self, level: float) -> int | None:
        """Tell the rule of the diagnosis that was due, and give the hypothesis that it accepts now; None: none yet.

        Parameters
        ----------
        level : probability of a candidate from which it is sure
        """
        hypothesis = int(self.core.library.fb_sure(at(self._state), at(self._found), level))
        return hypothesis if hypothesis >= 0 else None

    def accept(self, hypothesis: int, *, repaired: bool = False) -> Candidate:
        """Take a hypothesis as the new healthy model, and give the candidate as it stood.

        Parameters
        ----------
        hypothesis : one of the candidates
        repaired : whether it was the fault and is mended, so that its suspects are as the model file says again

        Raises
        ------
        FaultbondError
            Where there is no alarm to explain, or it is not among the candidates.
        """
        library = self.core.library
        return self._decided(library.fb_repair if repaired else library.fb_accept, hypothesis)

    def reject(self, hypothesis: int) -> Candidate:
        """Rule a hypothesis out until the next alarm, with all sets that contain it, and give it as it stood.

        Raises
        ------
        FaultbondError
            Where there is no alarm to explain, it is not among the candidates, it is rejected already, or nothing would
            be left.
        """
        return self._decided(self.core.library.fb_reject, hypothesis)

    def save(self) -> NDArray[np.uint8]:
        """Give what is remembered, as bytes (n,)."""
        saved = np.zeros(self.core.sizes["saved"], dtype=np.uint8)
        self.core.library.fb_save(at(self._state), at(saved))
        return saved

    @property
    def address(self) -> int:
        """Where its state stands in memory, for calls of the core."""
        return at(self._state)

    def copy(self) -> "Monitor":
        """Give another monitor that remembers the same."""
        other = Monitor(self.core)
        other._state[:] = self._state
        return other

    def numbers(self, name: str) -> FloatArray:
        """Give numbers that are remembered, (n,), by their name in `fields.h`, such as `inputs.held`."""
        field = self.core.fields[name]
        part = self._state[field.offset : field.offset + 8 * field.count]
        return np.array(part.view(np.int64 if field.whole else np.float64), dtype=np.float64)

    def number(self, name: str) -> float:
        """Give the first of some numbers, see `numbers`."""
        return float(self.numbers(name)[0])

    @property
    def in_use(self) -> BoolArray:
        """Which sensors are used, (n_outputs,); one that was accepted as stuck is not."""
        return np.isfinite(self.numbers("normal.noise"))

    @property
    def is_outside(self) -> bool:
        """Whether the model did not hold at the last sample."""
        return self.number("clock.outside") > 0

    @property
    def knows_inputs(self) -> bool:
        """Whether no input has been missing for some samples, though it usually is told and does move."""
        settings = core_settings()
        lately = self.numbers("inputs.guessed") >= settings["UNKNOWN_FROM"]
        if not lately.any():
            return True
        restless = (self.numbers("inputs.leap") > 0.0) & (self.numbers("inputs.habit") > settings["RARELY"])
        return not np.any(restless & lately)

    def lane(self, number: int) -> FloatArray:
        """Give a lane of the bank, (n_numbers,) of plain lanes, which come first, or of those with a slot."""
        plain = number < self._steps
        lane = np.zeros(self.spec.n_numbers if plain else self.spec.slotted.n_numbers)
        self.core.library.fb_lane(at(self._state), number, at(lane))
        return lane

    def row(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Give one of the last samples by number: packed (n_sample,), and the healthy lane after it (n_numbers,)."""
        row = np.zeros(self.spec.n_sample + self.spec.n_numbers + 2)
        self.core.library.fb_row(at(self._state), number, at(row))
        return row[: self.spec.n_sample], row[self.spec.n_sample : -2]

    def pack(self, sample: Sample) -> FloatArray | None:
        """Give a sample as the filter takes it, (n_sample,), and learn its inputs only; None before all had a value."""
        packed = np.zeros(self.spec.n_sample)
        u, y = (np.ascontiguousarray(values, dtype=np.float64) for values in (sample.u, sample.y))
        ready = self.core.library.fb_pack(at(self._state), sample.time, sample.dt, at(u), at(y), at(packed))
        return packed if ready else None

    def go_on(self, lane: FloatArray) -> None:
        """Let the healthy filter go on from a lane (n_numbers, 1)."""
        numbers = np.ascontiguousarray(lane, dtype=np.float64)
        self.core.library.fb_go_on(at(self._state), at(numbers))

    def _told(self, rows: NDArray[Any]) -> Reports:
        """Give reports (n,) of the core, as it wrote them, with what was found at the last of them."""
        last = rows[-1:]
        return Reports(
            status=rows["status"].copy(),
            wild=rows["wild"].copy(),
            left_out=rows["left_out"] != 0,
            expected=rows["expected"].copy(),
            variance=rows["variance"].copy(),
            cusum=rows["cusum"].copy(),
            slow=rows["slow"][:, : len(self.spec.slow_errors)].copy(),
            detection=self._detection() if last["detected"].any() else None,
            diagnosis=diagnosis_of(self.spec, self._found[0]) if last["due"].any() else None,
        )

    def _detection(self) -> Detection:
        crossed = self.numbers("alarm.crossed") > 0
        return Detection(
            time=self.number("alarm.time"),
            sample=int(self.number("clock.alarm")),
            change_time=self.number("alarm.change_time"),
            signals=tuple(output.name for output, chosen in zip(self.spec.outputs, crossed, strict=True) if chosen),
            walk=self._walk(),
        )

    def _walk(self) -> Walk | None:
        walker = int(self.number("alarm.walker"))
        if walker < 0:
            return None
        window, name = int(self.number("alarm.window")) - core_settings()["WALKS"], self.spec.parameters[walker].name
        return Walk(parameter=name, sd=self.number("alarm.walk"), from_start=window == 0, together=window > 0)

    def _decided(self, call: Any, hypothesis: int) -> Candidate:
        refused = call(at(self._state), at(self._work), hypothesis, at(self._candidate))
        if refused:
            raise FaultbondError(_refusal(self.spec, hypothesis, refused))
        return candidate_of(self.spec, self._candidate[0])

    def _restore(self, saved: NDArray[np.uint8]) -> None:
        refused = self.core.library.fb_restore(at(self._state), at(saved), len(saved))
        if refused:
            raise RecordingError(f"{_REFUSED[refused]}. {BEGIN_ANEW}")


def _refusal(spec: EngineSpec, hypothesis: int, refused: int) -> str:
    """Say why a candidate cannot be accepted or rejected, by what the core gives (`decide.h`)."""
    if refused == _NO_ALARM:
        return "There is no alarm to explain, so nothing to accept or reject."
    if refused == _NO_SUCH_NUMBER:
        return f"{spec.model}: there is no candidate of the number {hypothesis}."
    names = ", ".join(sorted(hypothesis_names(spec, hypothesis)))
    return {
        -3: f"{names}: not among the candidates that are listed.",
        -4: f"{names}: rejected already, alone or with a set that it contains.",
        -5: f"{names}: the last hypothesis cannot be rejected, and all that are left contain this.",
    }[refused]
