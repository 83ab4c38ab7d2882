"""Enumerations shared by every layer, and what the command line shares with the core and the code that is generated."""

from enum import Enum

SURE = 0.95  # probability of a candidate from which a rule accepts it, if nothing else is said
LOWEST_LEVEL = 0.5  # a diagnosis that is less likely than its opposite is accepted by no rule
TARGETS = (  # machines that a generated program is built for; the first is the one where it is built
    "native",
    "x86_64-linux-static",
    "aarch64-linux",
    "armv7-linux",
    "riscv64-linux",
    "x86_64-windows",
    "aarch64-macos",
    "wasm32-wasi",
    "cortex-m7",
)


class ElementType(Enum):
    """What a component is: a bond graph element (thesis 3.2.2), or a block between signals (thesis 3.4)."""

    R = "R"
    C = "C"
    I = "I"  # noqa: E741 - the field's letter for an inertia
    TF = "TF"
    GY = "GY"
    SE = "Se"
    SF = "Sf"
    BLOCK = "block"

    @property
    def is_store(self) -> bool:
        """Whether the element integrates a signal."""
        return self in (ElementType.C, ElementType.I)

    @property
    def is_source(self) -> bool:
        """Whether the element sets a signal whatever its partner does."""
        return self in (ElementType.SE, ElementType.SF)

    @property
    def n_ports(self) -> int:
        """Number of bonds that the element needs; a block has none."""
        if self is ElementType.BLOCK:
            return 0
        return 2 if self in (ElementType.TF, ElementType.GY) else 1


class JunctionType(Enum):
    """0: common effort, flows sum to zero. 1: common flow, efforts sum to zero. Source: thesis 3.2.3."""

    ZERO = "0"
    ONE = "1"


class Hold(Enum):
    """What an input is between two rows: as in the row before, as in the next one, or on the line between them."""

    LAST = "last"
    LINEAR = "linear"
    NEXT = "next"


class TimeGrid(Enum):
    """How the engine steps through time; NONE: it does not, each row is an observation by itself."""

    FIXED = "fixed"
    VARIABLE = "variable"
    NONE = "none"


class CheckKind(Enum):
    """What is checked by hand: a component is looked at, an input moved, a signal measured."""

    COMPONENT = "component"
    INPUT = "input"
    SIGNAL = "signal"


class Method(Enum):
    """Detection and diagnosis method."""

    BANK = "bank"  # a filter for every hypothesis
    CLASSIC = "classic"  # that of the thesis


class Verdict(Enum):
    """What a run says of its plant."""

    HEALTHY = "healthy"
    FAULT = "fault"  # one was detected, or stands open from before
    NONE = "none"  # nothing could be judged


class FaultKind(Enum):
    """How a part misbehaves; the value is the word in records."""

    STEP = "step"  # another value from one moment on
    DRIFT = "drift"  # a value that moves on at a rate
    INTERMITTENT = "intermittent"  # another value that comes and goes
    BIAS = "bias"  # of a sensor or input: something is added
    GAIN = "gain"  # of a sensor: the reading is multiplied; of an input: what acts is a multiple of what is recorded
    STUCK = "stuck"  # of a sensor: the reading no longer follows the plant; of an input: what acts no longer follows it
    NOISE = "noise"  # of a sensor: it scatters more than declared
    RAMP = "ramp"  # another value, reached over a while, that stays


STEP = ", step "  # between what is being done and the number of its step, where progress is told
