"""What a run saw, sample by sample, kept for people: the report and the terminal. Not needed by the engine."""

from dataclasses import dataclass

from faultbond.types import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Suspect:
    """One parameter of a candidate set; SI."""

    parameter: str
    component: str
    nominal: float
    estimate: float
    sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A tested set of suspects with its posterior probability; `group`: cannot be told from the best.

    blocks: suspected parts that have no parameter, such as gates; they behave in a way that is not known.
    """

    suspects: tuple[Suspect, ...]
    probability: float
    group: bool
    blocks: tuple[str, ...] = ()

    @property
    def components(self) -> tuple[str, ...]:
        """Owners of the suspects and suspected blocks, each once."""
        return tuple(dict.fromkeys((*(suspect.component for suspect in self.suspects), *self.blocks)))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the suspects."""
        return tuple(suspect.parameter for suspect in self.suspects)


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """An alarm: raised at `time` (grid point `sample`), estimated onset `change_time`, sensors that crossed."""

    time: float
    sample: int
    change_time: float
    signals: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Ranked candidates at a time, best first."""

    time: float
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class History:
    """Traces of one run for plotting, SI, one row per grid point.

    time (T,); measured, expected, expected_sd (T, n_outputs), nan where missing; inputs (T, n_inputs).
    cusum (T, n_outputs): larger side of the CUSUM of each sensor, limit `cusum_limit`.
    slow (T, n_slow): those slow errors that can alarm, in units of their declared sd, limit `slow_limit`.
    After the detection `expected` goes on as the healthy model sees the plant.
    diagnoses: all Diagnosis records in order.
    """

    time: FloatArray
    measured: FloatArray
    expected: FloatArray
    expected_sd: FloatArray
    inputs: FloatArray
    cusum: FloatArray
    slow: FloatArray
    cusum_limit: float
    slow_limit: float
    slow_names: tuple[str, ...]
    detections: tuple[Detection, ...]
    diagnoses: tuple[Diagnosis, ...]
