"""The core of a model, compiled: a library that is called through ctypes on numpy arrays, without copies.

`core/fb.h` says what it offers. The interpreter lock is released during a call; a `Monitor` is one thread's at a time.
"""

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import FloatArray
from faultbond.contract.findings import MAX_CANDIDATES, MOST_RIVALS
from faultbond.contract.spec import EngineSpec
from faultbond.errors import GenerationError
from faultbond.types import CheckKind, FaultKind

LANES = 8  # of a call, or some times as many: all widths of a compiled core divide it
_LINE = 64  # bytes of a cache line, at which memory for a core begins
_NOWHERE = slice(0, 0)  # no numbers
_INT, _REAL = "<i8", "<f8"

Memory = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """Where numbers stand in a state: bytes from its beginning, how many, and whether they are whole."""

    offset: int
    count: int
    whole: bool


@dataclass(frozen=True, kw_only=True, eq=False)  # no slots: layouts are worked out once
class Core:
    """A compiled core and the layout of what it reads and writes.

    wide : whether `advance` runs lanes with a slot
    """

    library: ctypes.CDLL
    spec: EngineSpec
    compiler: str
    wide: bool = False

    @property
    def title(self) -> str:
        """What it is, in words."""
        return f"compiled C ({self.compiler})"

    @cached_property
    def slot(self) -> "Core":
        """The same for lanes with a slot."""
        return replace(self, wide=True)

    @cached_property
    def report(self) -> np.dtype[Any]:
        """Layout of `Report` in `found.h`."""
        n_y, n_slow = len(self.spec.outputs), len(self.spec.slow_errors)
        whole = [(name, _INT) for name in ("status", "wild", "detected", "due")]
        wide = [(name, _REAL, (n_y,)) for name in ("expected", "variance", "cusum")]
        return np.dtype([*whole, ("left_out", _INT, (n_y,)), *wide, ("slow", _REAL, (max(n_slow, 1),))])

    @cached_property
    def candidate(self) -> np.dtype[Any]:
        """Layout of `Candidate` in `found.h`."""
        spec = self.spec
        forecast = np.dtype([(name, _REAL) for name in ("limit", "time", "earliest", "latest")])
        most_limits = max((len(item.limits) for item in spec.parameters), default=0)
        suspect = np.dtype(
            [
                *((name, _INT) for name in ("parameter", "input", "output", "word")),
                *(
                    (name, _REAL)
                    for name in ("nominal", "estimate", "sd", "rate", "rate_sd", "began", "ended", "moved", "stopped")
                ),
                ("n_forecasts", _INT),
                ("forecasts", forecast, (max(most_limits, 1),)),
            ]
        )
        n_kinds = len(FaultKind)
        return np.dtype(
            [
                *((name, _INT) for name in ("hypothesis", "lane", "group", "present", "n_kinds")),
                ("kinds", _INT, (n_kinds,)),
                ("n_suspects", _INT),
                ("probability", _REAL),
                ("shares", _REAL, (n_kinds,)),
                ("suspects", suspect, (_largest(spec),)),
            ]
        )

    @cached_property
    def diagnosis(self) -> np.dtype[Any]:
        """Layout of `Diagnosis` in `found.h`."""
        return np.dtype(
            [
                ("time", _REAL),
                *(
                    (name, _INT)
                    for name in (
                        "n_candidates",
                        "is_over",
                        "is_unexplained",
                        "has_untested",
                        "untested_sets",
                        "signal",
                        "n_superseded",
                        "n_elsewhere",
                        "n_strained",
                    )
                ),
                *(
                    (name, _REAL)
                    for name in (
                        "unexplained_sd",
                        "since",
                        "until",
                        "untested_probability",
                        "within_accuracy",
                        "mismatch",
                        "superseded_until",
                    )
                ),
                ("superseded", _INT, (_largest(self.spec),)),
                *((name, _INT, (max(len(self.spec.parameters), 1),)) for name in ("elsewhere", "strained")),
                ("candidates", self.candidate, (min(max(self.spec.n_hypotheses, 1), MAX_CANDIDATES),)),
            ]
        )

    @cached_property
    def advice(self) -> np.dtype[Any]:
        """Layout of `Advice` in `found.h`."""
        spec = self.spec
        check = np.dtype(
            [
                *((name, _INT) for name in ("kind", "target", "n_groups")),
                ("group", _INT, (MOST_RIVALS,)),
                *((name, _REAL) for name in ("gain", "cost", "value", "within")),
            ]
        )
        looks = min(MOST_RIVALS * _largest(spec), len(spec.parts))
        most = looks + len(spec.inputs) + len(spec.checked(CheckKind.SIGNAL))
        return np.dtype([*((name, _INT) for name in ("n_checks", "n_rivals")), ("checks", check, (most,))])

    @cached_property
    def fields(self) -> Mapping[str, Field]:
        """The numbers of a state by name, such as `clock.index`."""
        name = ctypes.c_char_p()
        offset, count, whole = (ctypes.c_int64() for _ in range(3))
        found: dict[str, Field] = {}
        while self.library.fb_field(
            len(found), ctypes.byref(name), ctypes.byref(offset), ctypes.byref(count), ctypes.byref(whole)
        ):
            key = (name.value or b"").decode()
            found[key] = Field(offset=offset.value, count=count.value, whole=bool(whole.value))
        return found

    @cached_property
    def sizes(self) -> Mapping[str, int]:
        """Bytes of a state, of the memory of a call, of a saved state, and of what calls give, by name."""
        return {name: int(getattr(self.library, f"fb_{name}_size")()) for name in _SIZES}

    @cached_property
    def work(self) -> Memory:
        """Memory for calls that are made one after the other."""
        return memory(self.sizes["work"])

    def healthy_lane(self, mean: FloatArray, covariance: FloatArray, known: FloatArray | None = None) -> FloatArray:
        """Give the lane, (n_numbers, 1), of a healthy plant.

        Parameters
        ----------
        mean : float array, shape (n_states,)
        covariance : float array, shape (n, n)
            Of the states, or of states, slow errors and parameters, as `solve_start` gives it.
        known : float array, shape (n_numbers, 1)
            A lane whose parameters and sizes of slow errors hold; None: the nominal ones do.
        """
        lane = np.zeros((self.spec.n_numbers, 1))
        parts = [np.ascontiguousarray(part, dtype=np.float64) for part in (mean, covariance)]
        held = None if known is None else np.ascontiguousarray(known, dtype=np.float64)
        self.library.fb_healthy_lane(
            at(parts[0]), at(parts[1]), len(parts[1]), None if held is None else at(held), at(lane)
        )
        return lane

    def solve_start(
        self, samples: FloatArray, known: FloatArray | None = None, *, again: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Give the states before the first of some packed samples, (n_states,), SI, and a covariance (n, n).

        The latter is that of states, slow errors and parameters: a start that was found with parameters that are off is
        off with them.

        Parameters
        ----------
        samples : float array, shape (n_samples, n_sample)
            The first some three hundred of them are used.
        known : float array, shape (n_numbers, 1)
            See `healthy_lane`.
        again : whether the plant has run before, so that what the model says of the start does not hold
        """
        n_x, n = len(self.spec.states), self.spec.parameter_slice.stop
        mean, covariance = np.zeros(max(n_x, 1)), np.zeros((n, n))
        rows = np.ascontiguousarray(samples, dtype=np.float64)
        held = None if known is None else np.ascontiguousarray(known, dtype=np.float64)
        self.library.fb_solve_start(
            at(self.work), len(rows), at(rows), None if held is None else at(held), int(again), at(mean), at(covariance)
        )
        return mean[:n_x], covariance

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes (n_numbers, n_lanes) over a block of samples (n_samples, n_sample); see `Engine.advance`."""
        if lanes.shape[1] == 1 and not self.wide:
            lane, _, told = self.course(lanes, samples)
            return lane, told[:, :, None]
        call = self.library.fb_advance_wide if self.wide else self.library.fb_advance_plain
        return self._through(call, lanes, samples)

    def follow(self, lanes: FloatArray, samples: FloatArray) -> FloatArray:
        """Give what the sensors of plants (n_numbers, n_lanes) that nobody watches would read, SI.

        Parameters
        ----------
        lanes : float array, shape (n_numbers, n_lanes)
            Of states, slow errors, parameters and implicit signals alone; the rest is not looked at.
        samples : float array, shape (n_samples, n_sample)
            Packed; their readings count as nothing.

        Returns
        -------
        readings : float array, shape (n_samples, n_outputs, n_lanes)
        """
        rows = samples.copy()
        rows[:, self.spec.sample_fields["y"]] = 0.0
        return -self._through(self.library.fb_follow, lanes, rows)[1][:, : len(self.spec.outputs)]

    def _through(self, call: Any, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give lanes after a call that takes a block of samples into them, and what it tells of each sample."""
        n, numbers, rows = lanes.shape[1], padded(lanes), np.ascontiguousarray(samples, dtype=np.float64)
        told = np.empty((len(rows), 2 * len(self.spec.outputs), numbers.shape[1]))
        call(numbers.shape[1], len(rows), at(rows), at(numbers), at(told), at(self.work))
        return np.ascontiguousarray(numbers[:, :n]), told[:, :, :n]

    def course(
        self, lane: FloatArray, samples: FloatArray, place: slice = _NOWHERE
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Filter one lane (n_numbers, 1) without a slot, and give some of its numbers after each sample.

        Returns
        -------
        lane : float array, shape (n_numbers, 1); after all samples
        numbers : float array, shape (n_samples, n); those of the `place`
        innovations : float array, shape (n_samples, 2 * n_outputs)
        """
        rows, numbers = np.ascontiguousarray(samples, dtype=np.float64), lane.copy()
        found, told = np.empty((len(rows), place.stop - place.start)), np.empty((len(rows), 2 * len(self.spec.outputs)))
        self.library.fb_course(
            len(rows), at(rows), at(numbers), place.start, found.shape[1], at(found), at(told), at(self.work)
        )
        return numbers, found, told


def padded(lanes: FloatArray) -> FloatArray:
    """Give a copy of lanes (n_numbers, n), so many that all widths divide them: spare ones repeat the first."""
    spare = -lanes.shape[1] % LANES
    return np.ascontiguousarray(np.concatenate([lanes, np.repeat(lanes[:, :1], spare, axis=1)], axis=1))


def _largest(spec: EngineSpec) -> int:
    """Give the size of the largest set of suspects."""
    return max(map(len, (*spec.hypotheses, *spec.reserve, *spec.mixed, *spec.both)), default=1)


def at(array: NDArray[Any]) -> int:
    """Give the address of the first number of an array (n,) or (m, n); the array must live until the call is over."""
    return array.ctypes.data


def memory(size: int) -> Memory:
    """Give memory (size,) of zeros that begins where a cache line does."""
    whole = np.zeros(size + _LINE, dtype=np.uint8)
    first = -whole.ctypes.data % _LINE
    return whole[first : first + size]


_SIZES = ("state", "work", "saved", "report", "diagnosis", "candidate", "advice")
_POINTER, _LONG, _DOUBLE = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_CALLS: dict[str, tuple[Any, tuple[Any, ...]]] = {  # result and arguments
    **{f"fb_{name}_size": (_LONG, ()) for name in _SIZES},
    "fb_init": (None, (_POINTER, _DOUBLE, _LONG)),
    "fb_resume": (None, (_POINTER,)),
    "fb_block": (_LONG, (_POINTER, _POINTER, _LONG, *[_POINTER] * 6)),
    "fb_step": (_LONG, (_POINTER,) * 5),
    "fb_diagnosis": (None, (_POINTER, _POINTER, _POINTER)),
    "fb_advice": (None, (_POINTER,) * 4),
    "fb_sure": (_LONG, (_POINTER, _POINTER, _DOUBLE)),
    "fb_accept": (_LONG, (_POINTER, _POINTER, _LONG, _POINTER)),
    "fb_repair": (_LONG, (_POINTER, _POINTER, _LONG, _POINTER)),
    "fb_reject": (_LONG, (_POINTER, _POINTER, _LONG, _POINTER)),
    "fb_save": (None, (_POINTER, _POINTER)),
    "fb_restore": (_LONG, (_POINTER, _POINTER, _LONG)),
    "fb_field": (_LONG, (_LONG, *[_POINTER] * 4)),
    "fb_lane": (None, (_POINTER, _LONG, _POINTER)),
    "fb_row": (None, (_POINTER, _LONG, _POINTER)),
    "fb_pack": (_LONG, (_POINTER, _DOUBLE, _DOUBLE, *[_POINTER] * 3)),
    "fb_healthy_lane": (None, (_POINTER, _POINTER, _LONG, _POINTER, _POINTER)),
    "fb_solve_start": (_LONG, (_POINTER, _LONG, _POINTER, _POINTER, _LONG, _POINTER, _POINTER)),
    "fb_go_on": (None, (_POINTER, _POINTER)),
    "fb_advance_plain": (None, (_LONG, _LONG, *[_POINTER] * 4)),
    "fb_advance_wide": (None, (_LONG, _LONG, *[_POINTER] * 4)),
    "fb_follow": (None, (_LONG, _LONG, *[_POINTER] * 4)),
    "fb_course": (None, (_LONG, _POINTER, _POINTER, _LONG, _LONG, *[_POINTER] * 3)),
}
_FLEET_CALLS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "fb_fleet_size": (_LONG, (_LONG,)),
    "fb_fleet_work_size": (_LONG, ()),
    "fb_fleet_init": (None, (_POINTER, _POINTER, _LONG, _DOUBLE, _LONG)),
    "fb_fleet_repeat": (None, (_POINTER, _POINTER)),
    "fb_fleet_begin": (_LONG, (_POINTER, _LONG, _POINTER, _POINTER)),
    "fb_fleet_watch_all": (None, (_POINTER, _POINTER, *[_LONG] * 3, *[_POINTER] * 3)),
    "fb_fleet_end": (None, (_POINTER, _LONG)),
    "fb_fleet_leave": (None, (_POINTER, _LONG, _POINTER, _POINTER)),
    "fb_fleet_return": (_LONG, (_POINTER, _LONG, _POINTER)),
}


def load_core(path: Path, spec: EngineSpec, compiler: str) -> Core:
    """Load the compiled core of a model.

    Raises
    ------
    GenerationError
        Where the library cannot be loaded on this machine, or is not one of this model.
    """
    try:
        library = ctypes.CDLL(str(path))
        fleets = _FLEET_CALLS if hasattr(library, "fb_fleet_size") else {}
        for name, (result, arguments) in (_CALLS | fleets).items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as problem:
        raise GenerationError(f"{path}: the compiled core cannot be loaded ({problem}); remove it") from problem
    core = Core(library=library, spec=spec, compiler=compiler)
    for name in ("report", "diagnosis", "candidate", "advice"):
        if core.sizes[name] != getattr(core, name).itemsize:
            raise GenerationError(f"{path}: the compiled core is of another model or version; remove it")
    return core
