"""What `check`, `analyse` and `fit` found: the record of the command line, its text, and what is asked for most."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from io import StringIO
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, overload

from faultbond.api.plant_model import Model, written
from faultbond.app.identification import Identified
from faultbond.io.out import Out, finite

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Told:
    """What a verb found.

    record: as the command line writes it with `--json`, SI; `told["key"]` is a value of it. text: as it prints it.
    """

    record: Mapping[str, Any]
    text: str

    def __getitem__(self, key: str) -> Any:
        return self.record[key]

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        of = self.record.get("model", self.record.get("record"))
        return f"<{type(self).__name__} of {of!r}: {', '.join(self.record)}>"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Analysis(Told):
    """What a plant's sensors can tell of its faults; all keys are in docs/commands.md. Absent parts are empty."""

    @property
    def detectable(self) -> Mapping[str, bool]:
        """Whether a fault of each parameter can be seen at all."""
        return _mapping(self.record, "detectable")

    @property
    def isolable(self) -> Mapping[str, Mapping[str, bool]]:
        """Whether a fault of one parameter can be told from one of another."""
        return _mapping(self.record, "isolable")

    @property
    def testable(self) -> list[list[str]]:
        """The sets of parameters that data can speak for and against."""
        return [list(item["parameters"]) for item in self.record.get("hypotheses", ()) if item["testable"]]

    @property
    def groups(self) -> Sequence[Sequence[Sequence[str]]]:
        """Groups of sets that cannot be told apart."""
        return tuple(self.record.get("groups", ()))

    @property
    def smallest_fault(self) -> Mapping[str, Mapping[str, Any]]:
        """The smallest fault of each parameter that is found: `value`, SI, `within`, s, and more."""
        return _mapping(self.record, "smallest_fault")

    @property
    def sensor_advice(self) -> Sequence[Mapping[str, Any]]:
        """Further sensors that would help, the best first."""
        return tuple(self.record.get("sensor_advice", ()))

    @property
    def input_advice(self) -> Sequence[Mapping[str, Any]]:
        """Inputs that would tell sets apart."""
        return tuple(self.record.get("input_advice", ()))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class FittedModel(Told):
    """A model that was fitted.

    model: with what was found. quieted: the record of what was added until the recordings were quiet, or None.
    """

    model: Model
    found: Identified
    quieted: Mapping[str, Any] | None

    @property
    def parameters(self) -> Mapping[str, Mapping[str, Any]]:
        """What was found of each parameter, by name, SI: `nominal`, `estimate`, `sd`, and more."""
        return MappingProxyType({item["name"]: item for item in self.record["parameters"]})

    @property
    def noise(self) -> Mapping[str, Mapping[str, Any]]:
        """What was found of noise, by the name of the sensor or input, SI: `declared`, `found`, `sd`."""
        return MappingProxyType({item["name"]: item for item in self.record["noise"]})

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write the report, a page to open in a browser.

        Raises
        ------
        FaultbondError
            Where it cannot be written.
        """
        written(path, self.found.page())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Records(Sequence[Mapping[str, Any]]):
    """What a verb told in several records, as the command line writes them with `--json`. text: as it prints them."""

    records: tuple[Mapping[str, Any], ...]
    text: str

    @overload
    def __getitem__(self, place: int) -> Mapping[str, Any]: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[Mapping[str, Any], ...]: ...
    def __getitem__(self, place: int | slice) -> Mapping[str, Any] | tuple[Mapping[str, Any], ...]:
        return self.records[place]

    def __len__(self) -> int:
        return len(self.records)

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<Records: {len(self)}>"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"


def heard(act: Callable[[Out], object]) -> Records:
    """Give what a verb of the command line writes, once it is done."""
    text, records = StringIO(), list[Mapping[str, Any]]()
    act(Out(text=text, json=None, hear=lambda record: records.append(MappingProxyType(finite(record)))))
    return Records(records=tuple(records), text=text.getvalue())


def printed(show: "Callable[[Console], None]") -> str:
    """Give what is printed on a console as text."""
    from rich.console import Console  # noqa: PLC0415 - slow to load

    stream = StringIO()
    show(Console(file=stream))
    return stream.getvalue()


def _mapping(record: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    return MappingProxyType(dict(record.get(key) or {}))
