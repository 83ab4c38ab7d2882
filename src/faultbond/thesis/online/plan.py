"""What the off-line part of method `classic` hands to the on-line part: functions, names, sets to test."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.thesis.online.settings import Settings
from faultbond.thesis.online.tape import NewtonTape, Program

Programs = tuple[tuple[Program | NewtonTape, tuple[int, ...]], ...]  # programs, and for each what its results are


@dataclass(frozen=True, slots=True, kw_only=True)
class Sides:
    """The law of a suspended component with the signals on its sides (thesis 4.2.2).

    equation: name of the law. parameters: indices of those that it depends on. inputs: indices of the inputs that reach
    it. formula: in words.
    """

    equation: str
    parameters: frozenset[int]
    inputs: frozenset[int]
    formula: str


@dataclass(frozen=True, kw_only=True)  # no slots: what follows from the fields is worked out once
class ClassicPlan:
    """All that the on-line part needs to know beside the `EngineSpec`.

    Parameters
    ----------
    settings : in force
    accuracy : the index n in force
    names : of the places of an environment: `dt`, parameters, signals by frame
    parameter_places : place of each parameter
    sample_places : for each input and output the place of each frame
    states : names of the signals that are states
    now, before, rates : places of each state in frame 0 and frame 1, and of its rate; -1 where there is none
    points : length of the parabola of each input and output
    from_samples : states from several samples; without those that measurements do not fix
    from_before : states from those one sample before
    expected : outputs from all other measurements, by routes on which stores integrate
    misfits : what is left over of each law in `sides`
    algebraic : whether an output is expected without passing a state
    sides : laws of suspended components
    uses : for each tested set the sides that it is estimated from
    tested : sets of parameters that are tested
    hypotheses : sets of parameters that are reasoned about, those of the specification
    formulas : all functions in words, for people
    """

    settings: Settings
    accuracy: float
    names: tuple[str, ...]
    parameter_places: tuple[int, ...]
    sample_places: tuple[tuple[int, ...], ...]
    states: tuple[str, ...]
    now: tuple[int, ...]
    before: tuple[int, ...]
    rates: tuple[int, ...]
    points: tuple[int, ...]
    from_samples: Programs
    from_before: Programs
    expected: Programs
    misfits: Programs
    algebraic: tuple[bool, ...]
    sides: tuple[Sides, ...]
    uses: tuple[tuple[int, ...], ...]
    tested: tuple[tuple[int, ...], ...]
    hypotheses: tuple[tuple[int, ...], ...]
    formulas: tuple[tuple[str, str], ...]

    @property
    def depth(self) -> int:
        """Number of frames of samples that are kept."""
        return len(self.sample_places[0]) if self.sample_places else 1

    @property
    def delay(self) -> int:
        """Samples by which the method lags: half the longest parabola."""
        return max(item // 2 for item in (1, *self.points))

    @property
    def n_lanes(self) -> int:
        """The healthy model and one model for each tested set."""
        return 1 + len(self.tested)

    @cached_property
    def n_slots(self) -> int:
        """Size of the largest tested set."""
        return max((len(item) for item in self.tested), default=0)

    @cached_property
    def slots(self) -> FloatArray:
        """Index of the parameter in each slot of each lane, shape (n_slots, n_lanes); -1: empty."""
        found = np.full((self.n_slots, self.n_lanes), -1.0)
        for lane, chosen in enumerate(self.tested, start=1):
            found[: len(chosen), lane] = chosen
        found.setflags(write=False)
        return found

    @cached_property
    def contains(self) -> BoolArray:
        """Whether a tested set contains a hypothesis, shape (n_hypotheses, n_tested)."""
        largest = [frozenset(item) for item in self.tested]
        found = np.array([[other.issuperset(item) for other in largest] for item in self.hypotheses], dtype=bool)
        found = found.reshape(len(self.hypotheses), len(self.tested))
        found.setflags(write=False)
        return found

    @cached_property
    def used(self) -> BoolArray:
        """Whether a lane is estimated from a law, shape (n_sides, n_lanes)."""
        found = np.zeros((len(self.sides), self.n_lanes), dtype=bool)
        for lane, chosen in enumerate(self.uses, start=1):
            found[list(chosen), lane] = True
        found.setflags(write=False)
        return found
