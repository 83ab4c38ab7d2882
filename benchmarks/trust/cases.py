"""What is played for the table of trust: the kinds of run, and when one looks at them."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from benchmarks.trust import plants
from benchmarks.trust.arrival import interrupted, with_late, with_missing
from benchmarks.trust.plants import MOTOR, MOTOR_SECONDS, MOVING_AFTER, NEVER, TANK_SECONDS, Make
from faultbond.types import FaultKind

SMALL = ("K2", "K3", "K4", "K7", "K8")
SMALL_MOVED = ("K2", "K3")
SMALL_LEAK = 1.0 + 1.0e-5 / 1.04e-5  # 0.010 l/s more
SMALL_AFTER = 1500.0  # s that a small fault is recorded
DISTURBED = ("missing", "late", "restored")
EXPECTED = "expected"  # steps of parameters as the model expects them, to see whether probabilities hold
PLAIN = {"K6": "tank.K6", "R": "motor.R.double"}  # the runs that are disturbed

Factors = tuple[tuple[str, float], ...]
_LEAK, _PIPE = ("K6", 8.37), ("K1", 1.85)  # the leak: 8.7e-5 m3/s
_TANK_LOOKS, _MOTOR_LOOKS = (120.0, 300.0, 600.0), (2.0, 5.0, 10.0, 20.0)
_OPENED, _SETTLED = 300.0, 120.0
_PART = 0.05  # of values that are missing, of rows that are late
_SETS: dict[str, Factors] = {
    "K1": (_PIPE,),
    "K6": (_LEAK,),
    "K1+K6": (_PIPE, _LEAK),
    "K1+K4": (_PIPE, ("K4", 1.2)),
    "K2": (("K2", 1.2),),
    "K3": (("K3", 1.2),),
    "K4": (("K4", 1.2),),
    "K7": (("K7", 1.2),),
    "K8": (("K8", 0.85),),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A kind of run: `make` gives the recording of a seed, `looks` are the seconds after the alarm at which one reads.

    The last look waits, if need be, for two more things.

    opened : seconds since the alarm for which `u_in` has been at 60 % or more
    settled : seconds since `u_out` moved for the first time after the alarm; None: it need not move
    """

    key: str
    make: Make
    looks: tuple[float, ...] = ()
    opened: float = 0.0
    settled: float | None = None

    @property
    def waits(self) -> bool:
        """Whether the last look may come later than it says."""
        return self.opened > 0.0 or self.settled is not None


def _all_healthy() -> Iterator[Case]:
    yield Case(key="tank.healthy", make=partial(plants.healthy, "tank", TANK_SECONDS))
    yield Case(key="moved.healthy", make=plants.healthy_moving)
    yield Case(key="tank.rough", make=plants.roughly_modelled)
    yield Case(key="motor.healthy", make=partial(plants.healthy, "dc_motor", 300.0))
    yield Case(key="current.healthy", make=partial(plants.healthy, "dc_motor_current", 300.0))


def _tank() -> Iterator[Case]:
    for key, factors in _SETS.items():
        make = partial(plants.stepped, "tank", factors)
        yield Case(key=f"tank.{key}", make=make, looks=_TANK_LOOKS, opened=_OPENED)
        make = partial(plants.stepped, "tank", factors, moving=True, after=MOVING_AFTER)
        yield Case(key=f"moved.{key}", make=make, looks=_TANK_LOOKS, opened=_OPENED, settled=_SETTLED)


def _small() -> Iterator[Case]:
    yield Case(key="small.K6", make=partial(plants.stepped, "tank", (("K6", SMALL_LEAK),), after=SMALL_AFTER))
    for word, factor in (("up", 1.1), ("down", 0.9)):
        for name in SMALL:
            make = partial(plants.stepped, "tank", ((name, factor),), after=SMALL_AFTER)
            yield Case(key=f"small.{name}.{word}", make=make)
        for name in SMALL_MOVED:
            make = partial(plants.stepped, "tank", ((name, factor),), after=SMALL_AFTER, moving=True)
            yield Case(key=f"moved.small.{name}.{word}", make=make)


def _motor() -> Iterator[Case]:
    for name in MOTOR:
        for word, factor in (("up", 1.5), ("down", 1.0 / 1.5)):
            make = partial(plants.stepped, "dc_motor", ((name, factor),))
            yield Case(key=f"motor.{name}.{word}", make=make, looks=_MOTOR_LOOKS)
    yield Case(key="motor.R.double", make=partial(plants.stepped, "dc_motor", (("R", 2.0),)), looks=_MOTOR_LOOKS)
    yield Case(key="motor.pairs.alike", make=partial(plants.any_pair, "dc_motor", True), looks=_MOTOR_LOOKS)
    yield Case(key="motor.pairs.any", make=partial(plants.any_pair, "dc_motor", False), looks=_MOTOR_LOOKS)
    yield Case(key="current.triples", make=partial(plants.any_triple, "dc_motor_current"), looks=_MOTOR_LOOKS)


def _sensors() -> Iterator[Case]:
    tank, motor = partial(plants.healthy, "tank", TANK_SECONDS), partial(plants.healthy, "dc_motor", MOTOR_SECONDS)
    current = partial(plants.healthy, "dc_motor_current", MOTOR_SECONDS)
    for kind in (FaultKind.BIAS, FaultKind.NOISE, FaultKind.GAIN, FaultKind.STUCK, FaultKind.INTERMITTENT):
        word = kind.value
        for sensor in ("flow", "pressure"):
            yield Case(key=f"{word}.{sensor}", make=partial(plants.misread, tank, sensor, kind), looks=_TANK_LOOKS)
        yield Case(key=f"{word}.omega", make=partial(plants.misread, motor, "omega", kind), looks=_MOTOR_LOOKS)
    for sensor in ("omega", "i"):
        make = partial(plants.misread, current, sensor, FaultKind.BIAS)
        yield Case(key=f"bias.current.{sensor}", make=make, looks=_MOTOR_LOOKS)
    for sensor in ("flow", "pressure"):
        make = partial(plants.misread, plants.healthy_moving, sensor, FaultKind.BIAS)
        yield Case(key=f"moved.bias.{sensor}", make=make, looks=_TANK_LOOKS)


def _actuators() -> Iterator[Case]:
    for folder, name, seconds, looks in (
        ("tank", "u_in", TANK_SECONDS, _TANK_LOOKS),
        ("tank", "u_out", TANK_SECONDS, _TANK_LOOKS),
        ("dc_motor", "V", MOTOR_SECONDS, _MOTOR_LOOKS),
    ):
        yield Case(key=f"bias.{name}", make=partial(plants.disobeyed, folder, name, seconds), looks=looks)


def _disturbed() -> Iterator[Case]:
    leak, winding = partial(plants.stepped, "tank", (_LEAK,)), partial(plants.stepped, "dc_motor", (("R", 2.0),))
    for name, make, looks in (("K6", leak, _TANK_LOOKS), ("R", winding, _MOTOR_LOOKS)):
        opened = _OPENED if name == "K6" else 0.0  # as of the plain run
        yield Case(key=f"missing.{name}", make=partial(with_missing, make, _PART), looks=looks, opened=opened)
        yield Case(key=f"late.{name}", make=partial(with_late, make, _PART), looks=looks, opened=opened)
        yield Case(key=f"restored.{name}", make=partial(interrupted, make), looks=looks, opened=opened)


def _expected() -> Iterator[Case]:
    yield Case(key=f"{EXPECTED}.tank", make=partial(plants.expected, "tank"), looks=_TANK_LOOKS, opened=_OPENED)
    yield Case(key=f"{EXPECTED}.motor", make=partial(plants.expected, "dc_motor"), looks=_MOTOR_LOOKS)


def _cases() -> list[Case]:
    drift = Case(key="drift.K1", make=plants.drifting, looks=(NEVER,))
    faulty = [*_tank(), *_small(), *_motor(), *_sensors(), *_actuators(), drift]
    return [*_all_healthy(), *faulty, *_disturbed(), *_expected()]


CASES = {item.key: item for item in _cases()}
CLASSIC = tuple(  # those that are played by the thesis' method too: parameters that step, and healthy plants
    key for key in CASES if key == "small.K6" or key.partition(".")[0] in ("tank", "motor", "current")
)
