"""JSON as dataclasses: what a field may hold is read off its type, so that nothing of another form is believed."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from enum import Enum
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

LARGEST = 2**53  # whole numbers up to it are floats, too

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeLimits:
    """What types do not tell. least: of whole numbers, by class; not_finite: classes whose floats may be nan or inf."""

    least: Mapping[type, int] = field(default_factory=dict)
    not_finite: frozenset[type] = frozenset()


def typed(kind: type[_T], value: object, limits: TypeLimits | None = None) -> _T:
    """Give a JSON value as an instance of a type.

    Parameters
    ----------
    kind : a dataclass, an Enum, str, bool, int, float, or a tuple or union with None of these
    value : as `json.loads` gives it; of a dataclass fields with a default may be absent
    limits : what else must hold

    Raises
    ------
    ValueError
        Where it is of another form.
    """
    made: _T = _read(kind, value, NoneType, limits or TypeLimits())
    return made


def _read(kind: Any, value: object, owner: type, limits: TypeLimits) -> Any:
    """Give a value that stands in a dataclass `owner`."""
    if get_origin(kind) is UnionType:
        inner = next(item for item in get_args(kind) if item is not NoneType)
        return None if value is None else _read(inner, value, owner, limits)
    if get_origin(kind) is tuple:
        if not isinstance(value, list):
            raise ValueError(f"a list is expected in {owner.__name__}")
        kinds = get_args(kind)
        each = (kinds[0],) * len(value) if kinds[-1] is Ellipsis else kinds
        return tuple(_read(inner, item, owner, limits) for inner, item in zip(each, value, strict=True))
    if is_dataclass(kind):
        return _read_object(kind, value, limits)
    if issubclass(kind, Enum):
        return kind(value)
    if kind is float and type(value) in (int, float):
        number = float(value)  # type: ignore[arg-type]
        if math.isfinite(number) or owner in limits.not_finite:
            return number
    elif type(value) is kind and (kind is not int or limits.least.get(owner, -1) <= value <= LARGEST):  # type: ignore[operator]
        return value
    raise ValueError(f"{value!r} is no {kind.__name__} of {owner.__name__}")


def _read_object(kind: Any, value: object, limits: TypeLimits) -> Any:
    """Give a dataclass whose fields are all known, and all there that have no default."""
    known = {item.name: item for item in fields(kind)}
    if not isinstance(value, dict) or not value.keys() <= known.keys():
        raise ValueError(f"this is no {kind.__name__}")
    needed = {name for name, item in known.items() if item.default is MISSING and item.default_factory is MISSING}
    if not needed <= value.keys():
        raise ValueError(f"{kind.__name__} is not whole")
    hints = get_type_hints(kind)
    return kind(**{name: _read(hints[name], item, kind, limits) for name, item in value.items()})
