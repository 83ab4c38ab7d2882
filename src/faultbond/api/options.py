"""Options of the verbs, as they are given from Python: checked, and as the command line knows them."""

import os
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from math import isnan
from numbers import Integral, Real
from pathlib import Path
from typing import TypeAlias

import numpy as np

from faultbond.app.outputs import refuse_outputs
from faultbond.errors import FaultbondError
from faultbond.io.files import identity
from faultbond.io.memory_table import MemoryTable, Recording, table_of
from faultbond.io.times import moment_of
from faultbond.model.graph import Unit
from faultbond.model.quantities import duration, quantity, spread
from faultbond.types import LOWEST_LEVEL, SURE, Method

PathLike: TypeAlias = str | os.PathLike[str]
QuantityLike: TypeAlias = str | float  # "60 s", or SI


def recording_of(recording: object) -> Recording:
    """Give a recording as the verbs take it: a path as text, all else as a table."""
    if isinstance(recording, str | os.PathLike):
        file_of(recording, "recording")
        return os.fspath(recording)  # as it was written
    return recording if isinstance(recording, MemoryTable) else table_of(recording)


def recordings_of(given: object) -> tuple[Recording, ...]:
    """Give one recording, or each of a list.

    Raises
    ------
    FaultbondError
        Where the list is empty, or holds a frame twice.
    """
    if not isinstance(given, list | tuple):
        return (recording_of(given),)
    if not given:
        raise FaultbondError("an empty list: give at least one recording")
    if len({id(item) for item in given if not isinstance(item, str)}) < sum(
        not isinstance(item, str) for item in given
    ):
        raise FaultbondError("a recording is given twice; give each once")
    found = enumerate(map(recording_of, given), start=1)
    return tuple(item.numbered(k) if isinstance(item, MemoryTable) and len(given) > 1 else item for k, item in found)


def level_of(accept: float | str | None) -> float | None:
    """Give the probability from which a diagnosis is accepted by rule; None: by none.

    Raises
    ------
    FaultbondError
        Where it is no probability from 0.5 to 1.
    """
    if accept is None:
        return None
    if accept == "auto":
        return SURE
    if isinstance(accept, bool) or not isinstance(accept, Real) or not LOWEST_LEVEL <= accept <= 1.0:
        raise FaultbondError(
            f"accept={accept!r}: expected auto, or a probability from {LOWEST_LEVEL:g} to 1, such as 0.99"
        )
    return float(accept)


def seconds_of(value: QuantityLike, option: str) -> float:
    """Give a time in seconds, of a text with a unit or of a number.

    Raises
    ------
    FaultbondError
        Where it is negative, or no time.
    """
    if isinstance(value, str):
        return duration(value, f"{option}: ")
    if not isinstance(value, Real) or not value >= 0.0:
        raise FaultbondError(f"{option}={value!r}: expected a time, such as '60 s', or seconds")
    return float(value)


def method_of(method: str) -> Method:
    """Give a method by its name.

    Raises
    ------
    FaultbondError
        Where there is none of that name.
    """
    known = [item.value for item in Method]
    if method not in known:
        raise FaultbondError(f"method={method!r}: expected {' or '.join(known)}")
    return Method(method)


def names_of(given: str | Sequence[str]) -> tuple[str, ...]:
    """Give names, of a text with commas between or of a sequence.

    Raises
    ------
    FaultbondError
        Where they are no names, or one stands there twice.
    """
    if not isinstance(given, str) and not all(isinstance(item, str) for item in given):
        raise FaultbondError(f"{given!r}: expected names, such as ['R', 'L'] or 'R,L'")
    names = tuple(name.strip() for item in ([given] if isinstance(given, str) else given) for name in item.split(","))
    if not all(names) or not names:
        raise FaultbondError(f"{given!r}: expected names, such as ['R', 'L'] or 'R,L'")
    if len(set(names)) < len(names):
        raise FaultbondError(f"{given!r}: a name stands there twice; give each once")
    return names


def spelled(names: Sequence[str]) -> tuple[str, ...]:
    """Give names that were given one by one; none is none.

    Raises
    ------
    FaultbondError
        Where one is no text.
    """
    given = names if isinstance(names, list | tuple) else [names]
    for name in given:
        if not isinstance(name, str):
            raise FaultbondError(f"{name!r}: expected a text, or several, one by one")
    return tuple(given)


def whole_of(value: int, option: str, least: int, most: int | None) -> int:
    """Give a whole number from `least` on, up to `most` if there is one.

    Raises
    ------
    FaultbondError
        Where it is none, or out of this range.
    """
    is_whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not is_whole or value < least or (most is not None and value > most):
        raise FaultbondError(f"{option}={value!r}: expected a whole number from {least}{f' to {most}' if most else ''}")
    return int(value)


def part_of(value: QuantityLike, option: str) -> float:
    """Give a part of 1, of a text in percent or of a number.

    Raises
    ------
    FaultbondError
        Where it is no percentage.
    """
    if isinstance(value, Real):
        return float(value)
    found = spread(value, f"{option}: ") if isinstance(value, str) else None
    if found is None or not found.is_relative:
        raise FaultbondError(f"{option}={value!r}: expected a percentage, such as '3 %', or a part of 1")
    return found.ratio


def begun_at(start: Mapping[str, QuantityLike] | None) -> dict[str, float]:
    """Give where states begin, SI, of texts with a unit or of numbers that are in SI already.

    Raises
    ------
    FaultbondError
        Where it is no dict of such.
    """
    if start is None:
        return {}
    if not isinstance(start, Mapping) or not all(isinstance(value, str | Real) for value in start.values()):
        raise FaultbondError(f"start={start!r}: expected values by state, such as {{'tank.q': '0.05 m^3'}}")
    return {
        name: quantity(value, f"start {name}: ").value if isinstance(value, str) else float(value)
        for name, value in start.items()
    }


def moment_at(value: float | str | datetime | None, option: str) -> float | None:
    """Give a moment of a recording's clock, s; None of none.

    Raises
    ------
    FaultbondError
        Where it is none.
    """
    if value is None:
        return None
    found = moment_of(value, Unit("s"))
    if isnan(found):
        raise FaultbondError(f"{option}={value!r}: expected seconds, or a time such as '2026-11-23T14:00:00', UTC")
    return found


def truth_of(value: bool, option: str) -> bool:
    """Give a truth value; a text such as "no", which Python takes for true, is none.

    Raises
    ------
    FaultbondError
        Where it is no bool.
    """
    if not isinstance(value, bool | np.bool_):
        raise FaultbondError(f"{option}={value!r}: expected True or False")
    return bool(value)


def file_of(path: PathLike, option: str) -> Path:
    """Give a path.

    Raises
    ------
    FaultbondError
        Where it is no path, or has a character that no path has.
    """
    if not isinstance(path, str | os.PathLike):
        raise FaultbondError(f"{option}: {type(path).__name__}, where a path is expected")
    if "\0" in (text := os.fsdecode(path)):
        raise FaultbondError(f"{option}={text!r}: no path has the character NUL")
    return Path(text)


def refuse_overwriting(read: Iterable[tuple[PathLike, str]], written: Mapping[str, PathLike | None]) -> None:
    """Refuse to write over what is read, or where nothing can be written, as the command line does.

    Parameters
    ----------
    read : paths, and what each is
    written : what is to be written, such as `the report`, and where; None: it is not

    Raises
    ------
    FaultbondError
        Where an output is also an input or another output, or cannot be written.
    """
    known = [(identity(file_of(path, what)), what) for path, what in read]
    refuse_outputs(known, [(file_of(path, what), what) for what, path in written.items() if path is not None])


def path_of(path: PathLike | None, option: str) -> Path | None:
    """Give a path, None of none."""
    return None if path is None else file_of(path, option)
