"""The bond graph, or the block network, as the user states it: names, laws, units, lines.

All numbers are SI; percent stays percent. Every field is resolved: laws carry full signal names (`pipe.f`, not `f`;
signals of blocks have no dot), defaults are filled in and listed in `BondGraph.defaults`, units are checked. Made by
`faultbond.model.text` or `faultbond.model.builder` only.
Source: thesis 3.2 (bond graphs), 3.4 to 3.9 (blocks); docs/model-file.md (keys and rules).
"""

import hashlib
import math
from dataclasses import dataclass

from faultbond.model.expression import RATE, Call, Expression, Name, names
from faultbond.types import CheckKind, ElementType, Hold, JunctionType, TimeGrid


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of the model file: SI value = factor * value + offset."""

    text: str
    factor: float = 1.0
    offset: float = 0.0

    def to_si(self, value: float) -> float:
        """Convert a value in this unit to SI."""
        return self.factor * value + self.offset

    def from_si(self, value: float) -> float:
        """Convert an SI value to this unit."""
        return (value - self.offset) / self.factor

    def difference_from_si(self, value: float) -> float:
        """Convert an SI difference (a standard deviation, say) to this unit."""
        return value / self.factor

    @property
    def of_differences(self) -> "Unit":
        """That in which differences are told: `K` of a temperature in degC."""
        return Unit("K") if self.offset else self

    @property
    def rate(self) -> "Unit":
        """That of its changes in a second: `percent/s`, `K/s` of a temperature."""
        unit = self.of_differences
        text = unit.text or "1"
        return Unit(f"({text})/s" if "/" in text or "*" in text else f"{text}/s", unit.factor)


LOGIC_UNIT = Unit("logic")  # of a signal that is 0 or 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A suspect: one number of a component that a fault may change. All values SI, spreads absolute.

    `owner` is the component, or of the lag of an input or a sensor that.
    `limits`, ascending, are the values at which a drift matters: none, one, or one on each side of the nominal.
    `healthy_change`: standard deviation of the change that is found of it on healthy data; 0 where that is not known.
    """

    name: str
    owner: str
    nominal: float
    unit: Unit
    accuracy: float  # standard deviation while healthy
    change: float  # standard deviation of a faulty value about the nominal
    lower: float  # range, may be -inf
    upper: float  # range, may be inf
    limits: tuple[float, ...] = ()
    suspect: bool = True
    healthy_change: float = 0.0
    line: int = 0

    @property
    def scale(self) -> float:
        """SI size of one engine unit: the nominal, or `change` where the nominal is 0."""
        return self.nominal if self.nominal != 0.0 else self.change


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """How what is not known of two healthy parameters goes together, from -1 to 1; `one` stands first in the model."""

    one: str
    other: str
    value: float
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """A trusted number, never a suspect. SI."""

    name: str
    value: float
    unit: Unit
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A measured curve y(x) through points, SI, x growing.

    monotone: whether it is smooth between the points, and rises and falls where they do; else straight
    continues: whether it goes on in a straight line beyond its ends; else it stays at the value there
    file: the CSV file beside the model file that it was read from; empty if its points stand in that
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    x_unit: Unit
    y_unit: Unit
    monotone: bool = False
    continues: bool = False
    file: str = ""
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """A measured or commanded input; `noise` is the SI standard deviation, `settling` in seconds.

    hold: what it is between two rows
    smooth: whether the noise is that of the record, and what acts is smooth; else what acts scatters
    lag: the parameter with which what acts follows the record, as a time constant; empty: at once
    order: how many stages in a row share that
    rate_limit: the parameter that is the highest rate of what lags, SI; empty: any
    lower, upper: what it can be, in SI, infinite if unknown; a value beyond is wrong
    suspect: whether a fault may falsify it; always False where there is no time.
    healthy_bias: standard deviation of the bias that is found of it on healthy data, SI; 0 where that is not known.
    fitted_range: where it was in the recordings of a fit, SI; None where that is not known.
    """

    name: str
    column: str
    unit: Unit
    noise: float = 0.0
    settling: float = 0.0
    hold: Hold = Hold.LAST
    smooth: bool = False
    lag: str = ""
    order: int = 1
    rate_limit: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    suspect: bool = True
    healthy_bias: float = 0.0
    fitted_range: tuple[float, float] | None = None
    line: int = 0

    @property
    def linear(self) -> bool:
        """Whether it goes linearly from row to row; else it is held."""
        return self.hold is Hold.LINEAR


@dataclass(frozen=True, slots=True, kw_only=True)
class Relation:
    """A constitutive relation `left = right`; signals by full name. Units of the sides agree, or are undetermined.

    The law of a block has a signal on the left, which it defines, or the rate of one, or it is an equation of any form.
    """

    left: Expression
    right: Expression
    line: int = 0

    @property
    def store(self) -> str | None:
        """The signal whose rate the law of a block gives, `y` of `der(y) = x/P`; None of any other law."""
        match self.left:
            case Call(function, (Name(text),)) if function == RATE:
                return text
        return None

    @property
    def signal(self) -> str | None:
        """The signal that the law of a block defines, itself or by its rate; None of an equation of another form."""
        return self.left.text if isinstance(self.left, Name) else self.store


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Known start of a store: SI mean and standard deviation of `q` or `p`, or of the signal of a block."""

    mean: float
    sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """An element, or a block, with its laws.

    Port signals: `name.e name.f`, or `name.e1 name.f1 name.e2 name.f2` (TF, GY); stores add `name.q` (C), `name.p` (I).
    A block has no ports; `signals` are the unknowns that it states beside those which its laws define. `suspect` is
    False for a block that is trusted.
    """

    name: str
    type: ElementType
    laws: tuple[Relation, ...]
    parameters: tuple[str, ...] = ()
    start: Start | None = None
    signals: tuple[str, ...] = ()
    suspect: bool = True
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Junction:
    """A 0- or 1-junction; its common signal is `name.e` or `name.f`."""

    name: str
    type: JunctionType
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Bond:
    """A power bond `tail -> head`: power counts positive from tail to head.

    For a TF or GY at the head this is port 1, at the tail port 2.
    """

    tail: str
    head: str
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Validity:
    """When a model, or a sensor, holds.

    condition : comparisons of inputs, constants and numbers, joined by `and` and `or`; SI
    settling : seconds from where it became true again until what it is of is judged again
    """

    condition: Expression
    settling: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A measured output: `reads` gives its SI value, `noise` the SI standard deviation of a reading of 0.

    growth : by how much of that, per SI, it is larger at other readings; see `noise_at`
    lag : the parameter with which it follows what it reads, as a time constant; empty: at once
    order : how many stages in a row share that
    lower, upper : ends of its measuring range in SI, infinite if unknown; a value at an end or beyond is saturated
    valid_when : when it reads as stated, beside what holds of the whole model; None: always
    suspect : whether it may fail; always False where there is no time
    healthy_bias : standard deviation of the bias that is found of it on healthy data, SI; 0 where that is not known
    fitted_range : where it was in the recordings of a fit, SI; None where that is not known
    """

    name: str
    column: str
    unit: Unit
    reads: Expression
    noise: float
    growth: float = 0.0
    lag: str = ""
    order: int = 1
    lower: float = -math.inf
    upper: float = math.inf
    valid_when: Validity | None = None
    suspect: bool = True
    healthy_bias: float = 0.0
    fitted_range: tuple[float, float] | None = None
    line: int = 0

    @property
    def part(self) -> float:
        """The noise as a part of the reading, beside that of a reading of 0; both are independent."""
        return self.noise * self.growth

    def noise_at(self, reading: float) -> float:
        """Give the noise at a reading, SI."""
        return math.hypot(self.noise, self.part * reading) if self.growth else self.noise


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowError:
    """A slowly varying error (Ornstein-Uhlenbeck) of a signal (`line.f`) or, with `is_sensor`, of a sensor (its name).

    `sd` is relative (0.02) when `relative`, else SI; `unit` is the one that the model file states. After a change of an
    input in `after` by D (SI) the sd is larger by that input's `each` times D, until it is forgotten. `memory` in
    seconds. With `wanders` it is no error, but how far a parameter, or an unknown input (its name), goes from its usual
    value and back.
    """

    target: str
    sd: float
    relative: bool
    memory: float
    after: tuple[str, ...] = ()
    each: tuple[float, ...] = ()  # of each input in `after`
    is_sensor: bool = False
    wanders: bool = False
    unit: Unit = Unit("")
    line: int = 0

    @property
    def by_input(self) -> dict[str, float]:
        """How much larger its sd is for each unit, SI, by which an input in `after` changes."""
        return dict(zip(self.after, self.each, strict=True))

    @property
    def kind(self) -> str:
        """What it is, as a key and in records."""
        return "wander" if self.wanders else "slow_error"

    @property
    def words(self) -> str:
        """What it is, without its size."""
        return f"{self.kind.replace('_', ' ')} of {self.target}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Something that can be checked by hand, and what it costs, in whatever measure the user has.

    name : a component or block, an input, or of a signal a name of its own
    reads, unit, noise : of a signal: what is measured, with which SI standard deviation; else None, no unit, 0
    move : of an input: SI size of the change to make, 0 where nobody can move it, None if it is not stated
    """

    name: str
    kind: CheckKind
    reads: Expression | None = None
    unit: Unit = Unit("")
    noise: float = 0.0
    move: float | None = None
    cost: float = 1.0
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeColumn:
    """Where time stands in a recording; `column` None: row number times sample time.

    optional: where a recording has no such column, the row number serves.
    """

    column: str | None = "time"
    unit: Unit = Unit("s")
    optional: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BondGraph:
    """A plant, complete and checked: a bond graph, or a block network, whose components are blocks without bonds.

    `sample_time` is None unless `grid` is FIXED. `time_between_false_alarms` is in seconds, None if not stated.
    `defaults` lists (thing, value) for every default in force.
    """

    name: str
    grid: TimeGrid
    sample_time: float | None
    max_faults: int
    warm_up: float  # seconds without alarms after the start
    time: TimeColumn
    parameters: tuple[Parameter, ...]
    constants: tuple[Constant, ...]  # unknown inputs behind the others
    inputs: tuple[Input, ...]
    components: tuple[Component, ...]
    junctions: tuple[Junction, ...]
    bonds: tuple[Bond, ...]
    sensors: tuple[Sensor, ...]
    slow_errors: tuple[SlowError, ...]
    tables: tuple[Curve, ...] = ()
    time_between_false_alarms: float | None = None
    false_alarms: int = 0  # that it is known to have raised on healthy data
    valid_when: Validity | None = None  # when all of it holds; None: always
    row_time: float | None = None  # seconds between rows, of which those about a sample are averaged; None: none is
    checks: tuple[Check, ...] = ()
    correlations: tuple[Correlation, ...] = ()  # of the accuracies of parameters
    defaults: tuple[tuple[str, str], ...] = ()
    signal_units: tuple[tuple[str, str], ...] = ()  # SI units of signals of laws, where laws and units fix them
    file: str = "model"
    text: str = ""  # canonical model text, the source of `sha256`

    @property
    def instruments(self) -> tuple[Input | Sensor, ...]:
        """What a recording has a column of: inputs, then sensors."""
        return (*self.inputs, *self.sensors)

    @property
    def wanders(self) -> tuple[SlowError, ...]:
        """What wanders, parameters first."""
        return tuple(item for item in self.slow_errors if item.wanders)

    @property
    def unknown_inputs(self) -> tuple[Constant, ...]:
        """Inputs that nobody measures: numbers that wander, and no parameters."""
        moving = {item.target for item in self.wanders}
        return tuple(item for item in self.constants if item.name in moving)

    @property
    def fixed(self) -> tuple[Constant, ...]:
        """The constants that stay what they are."""
        moving = {item.target for item in self.wanders}
        return tuple(item for item in self.constants if item.name not in moving)

    @property
    def lags(self) -> frozenset[str]:
        """The parameters that say how inputs and sensors come behind: time constants and highest rates."""
        inputs = (name for item in self.inputs for name in (item.lag, item.rate_limit))
        return frozenset((*inputs, *(item.lag for item in self.sensors))) - {""}

    @property
    def stands_alone(self) -> bool:
        """Whether its file is all that it is made of: no curve is in a file of its own."""
        return not any(item.file for item in self.tables)

    @property
    def is_block_network(self) -> bool:
        """Whether the components are blocks, not elements joined by bonds."""
        return any(item.type is ElementType.BLOCK for item in self.components)

    @property
    def is_logic(self) -> bool:
        """Whether the signals are 0 or 1 and the laws logic; a network is all logic or all numbers."""
        return any(item.unit == LOGIC_UNIT for item in self.sensors)

    @property
    def block_signals(self) -> tuple[str, ...]:
        """Signals of a block network in the order of the file: defined by a law, or stated as unknown."""
        return tuple(
            name
            for item in self.components
            for name in (*(law.signal for law in item.laws if law.signal is not None), *item.signals)
            if item.type is ElementType.BLOCK
        )

    @property
    def suspect_blocks(self) -> tuple[str, ...]:
        """Blocks that are suspects themselves: those without `suspect: no`, in a network without a suspect parameter.

        Where any parameter is a suspect, the parameters are the suspects and blocks without one are structure.
        Source: thesis 3.6 and 6.4.1 (blocks without parameters), 3.7 (parameters).
        """
        if not self.is_block_network or any(item.suspect for item in self.parameters):
            return ()
        return tuple(item.name for item in self.components if item.suspect)

    @property
    def sha256(self) -> str:
        """Hash that names the model: that of its canonical text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def rows_per_sample(self) -> int:
        """How many rows are averaged for a sample, where all are there; noise is that of their mean."""
        return 1 if self.row_time is None or self.sample_time is None else round(self.sample_time / self.row_time)

    @property
    def held_inputs(self) -> tuple[bool, ...]:
        """Whether each input stays until the next sample."""
        return tuple(not item.linear for item in self.inputs)

    @property
    def conditions(self) -> tuple[Validity, ...]:
        """When the model, then each sensor, holds, where that is stated; each condition once."""
        stated = (self.valid_when, *(item.valid_when for item in self.sensors))
        return tuple(dict.fromkeys(item for item in stated if item is not None))

    @property
    def correlated(self) -> tuple[tuple[int, int, float], ...]:
        """Places of two parameters whose accuracies go together, and their correlation; of SI values."""
        places = {item.name: k for k, item in enumerate(self.parameters)}
        return tuple((places[item.one], places[item.other], item.value) for item in self.correlations)

    @property
    def acting_inputs(self) -> frozenset[str]:
        """Inputs that a law or a sensor names; others only say in which state the plant is, or nothing."""
        sides = (side for item in self.components for law in item.laws for side in (law.left, law.right))
        used = {name for side in (*sides, *(item.reads for item in self.sensors)) for name in names(side)}
        return frozenset(item.name for item in self.inputs if item.name in used)

    def signal_unit(self, name: str) -> Unit:
        """Give the SI unit of a signal or a state of a law; one without a text where laws and units fix none."""
        return Unit(dict(self.signal_units).get(name, ""))

    def parameter(self, name: str) -> Parameter:
        """Give the parameter of that name; KeyError if there is none."""
        return {item.name: item for item in self.parameters}[name]

    def input(self, name: str) -> Input:
        """Give the input of that name; KeyError if there is none."""
        return {item.name: item for item in self.inputs}[name]

    def component(self, name: str) -> Component:
        """Give the component of that name; KeyError if there is none."""
        return {item.name: item for item in self.components}[name]
