"""Plant simulation: what a real plant would have recorded, faults and imperfections included.

In: a bond graph, its inputs (`signals` makes some) and faults. Out: a `Simulation`, the recording and the truth behind.
Read `truth`, `instruments`, `integrate`, `record`.
"""

from faultbond.simulate.record import Decide, Inputs, Policy, Simulation, columns, simulate
from faultbond.simulate.signals import random_steps, sines
from faultbond.simulate.truth import Effects, Fault, fault_in_si

__all__ = [
    "Decide",
    "Effects",
    "Fault",
    "Inputs",
    "Policy",
    "Simulation",
    "columns",
    "fault_in_si",
    "random_steps",
    "simulate",
    "sines",
]
