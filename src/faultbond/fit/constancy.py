"""Whether the parameters stay the same over a recording, as those of a healthy plant do.

The scores of a parameter that stays the same add up to a bridge: away from zero at random, and back. One that changes
drives the sum far away, farthest at the change.

Source: Hjort and Koning, J. Nonparametric Statistics 14 (2002) 113 (tests of constancy from scores).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.fit.certainty import long_run_variance
from faultbond.fit.objective import FittedPlant, Scored
from faultbond.fit.samples import HealthyRecording

SURE = 2.2  # largest value of a Brownian bridge; one in 8000 goes farther
SHORT = 0.01  # of a recording: scores that are alike for longer are not the same all the time
LEAST = 50  # samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A parameter that does not stay the same: in which recording, about when (s), and the statistic (1.6: 1 %)."""

    parameter: str
    recording: str
    time: float
    statistic: float


def changes_of(
    plant: FittedPlant, records: Sequence[HealthyRecording], courses: Sequence[Scored]
) -> tuple[Change, ...]:
    """Give the parameters that do not stay the same, the surest first."""
    found: list[Change] = []
    for record, seen in zip(records, courses, strict=True):
        if len(seen.scores) < LEAST:
            continue
        for k, item in enumerate(plant.unknowns.parameters):
            scores = seen.scores[:, k] - seen.scores[:, k].mean()
            variance = float(long_run_variance(scores[:, None], SHORT)[0, 0])
            if variance <= 0.0:
                continue
            bridge = np.abs(np.cumsum(scores)) / np.sqrt(variance)
            place = int(np.argmax(bridge))
            if bridge[place] > SURE:
                time, statistic = float(record.time[place]), float(bridge[place])
                found.append(Change(parameter=item.name, recording=record.name, time=time, statistic=statistic))
    return tuple(sorted(found, key=lambda change: change.statistic, reverse=True))
