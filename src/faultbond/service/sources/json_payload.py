"""Values from JSON messages.

A message is an object of values by column, with its time; a list of such objects; or one value, alone or as `value` of
an object, whose column is named by the topic. A value may itself be an object of `value`, `quality` and `time`.
"""

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from faultbond.io.row_block import Quality
from faultbond.io.times import moment_of
from faultbond.model.graph import Unit
from faultbond.service.sources.intake import UNKNOWN, UNREADABLE, Reading

MOST_BYTES = 2**20  # of a message
MOST_OBJECTS = 10_000  # of a list
TIMES = ("time", "timestamp", "ts")
OPC_GOOD, OPC_UNCERTAIN = 192, 64  # qualities as numbers, as of OPC DA
OVERSIZED = "oversized"


@dataclass(frozen=True, slots=True, kw_only=True)
class JsonForm:
    """How the messages of an asset are read: its columns, the name of its time, and the unit of times."""

    columns: Collection[str]
    time: str
    unit: Unit

    def readings(self, payload: bytes, levels: Sequence[str]) -> tuple[list[Reading], str]:
        """Give the values of a message, and as what it is counted: empty where it is in order.

        Parameters
        ----------
        payload : the message
        levels : of its topic, the last of which that is a column names a value that comes alone
        """
        if len(payload) > MOST_BYTES:
            return [], OVERSIZED
        try:
            content = json.loads(payload)
        except (ValueError, RecursionError):
            return [], UNREADABLE
        column = next((level for level in reversed(levels) if level in self.columns), "")
        items = content[:MOST_OBJECTS] if isinstance(content, list) else [content]
        found = [reading for item in items for reading in self._of(item, column)]
        if isinstance(content, list) and len(content) > MOST_OBJECTS:
            return found, OVERSIZED
        return found, "" if found else UNKNOWN

    def _of(self, content: object, column: str) -> Iterator[Reading]:
        """Give the values of an object, or of a value alone."""
        if isinstance(content, Mapping):
            moment = self._moment(content)
            named = [name for name in content if name in self.columns]
            for name in named:
                yield _reading(name, content[name], moment, self)
            if named or "value" not in content:
                return
        elif isinstance(content, list):
            return
        if column:
            yield _reading(column, content, None, self)

    def _moment(self, content: Mapping[str, object]) -> float | None:
        """Give the time of an object, nan where it cannot be read; None where there is none."""
        for name in dict.fromkeys((self.time, *TIMES)):
            if name not in self.columns and content.get(name) is not None:
                return moment_of(content[name], self.unit)
        return None


def _reading(column: str, content: object, moment: float | None, form: JsonForm) -> Reading:
    """Give one value."""
    if not isinstance(content, Mapping):
        return Reading(column=column, value=_plain(content), time=moment)
    own = form._moment(content)
    return Reading(
        column=column,
        value=_plain(content.get("value")),
        time=moment if own is None else own,
        quality=_quality(content.get("quality")),
    )


def _plain(value: object) -> object:
    """Give a value that is one; what is an object or a list is no number, and is told as a text is."""
    return "object" if isinstance(value, Mapping | list) else value


def _quality(told: object) -> Quality:
    """Give a quality, told as a word or as a number of OPC; good where none is told, uncertain what is neither."""
    if told is None:
        return Quality.GOOD
    if isinstance(told, bool):
        return Quality.GOOD if told else Quality.BAD
    if isinstance(told, int | float):
        return Quality.GOOD if told >= OPC_GOOD else Quality.UNCERTAIN if told >= OPC_UNCERTAIN else Quality.BAD
    word = str(told).strip().lower()
    return next((item for item in Quality if word.startswith(item.name.lower())), Quality.UNCERTAIN)
