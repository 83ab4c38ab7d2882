"""What a verb found, as a record and as text; of an analysis a part, worked out when its turn comes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of the result: keys of the record, and how it is printed."""

    record: Mapping[str, object]
    show: "Show"


Show = Callable[["Console"], None]
Work = Callable[[], Section]
