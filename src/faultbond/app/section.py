"""A part of an analysis, worked out when its turn comes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from rich.console import Console


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of the result: keys of the record, and how it is printed."""

    record: Mapping[str, object]
    show: Callable[[Console], None]


Work = Callable[[], Section]
