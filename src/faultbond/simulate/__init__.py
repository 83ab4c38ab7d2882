"""Plant simulation: what a real plant would have recorded, faults and imperfections included."""

from faultbond.simulate.record import Inputs, Policy, Simulation, columns, simulate
from faultbond.simulate.truth import Effects, Fault, fault_in_si

__all__ = ["Effects", "Fault", "Inputs", "Policy", "Simulation", "columns", "fault_in_si", "simulate"]
