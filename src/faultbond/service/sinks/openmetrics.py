"""OpenMetrics: numbers as a text that Prometheus and others read.

Source: github.com/prometheus/OpenMetrics, specification 1.0.0.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

MEDIA_TYPE = "application/openmetrics-text; version=1.0.0; charset=utf-8"
_ESCAPED = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})


class MetricKind(Enum):
    """What a number does; the value is the word of the format."""

    GAUGE = "gauge"
    COUNTER = "counter"
    INFO = "info"


_SUFFIX = {MetricKind.GAUGE: "", MetricKind.COUNTER: "_total", MetricKind.INFO: "_info"}


@dataclass(frozen=True, slots=True)
class Family:
    """Numbers of one name and meaning, each with its labels; the name is without the suffix of its kind."""

    name: str
    kind: MetricKind
    meaning: str
    numbers: Sequence[tuple[Mapping[str, str], float]] = ()

    @property
    def full_name(self) -> str:
        """The name by which its numbers are asked for."""
        return f"{self.name}{_SUFFIX[self.kind]}"


def exposition(families: Iterable[Family]) -> str:
    """Give the text.

    Example
    -------
    >>> print(exposition([Family("pumps", MetricKind.GAUGE, "Pumps.", [({"hall": "7"}, 2.0)])]), end="")
    # TYPE pumps gauge
    # HELP pumps Pumps.
    pumps{hall="7"} 2
    # EOF
    """
    lines = [line for family in families if family.numbers for line in _lines(family)]
    return "\n".join([*lines, "# EOF", ""])


def _lines(family: Family) -> Iterator[str]:
    yield f"# TYPE {family.name} {family.kind.value}"
    yield f"# HELP {family.name} {family.meaning.translate(_ESCAPED)}"
    name = family.full_name
    for labels, number in family.numbers:
        told = ",".join(f'{key}="{value.translate(_ESCAPED)}"' for key, value in labels.items())
        yield f"{name}{{{told}}} {number:.15g}" if told else f"{name} {number:.15g}"
