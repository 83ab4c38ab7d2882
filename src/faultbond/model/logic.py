"""Logic networks as data: gates between named signals, and what was observed of them.

Gates fail in the weak sense: an abnormal gate's output is anything, anew in every observation.
Source: thesis 3.6 (full adder); Reiter 1987; the formats are told in docs/commands.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

SignalValues = Mapping[str, bool]  # of the signals that were observed
GateSet = frozenset[str]  # names of abnormal gates: a diagnosis


class GateFunction(Enum):
    """What a healthy gate makes of its inputs; xor is true where an odd number of inputs is, xnor where an even one."""

    AND = "and"
    OR = "or"
    NAND = "nand"
    NOR = "nor"
    XOR = "xor"
    XNOR = "xnor"
    NOT = "not"
    BUFFER = "buffer"

    @property
    def is_unary(self) -> bool:
        """Whether the gate has exactly one input."""
        return self in (GateFunction.NOT, GateFunction.BUFFER)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """A gate of the component `name`; gates of one name fail together. A trusted gate never fails."""

    name: str
    function: GateFunction
    output: str
    inputs: tuple[str, ...]
    trusted: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LogicNetwork:
    """Gates in any order, between signals by name; `inputs` drive it, `outputs` are the signals meant to be seen."""

    name: str
    gates: tuple[Gate, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def suspects(self) -> tuple[str, ...]:
        """Components that may fail, each once."""
        return tuple(dict.fromkeys(gate.name for gate in self.gates if not gate.trusted))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimedObservation:
    """What was seen at a time, in seconds."""

    time: float
    values: SignalValues


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scenario:
    """Observations of a circuit in the order of time, with the truth where it is known.

    `injected` are the gates that were made faulty; `diagnoses` all true diagnoses of minimum cardinality, None where
    the file does not tell; `normalization` is the score of the best possible answer before it is scaled to 1.
    """

    name: str
    observations: tuple[TimedObservation, ...]
    injected: GateSet = frozenset()
    cardinality: int | None = None
    diagnoses: tuple[GateSet, ...] | None = None
    normalization: float | None = None
