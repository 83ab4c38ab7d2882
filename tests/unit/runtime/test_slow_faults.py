"""Faults that the healthy filter follows, or has learned from the first sample on: found by how far a parameter walks."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Detection, Diagnosis
from faultbond.runtime.fleet import Fleet
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from made import TANK_START, plant, samples_of
