"""From which size on a change is claimed: a smaller one is as likely that of a healthy plant, however well it shows.

Source: `core/within.h`, docs/method.md#8-the-bank, "within the accuracy", with all variance of the estimate gone.
"""

from math import inf, log, sqrt

import numpy as np

from faultbond.contract.core_settings import core_settings
from faultbond.contract.slots import BIASES, INPUT_BIASES
from faultbond.contract.spec import EngineSpec

CERTAINTY = 0.95  # with which it is a fault, and no healthy change


def claimed_size(healthy: float, faulty: float) -> float:
    """Give the change from which on it is that of a faulty part with `CERTAINTY`; inf: it never is.

    healthy, faulty : standard deviations of what a healthy and a faulty part may change by, in one unit
    """
    if healthy <= 0.0:
        return 0.0
    if healthy >= faulty:
        return inf
    odds = log(CERTAINTY / (1.0 - CERTAINTY)) + log(faulty / healthy)
    return sqrt(2.0 * odds / (healthy**-2.0 - faulty**-2.0))


def claimed_parameter(spec: EngineSpec, number: int) -> float:
    """Give that size of a parameter, SI; of one that goes with others, beside what these let expect of it."""
    item = spec.parameters[number]
    accuracy = item.accuracy
    if spec.correlations and accuracy > 0.0:
        accuracy = float(np.linalg.pinv(spec.prior, hermitian=True)[number, number]) ** -0.5
    healthy = max(core_settings()["MOVES_BY"] * accuracy, item.healthy_change)
    return abs(item.scale) * claimed_size(healthy, item.change)


def claimed_bias(spec: EngineSpec, number: int, *, is_output: bool, largest: float = 1.0) -> float:
    """Give that size of the bias of a sensor or an input, SI; `largest`: the size that the input reaches."""
    item = spec.outputs[number] if is_output else spec.inputs[number]
    faulty = BIASES[-1] * item.noise if is_output else INPUT_BIASES[-1] * largest
    return claimed_size(item.healthy_bias, faulty)
