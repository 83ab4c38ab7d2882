"""What a run found, as Python programs hold it."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from io import StringIO
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from faultbond.api.frame import Frame
from faultbond.api.plant_model import Model, written
from faultbond.api.ranked import RankedCandidate, ranked, table_html
from faultbond.app.plant_run import PlantRun
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Decision, Detection, Diagnosis, History
from faultbond.contract.silence import Silent, seconds, unwatched
from faultbond.errors import FaultbondError
from faultbond.model.document import is_circuit
from faultbond.model.graph import BondGraph, Unit
from faultbond.report.reservations import CONTRADICTED
from faultbond.report.verdict import contradiction_sentence, detection_sentence
from faultbond.types import Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from faultbond.app.network_run import NetworkRun

SHOWN = 8  # candidates in a notebook


@dataclass(frozen=True, kw_only=True, eq=False)  # no slots: what follows from the run is worked out once
class Result:
    """What a run found.

    Parameters
    ----------
    model : the model
    of_run : the run, as `faultbond.app` gives it

    Example
    -------
    >>> import faultbond as fb
    >>> model = fb.example("tank")
    >>> result = fb.run(model, model.recordings["fault_pipe"])
    >>> result.verdict, result.best.components, result.best.parameters["K1"].unit
    ('fault', ('pipe',), 'Pa*s^2/m^6')
    """

    model: Model
    of_run: "PlantRun | NetworkRun"

    @property
    def verdict(self) -> str:
        """`fault`: one was detected. `healthy`, `partial`: none was, by all sensors, or by those not `silent`.

        `none`: nothing could be judged, see `no_verdict`.
        """
        return told_verdict(self.of_run.verdict, self.silent)

    @property
    def no_verdict(self) -> str:
        """Why the run says nothing of the plant; empty where it does."""
        return self.of_run.no_verdict

    @property
    def silent(self) -> tuple[Silent, ...]:
        """Sensors, then inputs, that gave no value, hardly any, or none for long; of a network without time none."""
        return self.of_run.silent if isinstance(self.of_run, PlantRun) else ()

    @cached_property
    def history(self) -> History:
        """What was seen and expected at every grid point, SI.

        Raises
        ------
        FaultbondError
            Of a network without time, which has no curves.
        """
        if not isinstance(self.of_run, PlantRun) or self.of_run.trace is None:
            raise FaultbondError(f"{self.model.file}: a network without time has no curves. See `diagnosis`.")
        return self.of_run.trace.history()

    @property
    def detections(self) -> tuple[Detection, ...]:
        """All alarms, in order."""
        if not isinstance(self.of_run, PlantRun):
            return () if self.of_run.detection is None else (self.of_run.detection,)
        return self.history.detections

    @property
    def detection(self) -> Detection | None:
        """The last alarm; None where there was none."""
        return self.detections[-1] if self.detections else None

    @property
    def diagnoses(self) -> tuple[Diagnosis, ...]:
        """All diagnoses in SI, in order; of a long run every second, fourth and so on; of a network the last one."""
        if not isinstance(self.of_run, PlantRun):
            return () if self.of_run.diagnosis is None else (self.of_run.diagnosis,)
        return self.history.diagnoses

    @property
    def diagnosis(self) -> Diagnosis | None:
        """The last diagnosis, SI; None without an alarm."""
        return self.diagnoses[-1] if self.diagnoses else None

    @cached_property
    def candidates(self) -> tuple[RankedCandidate, ...]:
        """The candidates of the last diagnosis, best first."""
        return ranked(self.diagnosis, self._graph) if self.diagnosis is not None else ()

    @property
    def best(self) -> RankedCandidate | None:
        """The best candidate of the last diagnosis; None without an alarm."""
        return self.candidates[0] if self.candidates else None

    @property
    def accepted(self) -> tuple[Decision, ...]:
        """What was taken as the new normal, SI."""
        return self.history.accepted if isinstance(self.of_run, PlantRun) else ()

    @property
    def rejected(self) -> tuple[Decision, ...]:
        """What was ruled out, SI."""
        return self.history.rejected if isinstance(self.of_run, PlantRun) else ()

    @cached_property
    def counts(self) -> Mapping[str, int | float | None]:
        """The numbers of the record `end`: samples, missing, late, and so on."""
        record = self.of_run.course.end if isinstance(self.of_run, PlantRun) else self.of_run.record
        return MappingProxyType({key: value for key, value in record.items() if isinstance(value, int | float | None)})

    def to_frame(self) -> Frame:
        """Give what was measured and expected, a row for each grid point, in the units of the model file.

        Columns are those of a recording, and of each sensor with `_expected` behind what the healthy plant would show,
        with `_expected_sd` its standard deviation; nan where there is no value.

        Raises
        ------
        FaultbondError
            Of a network without time.

        Example
        -------
        >>> import faultbond as fb
        >>> model = fb.example("tank")
        >>> fb.run(model, model.recordings["healthy"]).to_frame().units["flow_expected"]
        'm^3/s'
        """
        history, graph = self.history, self.model.graph
        clock = graph.time
        columns = {clock.column or "time": (history.time - clock.unit.offset) / clock.unit.factor}
        units = {clock.column or "time": clock.unit.text}
        for k, item in enumerate(graph.inputs):
            columns[item.column], units[item.column] = _in_unit(history.inputs[:, k], item.unit), item.unit.text
        for k, sensor in enumerate(graph.sensors):
            name, unit = sensor.column, sensor.unit
            columns[name], units[name] = _in_unit(history.measured[:, k], unit), unit.text
            columns[f"{name}_expected"] = _in_unit(history.expected[:, k], unit)
            columns[f"{name}_expected_sd"] = history.expected_sd[:, k] / unit.factor
            units |= {f"{name}_expected": unit.text, f"{name}_expected_sd": unit.text}
        return Frame(columns, units)

    def plot(self) -> "Figure":
        """Draw what was measured beside what was expected, and the candidates over time, with matplotlib.

        Raises
        ------
        FaultbondError
            Where matplotlib is not installed, and of a network without time.
        """
        from faultbond.api.plot import plotted  # noqa: PLC0415 - needs what may not be installed

        return plotted(self.model.graph, self.history)

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write the report, a page to open in a browser.

        Raises
        ------
        FaultbondError
            Where it cannot be written, and of a network without time.
        """
        if not isinstance(self.of_run, PlantRun):
            raise FaultbondError(f"{self.model.file}: a network without time has no curves to draw.")
        written(path, self.of_run.page())

    @property
    def _graph(self) -> BondGraph | None:
        return None if is_circuit(self.model.source) else self.model.graph

    def __str__(self) -> str:
        stream = StringIO()
        self.of_run.show(stream)
        return stream.getvalue()

    def __repr__(self) -> str:
        best = ""
        if self.best is not None and self._says:
            best = f", nearest {self.best.words}, contradicted" if self._is_contradicted else f", best {self.best}"
        return f"<Result of {self.model.name!r}: {self.verdict}{best}{told_silent(self.silent)}>"

    def _repr_html_(self) -> str:
        if self.detection is None or not self._says:
            notes = [self.no_verdict, *(item.sentence(seconds) for item in self.silent)]
            first = "No fault detected." if self._says else "No verdict."
            told = " ".join([first, *(f"{note[0].upper()}{note[1:]}." for note in notes if note)])
        elif not isinstance(self.of_run, PlantRun):
            told = contradiction_sentence(self.detection)
        else:
            knows = self._graph is not None and self._graph.false_alarms > 0
            told = detection_sentence(self.detection, is_known_to_alarm=knows)
            told += f" {CONTRADICTED}" if self._is_contradicted else ""
        head = f"<p><b>{escape(self.model.name)}</b>: {escape(told)}</p>"
        return head + table_html(self.candidates if self._says else (), SHOWN, is_contradicted=self._is_contradicted)

    @property
    def _is_contradicted(self) -> bool:
        return self.diagnosis is not None and self.diagnosis.unexplained is not None

    @property
    def _says(self) -> bool:
        """Whether an alarm, or that there is none, says anything of the plant."""
        return self.of_run.verdict is not Verdict.NONE


def told_verdict(verdict: Verdict, silent: Sequence[Silent]) -> str:
    """Give a verdict in a word: `partial` where no fault was found, but some sensors were not watched."""
    return "partial" if verdict is Verdict.HEALTHY and unwatched(silent) else verdict.value


def told_silent(silent: Sequence[Silent]) -> str:
    """Name the sensors that gave no value, or none for long, behind a verdict; empty where all did."""
    return f", not watched: {', '.join(unwatched(silent))}" if unwatched(silent) else ""


def _in_unit(values: FloatArray, unit: Unit) -> FloatArray:
    return np.asarray((values - unit.offset) / unit.factor)
