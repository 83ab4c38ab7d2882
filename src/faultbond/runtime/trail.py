"""The last samples and healthy lanes, from which the bank begins at the alarm."""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Engine, EngineSpec

WILD = 5.0  # innovation in its sd that noise alone does not bring about
MOST_BURSTS = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trail:
    """The last samples and healthy lanes, oldest first: `samples` (n, n_sample), `lanes` (n, n_numbers).

    old : (n_numbers,), the healthy lane as it stood long ago, before a slow drift taught it wrongly; None: not kept
    alarm : place of the sample of the alarm; -1: the last one
    bursts : places at which innovations became wild
    """

    samples: FloatArray
    lanes: FloatArray
    old: FloatArray | None = None
    alarm: int = -1
    bursts: tuple[int, ...] = ()

    @property
    def alarmed(self) -> int:
        """Place of the sample of the alarm."""
        return self.alarm if self.alarm >= 0 else len(self.samples) - 1


def bursts(spec: EngineSpec, engine: Engine, samples: FloatArray, lanes: FloatArray) -> tuple[int, ...]:
    """Give the places at which innovations of the healthy filter became wild, the wildest if there are many.

    Parameters
    ----------
    spec, engine : the model
    samples, lanes : as in `Trail`, up to the alarm
    """
    wildness = np.zeros(len(samples))
    for place in range(1, len(samples)):
        _, innovations = engine.advance(lanes[place - 1][:, None], samples[place][None, :])
        wildness[place] = _wildest(spec, samples[place], innovations[0, :, 0])
    begins = np.flatnonzero(_begins(wildness > WILD))
    wildest = begins[np.argsort(-wildness[begins], kind="stable")[:MOST_BURSTS]]
    return tuple(int(place) for place in np.sort(wildest))


def _wildest(spec: EngineSpec, sample: FloatArray, innovations: FloatArray) -> float:
    """Give the largest innovation of a sample in its standard deviation."""
    n_y = len(spec.outputs)
    score = np.abs(innovations[:n_y]) / np.sqrt(innovations[n_y:])
    return float(np.max(np.where(sample[spec.sample_fields["use"]] > 0, score, 0.0), initial=0.0))


def _begins(wild: BoolArray) -> BoolArray:
    """Tell where runs of wild samples begin."""
    return np.asarray(wild & ~np.concatenate([[False], wild[:-1]]))
