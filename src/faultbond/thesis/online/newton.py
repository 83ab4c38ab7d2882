"""Newton's method on a torn function, for all lanes at once; a fixed number of safeguarded steps."""

from collections.abc import Sequence

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.thesis.online.tape import NewtonTape, Program, evaluate

STEPS = 40
HALVINGS = 8
SLOPE_STEP = 1e-7  # of a guess
CLOSE = 1e-9  # of a guess; a smaller step is none


def solve(search: NewtonTape, environment: Sequence[FloatArray], lanes: int) -> FloatArray:
    """Give the results of a torn function.

    Parameters
    ----------
    search : what is guessed, where it is about, and the program that gives misfits and results
    environment : an array for each place, of shape (n_lanes,) or (1,); those of the guesses are set here
    lanes : number of models

    Returns
    -------
    float array, shape (n_results, n_lanes)
        nan where no solution was found; the caller silences warnings of numpy
    """
    scale = np.maximum(np.abs(np.array(search.about)), 1e-12)[:, None]
    guess = _first(search, environment, lanes)
    found = _run(search, environment, guess)
    done = np.zeros(lanes, dtype=bool)
    for _ in range(STEPS):
        change = _newton(search, environment, guess, found, scale)
        guess, found, moved = _damped(search, environment, guess, found, change)
        small = np.all(np.abs(change) <= CLOSE * np.maximum(np.abs(guess), scale), axis=0)
        done = done | small | (_size(search, found) == 0.0)
        if np.all(done | ~moved):
            break
    return np.where(done, found[len(search.guessed) :], np.nan)


def _first(search: NewtonTape, environment: Sequence[FloatArray], lanes: int) -> FloatArray:
    """Begin where the signals were one frame earlier, or where they are in the nominal plant."""
    found = np.repeat(np.array(search.about, dtype=float)[:, None], lanes, axis=1)
    for k, place in enumerate(search.starts):
        if place >= 0:
            found[k] = np.where(np.isfinite(environment[place]), environment[place], found[k])
    return found


def _run(search: NewtonTape, environment: Sequence[FloatArray], guess: FloatArray) -> FloatArray:
    """Give misfits, then results, (n_guessed + n_results, n_lanes)."""
    filled = list(environment)
    for place, values in zip(search.guessed, guess, strict=True):
        filled[place] = values
    return np.asarray(np.broadcast_to(evaluate(search.program, filled), (_height(search.program), guess.shape[1])))


def _height(program: Program) -> int:
    return len(program.outcomes[0].results)


def _size(search: NewtonTape, found: FloatArray) -> FloatArray:
    misfits = found[: len(search.guessed)]
    return np.where(np.isfinite(misfits).all(axis=0), np.abs(misfits).max(axis=0), np.inf)


def _newton(
    search: NewtonTape, environment: Sequence[FloatArray], guess: FloatArray, found: FloatArray, scale: FloatArray
) -> FloatArray:
    """Give the Newton step; nan where there is none."""
    count = len(search.guessed)
    slopes = np.empty((guess.shape[1], count, count))
    for k in range(count):
        step = SLOPE_STEP * np.maximum(np.abs(guess[k]), scale[k])
        moved = guess.copy()
        moved[k] += step
        slopes[:, :, k] = ((_run(search, environment, moved)[:count] - found[:count]) / step).T
    usable: BoolArray = np.asarray(np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(found[:count]).all(axis=0))
    safe = np.where(usable[:, None, None], slopes, np.eye(count))
    regular = np.abs(np.linalg.det(safe)) > 0.0
    safe = np.where(regular[:, None, None], safe, np.eye(count))
    change = -np.linalg.solve(safe, found[:count].T[:, :, None])[:, :, 0].T
    return np.where(usable & regular, change, np.nan)


def _damped(
    search: NewtonTape, environment: Sequence[FloatArray], guess: FloatArray, found: FloatArray, change: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Take the whole step, or half of it, or a quarter, ..., until the misfits shrink; tell which lanes moved."""
    part, open_ = 1.0, np.ones(guess.shape[1], dtype=bool)
    before = _size(search, found)
    for _ in range(HALVINGS):
        trial = guess + part * change
        there = _run(search, environment, trial)
        better = open_ & (_size(search, there) < before)
        guess = np.where(better, trial, guess)
        found = np.where(better, there, found)
        open_ = open_ & ~better
        if not open_.any():
            break
        part /= 2.0
    return guess, found, ~open_
