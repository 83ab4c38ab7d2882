"""Closed forms as short programs on numbers: the on-line part of the thesis' generated functions (4.3).

A program is plain data, made off-line from expressions, so that nothing is parsed or executed as text beside the plant.
Its registers are first the arguments, then the constants, then one result for each instruction.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faultbond.arrays import BoolArray, FloatArray

Instruction = tuple[str, tuple[int, ...]]  # what is done, and the registers it is done to

OPERATIONS: dict[str, Callable[..., FloatArray]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": np.power,
    "negative": np.negative,
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "where": np.where,
    "min": np.minimum,
    "max": np.maximum,
    "abs": np.abs,
    "sign": np.sign,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "tanh": np.tanh,
    "atanh": np.arctanh,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One root: the registers of its results, and those that must not be negative (or must be positive: True)."""

    results: tuple[int, ...]
    conditions: tuple[tuple[int, bool], ...] = ()


@dataclass(frozen=True, kw_only=True)  # no slots: constants are made arrays once
class Program:
    """Instructions that give one or more results; of several roots the first that holds counts.

    arguments: places in the environment. constants: literal numbers.
    """

    arguments: tuple[int, ...]
    constants: tuple[float, ...]
    code: tuple[Instruction, ...]
    outcomes: tuple[Outcome, ...]

    @cached_property
    def numbers(self) -> tuple[FloatArray, ...]:
        """The constants as arrays of shape (1,)."""
        return tuple(np.array([value]) for value in self.constants)


@dataclass(frozen=True, slots=True, kw_only=True)
class NewtonTape:
    """A function without a closed form: its program gives as many misfits as there are guesses, then its results.

    guessed: places of the guesses. starts: places at which to begin, -1 where there is none. about: where the guesses
    are in the nominal plant.
    """

    program: Program
    guessed: tuple[int, ...]
    starts: tuple[int, ...]
    about: tuple[float, ...]


def run_program(program: Program, environment: Sequence[FloatArray]) -> FloatArray:
    """Run a program for all lanes at once.

    Where no root holds, as when noise turns the sign of a flow that stands still, the first is taken as it is.

    Parameters
    ----------
    program : what is computed
    environment : an array for each place, of shape (n_lanes,) or (1,)

    Returns
    -------
    float array, shape (n_results, n_lanes) or (n_results, 1)
        nan where there is no real value; the caller silences warnings of numpy
    """
    registers: list[FloatArray] = [environment[place] for place in program.arguments]
    registers += program.numbers
    for name, operands in program.code:
        registers.append(OPERATIONS[name](*[registers[k] for k in operands]))
    found = _results(registers, program.outcomes[0])
    if len(program.outcomes) == 1:
        return found
    for outcome in reversed(program.outcomes):
        other = _results(registers, outcome)
        met: BoolArray = np.array([True])
        for place, strict in outcome.conditions:
            met = met & (registers[place] > 0.0 if strict else registers[place] >= 0.0)
        found = np.where(met & np.isfinite(other).all(axis=0), other, found)
    return found


def _results(registers: Sequence[FloatArray], outcome: Outcome) -> FloatArray:
    found = [registers[k] for k in outcome.results]
    if len({value.shape for value in found}) > 1:
        found = list(np.broadcast_arrays(*found))
    return np.array(found)
