"""Plants whose effort or flow goes on when the parameter of a store changes.

`simulate` keeps the content of a store: a capacitor whose capacitance drops keeps its charge, so its voltage jumps. Of
a tank whose area is misjudged, or a rotor that was always heavier than thought, the level and the speed go on instead.
Here the changing parameter is taken out of the store and scales what flows into it, so that for the tank

    dP/dt = K3 (inflow - outflow - leak)

and P is continuous whatever K3 does. As long as no store's parameter changes, both forms record the same.
"""

from functools import cache

from benchmarks.shared.plants import EXAMPLES
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model

Edits = tuple[tuple[str, str], ...]

_COIL: Edits = (
    (
        "L: {type: I, parameters: {L: 2.5 H}}",
        "L: {type: TF, law: [f1 = f2, e2 = L_0/L*e1], parameters: {L: 2.5 H}}\n  coil: {type: I, law: p = L_0*f}",
    ),
    ("armature -> L,", "armature -> L -> coil,"),
)
_ROTOR: Edits = (
    (
        "J: {type: I, parameters: {J: 1.5 kg*m^2}}",
        "J: {type: TF, law: [f1 = f2, e2 = J_0/J*e1], parameters: {J: 1.5 kg*m^2}}\n  rotor: {type: I, law: p = J_0*f}",
    ),
    ("shaft -> J,", "shaft -> J -> rotor,"),
)
_MOTOR: Edits = (*_COIL, *_ROTOR, ("\ninputs:", "\nconstants: {L_0: 2.5 H, J_0: 1.5 kg*m^2}\ninputs:"))
EDITS: dict[str, Edits] = {
    "tank": (
        (
            "tank:    {type: C, law: e = K3*q, parameters: {K3: 1.30e5 Pa/m^3}}",
            "scale: {type: TF, law: [e1 = e2, f2 = K3/K3_0*f1], parameters: {K3: 1.30e5 Pa/m^3}}\n"
            "  tank: {type: C, law: e = K3_0*q}",
        ),
        ("vessel -> tank", "vessel -> scale -> tank"),
        ("\nconstants: {", "\nconstants: {K3_0: 1.30e5 Pa/m^3, "),
    ),
    "dc_motor": _MOTOR,
    "dc_motor_current": _MOTOR,
    "rlc": (
        (
            "C: {type: C, parameters: {C: 50 mF}}",
            "C: {type: TF, law: [e1 = e2, f2 = C_0/C*f1], parameters: {C: 50 mF}}\n  plates: {type: C, law: q = C_0*e}",
        ),
        ("loop -> C,", "loop -> C -> plates,"),
        ("\ninputs:", "\nconstants: {C_0: 50 mF}\ninputs:"),
    ),
}


@cache
def effort_or_flow_goes_on(folder: str) -> BondGraph:
    """Give the plant of an example, changed so that its stores keep effort (C) or flow (I) when a parameter changes.

    Raises
    ------
    LookupError
        Where the model file no longer reads as the edits expect.
    """
    text = (EXAMPLES / folder / "model.yaml").read_text(encoding="utf-8")
    for old, new in EDITS[folder]:
        if text.count(old) != 1:
            raise LookupError(f"examples/{folder}/model.yaml: {old!r} is there {text.count(old)} times, not once")
        text = text.replace(old, new)
    return parse_model(text, file=f"{folder}, effort or flow goes on")
