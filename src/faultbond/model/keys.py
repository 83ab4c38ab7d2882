"""The keys of a model file, once: what stands there, what it means, whether it may be missing, what holds instead.

Reading, writing, messages and the JSON Schema follow from these tables, in their order.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from faultbond.model.elements import DEFAULT_LAWS, OWN_SIGNALS
from faultbond.model.source import NAME
from faultbond.types import Hold

Form = Mapping[str, Any]  # JSON Schema of a value; a `description` in it is a place for the sentence of a key

MAX_FAULTS = 2
MOST_FAULTS = 10
MOST_STAGES = 8  # of a lag
ACCURACY = 3.0  # per cent of the nominal. Source: the thesis rates and the measured examples declare 3 %
CHANGE = 200.0  # per cent of the nominal
CHECK_COST = 1.0
SENSOR_COST = 1.0
BETWEEN = ("linear", "monotone")
BEYOND = ("constant", "linear")
HOLDS = tuple(item.value for item in Hold)
NOISES_OF = ("input", "record")

_NAME = f"^{NAME.pattern}$"
_SIGNAL = rf"^{NAME.pattern}(\.{NAME.pattern})?$"
_NUMBER = r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?"

TEXT: Form = {"type": "string", "minLength": 1}
NAME_TEXT: Form = {"type": "string", "pattern": _NAME}
VALUE: Form = {"type": ["string", "number"], "description": "a number, or a number and a unit, such as `64650 Pa`"}
YES_NO: Form = {"description": "", "enum": [True, False, "yes", "no", "true", "false"]}
RANGE: Form = {
    "description": "",
    "anyOf": [
        {"type": "array", "items": {"type": ["string", "number"]}, "minItems": 2, "maxItems": 2},
        {"const": "any"},
    ],
}


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a table.

    form, sentence : what may stand there, and what it means; for the schema
    required : whether a schema can say that it must stand there
    missing : what to do where it is missing; a reader of the table says so at once
    default : what holds where it is missing, as it is listed for the user; empty where that needs no line or is no text
    """

    form: "Form | Keys"
    sentence: str = ""
    required: bool = False
    missing: str = ""
    default: str = ""


@dataclass(frozen=True, slots=True)
class Keys:
    """The keys that a table may have, in order.

    short : a key whose value may stand for the whole table
    may_be_empty : whether nothing may stand for it
    """

    known: Mapping[str, Key]
    short: str = ""
    may_be_empty: bool = False


def _one_or_more(item: Form) -> Form:
    """Give the form of one thing, or a list of them."""
    return {"description": "", "anyOf": [item, {"type": "array", "items": item, "minItems": 1}]}


def _named(item: "Form | Keys", pattern: str = _NAME, **more: int) -> Form:
    """Give the form of a table whose keys are names of the user's."""
    names = {"propertyNames": {"pattern": pattern}, "additionalProperties": item}
    return {"type": "object", "description": "", **names, **more}


_SLOW: Form = {
    "type": "string",
    "pattern": rf"^\s*{_NUMBER}.*\sover\s",
    "description": "standard deviation and memory, `2 % over 600 s`",
}
_UNIT = "unit of its column"
_COLUMN = Key(TEXT, "column of a recording; default its name", default="its name")
_START = "solved from the first samples"

PARAMETER_KEYS = Keys(
    {
        "nominal": Key(VALUE, "healthy value", required=True, missing="state its healthy value"),
        "accuracy": Key(VALUE, "standard deviation while healthy, relative or absolute", default=f"{ACCURACY:g} %"),
        "change": Key(
            VALUE, "standard deviation of a faulty value about the nominal; default `200 %`", default=f"{CHANGE:g} %"
        ),
        "healthy_change": Key(
            VALUE, "standard deviation of the change that is found of it on healthy data; `fit` writes it"
        ),
        "range": Key(RANGE, "default: the sign of the nominal"),
        "limit": Key(
            {"description": "", "anyOf": [VALUE, {"type": "array", "items": VALUE, "minItems": 1, "maxItems": 2}]},
            "value at which a drift matters, or one on each side",
        ),
        "wander": Key(_SLOW, "how far it goes from its usual value by itself, and its memory, `3 % over 6 h`"),
        "suspect": Key(YES_NO, "`no` trusts the parameter"),
    },
    short="nominal",
)
_SPREAD_KEYS = {key: PARAMETER_KEYS.known[key] for key in ("accuracy", "change", "healthy_change", "range")}
LAG_KEYS = Keys(
    {
        "value": Key(VALUE, "time constant", required=True, missing="state the time constant, such as `value: 3 s`"),
        "order": Key(
            {
                "description": "",
                "anyOf": [{"type": "integer", "minimum": 1, "maximum": MOST_STAGES}, {"type": "string"}],
            },
            "so many equal stages in a row share it; many come near a dead time; default 1",
        ),
        **_SPREAD_KEYS,
        "suspect": Key(YES_NO, "`yes` makes the lag a suspect; default `no`"),
    },
    short="value",
)
RATE_LIMIT_KEYS = Keys(
    {
        "value": Key(
            VALUE, "highest rate", required=True, missing="state the highest rate, such as `value: 5 percent/s`"
        ),
        **_SPREAD_KEYS,
        "suspect": PARAMETER_KEYS.known["suspect"],
    },
    short="value",
)
VALID_KEYS = Keys(
    {
        "when": Key(
            TEXT,
            "a condition on inputs and constants, `mode == 1`, joined by `and`, `or`",
            required=True,
            missing="state the condition, such as `when: mode == 1`",
        ),
        "settling": Key(TEXT, "it is judged again so long after it became true; default `0 s`"),
    },
    short="when",
)
_PARAMETERS = Key(_named(PARAMETER_KEYS), "numbers that a fault may change")
_HEALTHY_BIAS = Key(VALUE, "standard deviation of the bias that is found of it on healthy data; `fit` writes it")
_FITTED_RANGE = Key(
    {"description": "", "type": "array", "items": VALUE, "minItems": 2, "maxItems": 2},
    "where it was in the recordings of the fit, `[lowest, highest]`; `fit` writes it",
)
INPUT_KEYS = Keys(
    {
        "unit": Key(TEXT, f"{_UNIT}, such as `percent`; `logic` for 0 and 1"),
        "column": _COLUMN,
        "noise": Key(VALUE, "standard deviation; default 0", default="0"),
        "noise_of": Key(
            {"description": "", "enum": list(NOISES_OF)},
            "`record`: what acts is smooth, and its record scatters; default what acts scatters: `input`",
        ),
        "settling": Key(TEXT, "after a step the model may be off for so long; default `0 s`", default="0 s"),
        "hold": Key(
            {"description": "", "enum": list(HOLDS)},
            "`linear`: between rows it goes linearly, `next`: as in the later row; default as in the earlier one: "
            "`last`, and with `row_time` `linear`",
        ),
        "lag": Key(LAG_KEYS, "time constant with which what acts follows the record; default: at once"),
        "rate_limit": Key(RATE_LIMIT_KEYS, "beside a lag: how fast what acts can move at most; default: at any rate"),
        "range": Key(RANGE, "what it can be; a value beyond is not used; default any"),
        "unknown": Key(
            _SLOW, "nobody measures it: how far it goes from its usual value, and its memory, `5 W over 1 h`"
        ),
        "usual": Key(VALUE, "of an unknown input: the value about which it moves; default 0"),
        "healthy_bias": _HEALTHY_BIAS,
        "fitted_range": _FITTED_RANGE,
        "suspect": Key(YES_NO, "`no` trusts the input"),
    },
    may_be_empty=True,
)
COMPONENT_KEYS = Keys(
    {
        "type": Key(
            {"enum": [element.value for element in OWN_SIGNALS]},
            required=True,
            missing=f"it is one of {', '.join(element.value for element in OWN_SIGNALS)}",
        ),
        "law": Key(
            _one_or_more(TEXT),
            "`left = right`; default with one parameter X: "
            + "; ".join(f"{element.value} `{' and '.join(texts)}`" for element, texts in DEFAULT_LAWS.items()),
        ),
        "parameters": _PARAMETERS,
        "start": Key(
            Keys({"q": Key(VALUE), "p": Key(VALUE), "sd": Key(VALUE, required=True)}),
            f"known start of a store; default: {_START}",
            default=_START,
        ),
    }
)
BLOCK_KEYS = Keys(
    {
        "law": Key(
            _one_or_more(TEXT),
            "`y = K*x` defines signal y, `der(y) = x/P` makes it a store, or any equation",
            required=True,
        ),
        "parameters": _PARAMETERS,
        "signals": Key(_one_or_more(NAME_TEXT), "unknown signals that no law defines"),
        "start": Key(
            {
                "description": "",
                "type": "object",
                "additionalProperties": VALUE,
                "propertyNames": {"pattern": _NAME},
                "required": ["sd"],
                "minProperties": 2,
                "maxProperties": 2,
            },
            f"known start of its store, `{{y: 2 m, sd: 1 cm}}`; default: {_START}",
            default=_START,
        ),
        "suspect": Key(YES_NO, "`no` trusts the block and its parameters"),
    }
)
SENSOR_KEYS = Keys(
    {
        "reads": Key(TEXT, "a law of signals, such as `vessel.e`", required=True),
        "unit": Key(TEXT, f"{_UNIT}; default SI; `logic` for 0 and 1", default="SI"),
        "noise": Key(
            VALUE, "standard deviation, `180 Pa` or `2 % of 8.9 kPa`; default 0 in a static network", default="0"
        ),
        "lag": Key(LAG_KEYS, "time constant with which it follows what it reads; default: at once"),
        "column": _COLUMN,
        "range": Key(RANGE, "measuring range; a value at an end or beyond is not used; default any"),
        "valid_when": Key(VALID_KEYS, "condition under which it reads as stated; else it is not used"),
        "healthy_bias": _HEALTHY_BIAS,
        "fitted_range": _FITTED_RANGE,
        "suspect": Key(YES_NO, "`no` trusts the sensor"),
    }
)
SLOW_ERROR_KEYS = Keys(
    {
        "size": Key(
            _SLOW,
            required=True,
            missing="write it as `size: 0.2 cm over 40 s`",
        ),
        "after": Key(_one_or_more(NAME_TEXT), "inputs after whose changes it is larger"),
        "each": Key(_one_or_more(VALUE), "how much larger for each unit of a change: of all, or of each input"),
    },
    short="size",
)
CHECK_KEYS = Keys(
    {
        "cost": Key(
            {"type": ["string", "number"], "description": "cost in any measure; default 1"}, default=f"{CHECK_COST:g}"
        ),
        "move": Key(VALUE, "of an input: size of the change, `10 percent`; `no`: nobody can move it"),
        "reads": Key(TEXT, "a law of signals: what is measured by hand"),
        "unit": Key(TEXT, "unit of what is measured; default SI", default="SI"),
        "noise": Key(VALUE, "standard deviation of what is measured", default="0"),
    },
    short="cost",
    may_be_empty=True,
)
_POINT: Form = {"type": "array", "items": {"type": ["string", "number"]}, "minItems": 2, "maxItems": 2}
TABLE_KEYS = Keys(
    {
        "points": Key(
            {"description": "", "type": "array", "items": _POINT, "minItems": 2}, "`[[x, y], ..]`, x growing"
        ),
        "file": Key(TEXT, "CSV file beside the model file: x and y in its first two columns"),
        "x": Key(TEXT, "unit of what goes in; default SI"),
        "y": Key(TEXT, "unit of what comes out; default SI"),
        "between": Key(
            {"description": "", "enum": list(BETWEEN)},
            "straight lines, or a smooth curve that rises and falls where the points do; default `linear`",
            default=BETWEEN[0],
        ),
        "beyond": Key(
            {"description": "", "enum": list(BEYOND)},
            "the value at the end, or on in a straight line; default `constant`",
            default=BEYOND[0],
        ),
    }
)
_NAMES: Form = _one_or_more(NAME_TEXT)
_EQUATION: Form = {
    "description": "names of what stands in it, or its text `q = K*(p1 - p2) + f`, of which only the names are read",
    "anyOf": [{"type": "array", "items": NAME_TEXT, "minItems": 1}, TEXT],
}
FURTHER_SENSOR_KEYS = Keys(
    {
        "cost": Key(
            {"type": ["string", "number"], "description": f"cost in any measure; default {SENSOR_COST:g}"},
            default=f"{SENSOR_COST:g}",
        ),
        "suspect": Key(YES_NO, "`yes`: the new sensor can fail, too; default `no`"),
    },
    short="cost",
    may_be_empty=True,
)
STRUCTURE_KEYS = Keys(
    {
        "unknowns": Key(
            _NAMES, "signals that nobody measures, rates among them", required=True, missing="list them: `[x1, x2]`"
        ),
        "known": Key(_NAMES, "signals that are measured or commanded"),
        "faults": Key(_NAMES, "faults; each stands in the equations that it makes untrue"),
        "parameters": Key(_NAMES, "trusted numbers in texts of equations; they count for nothing"),
        "equations": Key(
            {
                "description": "",
                "anyOf": [
                    {"type": "array", "items": _EQUATION, "minItems": 1},
                    {
                        "type": "object",
                        "propertyNames": {"pattern": _NAME},
                        "additionalProperties": _EQUATION,
                        "minProperties": 1,
                    },
                ],
            },
            "equations by name, or a list of them, called `e1`, `e2` and so on",
            required=True,
            missing="state them: `{e1: [x1, x2, y]}`",
        ),
        "derivatives": Key(_named(NAME_TEXT), "`dx: x`: the unknown dx is the rate of the unknown x"),
        "further_sensors": Key(
            {
                "description": "",
                "anyOf": [
                    {"type": "array", "items": NAME_TEXT},
                    {
                        "type": "object",
                        "propertyNames": {"pattern": _NAME},
                        "additionalProperties": FURTHER_SENSOR_KEYS,
                    },
                ],
            },
            "unknowns that could be measured, with their cost; default all but rates",
            default="of every unknown but rates",
        ),
    }
)
TIME_KEYS = Keys({"column": Key(TEXT), "unit": Key(TEXT, "a unit of time; default s")})
MODEL_KEYS = Keys(
    {
        "name": Key(TEXT, "default: the file's name", default="the file's name"),
        "sample_time": Key(
            TEXT,
            "the engine's grid, `1 s`; `variable` for rows as they come, `none` for a static block network",
            required=True,
            missing="state it, such as `sample_time: 1 s`, or `variable`",
        ),
        "row_time": Key(
            TEXT,
            "rows come so often, `0.1 s`; those about each sample are averaged, and noise is that of a row; default: "
            "the nearest row is taken",
        ),
        "max_faults": Key(
            {
                "description": "",
                "anyOf": [{"type": "integer", "minimum": 1, "maximum": MOST_FAULTS}, {"type": "string"}],
            },
            f"largest set of simultaneous faults that is tested; default {MAX_FAULTS}",
            default=str(MAX_FAULTS),
        ),
        "false_alarms": Key(
            {"description": "", "anyOf": [{"type": "integer", "minimum": 0}, {"type": "string"}]},
            "alarms that it is known to have raised on healthy data; default 0",
        ),
        "accuracy": Key(TEXT, "standard deviation of each healthy parameter, relative; default `3 %`"),
        "warm_up": Key(TEXT, "time without alarms after the start, `180 s`"),
        "valid_when": Key(VALID_KEYS, "condition under which the model holds; else nothing is judged"),
        "time": Key(
            {
                "description": "",
                "anyOf": [TIME_KEYS, {"const": "none", "description": "row number times sample_time"}],
            },
            "where time stands in a recording; default column `time` in s",
            default="column `time` in s",
        ),
        "constants": Key(_named(VALUE), "trusted numbers, never suspects"),
        "correlations": Key(
            _named(_named({"type": ["string", "number"]})),
            "how the accuracies of two parameters go together, `{J: {K: 0.96}}`; default: not at all",
        ),
        "tables": Key(_named(TABLE_KEYS), "measured curves, for `table(x, NAME)` in laws"),
        "inputs": Key(_named(INPUT_KEYS), "measured or commanded inputs"),
        "components": Key(_named(COMPONENT_KEYS, minProperties=1), "elements with their laws and parameters"),
        "junctions": Key(
            _named({"enum": [0, 1, "0", "1"]}), "0: one effort, flows sum to 0; 1: one flow, efforts sum to 0"
        ),
        "bonds": Key(
            _one_or_more({"type": "string", "pattern": "->"}), "`a -> b -> c`; power counts positive along `->`"
        ),
        "sensors": Key(_named(SENSOR_KEYS, minProperties=1), "measured outputs", required=True),
        "slow_error": Key(_named(SLOW_ERROR_KEYS, _SIGNAL), "known imperfections of signals and sensors"),
        "blocks": Key(_named(BLOCK_KEYS, minProperties=1), "blocks of a block network with their laws"),
        "instrument_faults": Key(YES_NO, "`no` trusts every sensor and input that does not state `suspect`"),
        "time_between_false_alarms": Key(TEXT, "mean time between false alarms of a healthy plant, `30 days`"),
        "checks": Key(
            _named(CHECK_KEYS), "what can be checked by hand: a component, an input, or a new name with `reads`"
        ),
        "structure": Key(STRUCTURE_KEYS, "equations without laws, for `check` and `analyse` alone"),
    }
)
BOND_GRAPH_KEYS = ("components", "junctions", "bonds")  # a block network has none of them
BESIDE_STRUCTURE = ("name",)  # all that may stand beside a structure
