"""What is simulated for the table of figures, and what is asked of it."""

from dataclasses import dataclass, replace

END = float("inf")  # read the ranking at the end of the recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One plant and one fault (or none), run with many seeds, and what is asked of the result.

    key : short name, for `--only`
    title : what stands in the table
    folder : example
    faults : parameters and their factors, all at the same moment
    goes_on : whether the stores keep effort or flow rather than their content
    seconds : length of the recording
    onset : earliest and latest moment of the fault, s
    looks : seconds after the alarm at which the ranking is read; the first one counts
    from_opening : whether the delay is counted from the moment at which u_in is wide open
    delay : s within which 95 % are to be detected
    first, three : part of the runs in which the true set is to be first, and among the first three
    error : relative error of the parameters that 90 % of the runs are to keep
    """

    key: str
    title: str
    folder: str
    faults: tuple[tuple[str, float], ...] = ()
    goes_on: bool = False
    seconds: float
    onset: tuple[float, float] = (0.0, 0.0)
    looks: tuple[float, ...] = ()
    from_opening: bool = False
    delay: float | None = None
    first: float | None = None
    three: float | None = None
    error: float | None = None


_TANK = Scenario(  # 82 minutes of a recipe that moves the level
    key="tank",
    title="tank",
    folder="tank",
    seconds=4920.0,
    onset=(1200.0, 1800.0),
    looks=(END, 120.0, 300.0, 600.0),
    first=0.95,
    three=0.99,
)
_MOTOR = Scenario(
    key="motor",
    title="motor",
    folder="dc_motor",
    seconds=60.0,
    onset=(15.0, 25.0),
    looks=(5.0, 2.0, 10.0, 20.0),
    delay=5.0,
    first=0.95,
    error=0.03,
)
_MOTOR_PAIR = replace(_MOTOR, looks=(20.0, 5.0, 10.0), delay=None, first=0.85, three=1.0, error=0.04)
_MOTOR_TRIPLE = replace(_MOTOR, folder="dc_motor_current", looks=(10.0, 2.0, 5.0, 20.0), delay=None)
_RLC = Scenario(
    key="rlc",
    title="rlc",
    folder="rlc",
    seconds=60.0,
    onset=(15.0, 25.0),
    looks=(20.0, 4.0, 10.0),
    delay=1.6,
    first=0.95,
    error=0.025,
)
_PIPE, _AREA, _PUMP, _LEAK = ("K1", 1.85), ("K3", 1.2), ("K8", 0.85), ("K6", 8.37)  # the leak: 8.7e-5 m3/s
_COIL, _ROTOR, _PLATES = ("L", 2.0), ("J", 0.6), ("C", 1.34)
_TWO, _THREE = (("R", 2.0), ("J", 1.5)), (("R", 2.0), ("L", 1.6), ("J", 1.5))

HEALTHY = (
    replace(_TANK, key="tank.healthy", title="tank healthy, 82 min"),
    replace(_MOTOR, key="motor.healthy", title="motor healthy, 300 s", seconds=300.0),
    replace(
        _MOTOR, key="current.healthy", title="motor with current healthy, 300 s", folder="dc_motor_current", seconds=300
    ),
    replace(_RLC, key="rlc.healthy", title="rlc healthy, 300 s", seconds=300.0),
)
FAULTY = (
    replace(_TANK, key="tank.K1", title="tank, K1 x1.85", faults=(_PIPE,), delay=60.0, from_opening=True, error=0.06),
    replace(_TANK, key="tank.K6", title="tank, K6 x8.37", faults=(_LEAK,), delay=60.0, error=0.03),
    replace(_TANK, key="tank.K1+K6", title="tank, {K1, K6}", faults=(_PIPE, _LEAK), error=0.09),
    replace(_TANK, key="tank.K8", title="tank, K8 x0.85", faults=(_PUMP,), delay=20.0, error=0.04),
    replace(_TANK, key="tank.K3", title="tank, K3 x1.2", faults=(_AREA,), error=0.05),
    replace(_TANK, key="tank.K3.on", title="tank, K3 x1.2 (level goes on)", faults=(_AREA,), goes_on=True, error=0.05),
    replace(_MOTOR, key="motor.R", title="motor, R x2", faults=(("R", 2.0),)),
    replace(_MOTOR, key="motor.L", title="motor, L x2", faults=(_COIL,)),
    replace(_MOTOR, key="motor.L.on", title="motor, L x2 (current goes on)", faults=(_COIL,), goes_on=True),
    replace(_MOTOR, key="motor.J", title="motor, J x0.6", faults=(_ROTOR,)),
    replace(_MOTOR, key="motor.J.on", title="motor, J x0.6 (speed goes on)", faults=(_ROTOR,), goes_on=True),
    replace(_MOTOR_PAIR, key="motor.R+J", title="motor, {R, J} x(2, 1.5)", faults=_TWO),
    replace(
        _MOTOR_PAIR, key="motor.R+J.on", title="motor, {R, J} x(2, 1.5) (speed goes on)", faults=_TWO, goes_on=True
    ),
    replace(_MOTOR_TRIPLE, key="current.R+L+J", title="motor with current, {R, L, J} x(2, 1.6, 1.5)", faults=_THREE),
    replace(
        _MOTOR_TRIPLE,
        key="current.R+L+J.on",
        title="motor with current, {R, L, J} x(2, 1.6, 1.5) (current, speed go on)",
        faults=_THREE,
        goes_on=True,
    ),
    replace(_RLC, key="rlc.C", title="rlc, C x1.34", faults=(_PLATES,)),
    replace(_RLC, key="rlc.C.on", title="rlc, C x1.34 (voltage goes on)", faults=(_PLATES,), goes_on=True),
)
SCENARIOS = {item.key: item for item in (*HEALTHY, *FAULTY)}
