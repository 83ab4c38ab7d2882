"""Newton's method on a torn function, for all lanes at once; a fixed number of safeguarded steps."""

from collections.abc import Sequence

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.thesis.online.tape import NewtonTape, run_program

STEPS = 40
HALVINGS = 8
SLOPE_STEP = 1e-7  # of a guess
CLOSE = 1e-9  # of a guess; a smaller step is none


def solve_torn(search: NewtonTape, environment: Sequence[FloatArray], lanes: int) -> FloatArray:
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
    count = len(search.guessed)
    scale = np.maximum(np.abs(np.array(search.about)), 1e-12)[:, None]
    guess = np.repeat(np.array(search.about, dtype=float)[:, None], lanes, axis=1)
    for k, place in enumerate(search.starts):  # where the signals were one frame earlier, if that is known
        if place >= 0:
            guess[k] = np.where(np.isfinite(environment[place]), environment[place], guess[k])

    def run(guess: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give misfits, then results, (n_guessed + n_results, n_lanes), and the largest misfit of each lane."""
        filled = list(environment)
        for place, values in zip(search.guessed, guess, strict=True):
            filled[place] = values
        height = len(search.program.outcomes[0].results)
        found = np.asarray(np.broadcast_to(run_program(search.program, filled), (height, lanes)))
        misfits = found[:count]
        return found, np.where(np.isfinite(misfits).all(axis=0), np.abs(misfits).max(axis=0), np.inf)

    found, size = run(guess)
    done = np.zeros(lanes, dtype=bool)
    for _ in range(STEPS):
        slopes = np.empty((lanes, count, count))
        for k in range(count):
            step = SLOPE_STEP * np.maximum(np.abs(guess[k]), scale[k])
            moved = guess.copy()
            moved[k] += step
            slopes[:, :, k] = ((run(moved)[0][:count] - found[:count]) / step).T
        change = _newton_step(slopes, found[:count])
        # The whole step, or half of it, or a quarter, ..., until the misfits shrink.
        part, open_, before = 1.0, np.ones(lanes, dtype=bool), size
        for _ in range(HALVINGS):
            trial = guess + part * change
            there, smaller = run(trial)
            better = open_ & (smaller < before)
            guess, found = np.where(better, trial, guess), np.where(better, there, found)
            size = np.where(better, smaller, size)
            open_ = open_ & ~better
            if not open_.any():
                break
            part /= 2.0
        small = np.all(np.abs(change) <= CLOSE * np.maximum(np.abs(guess), scale), axis=0)
        done = done | small | (size == 0.0)
        if np.all(done | open_):
            break
    return np.where(done, found[count:], np.nan)


def _newton_step(slopes: FloatArray, misfits: FloatArray) -> FloatArray:
    """Give the change of the guesses (n_guessed, n_lanes), nan where there is none; slopes (n_lanes, n, n_guessed)."""
    usable: BoolArray = np.asarray(np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(misfits).all(axis=0))
    safe = np.where(usable[:, None, None], slopes, np.eye(len(misfits)))
    regular = np.abs(np.linalg.det(safe)) > 0.0
    safe = np.where(regular[:, None, None], safe, np.eye(len(misfits)))
    change = -np.linalg.solve(safe, misfits.T[:, :, None])[:, :, 0].T
    return np.where(usable & regular, change, np.nan)
