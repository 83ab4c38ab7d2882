"""How far rounding moves posteriors: the core as it is shipped against the same source with long double numbers.

    python -m benchmarks.trust.precision [--samples N] [--only NAME,...]

Each plant has a fault in the middle of its recording. Told is the largest difference of a posterior, of all hypotheses
and diagnoses. Long double has 64 bits on x86; where it is no longer than double, nothing is told.
"""

import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.shared.page import arguments, as_text, note, selected
from benchmarks.shared.plants import case, graph_of
from benchmarks.shared.play import block_of
from faultbond.arrays import FloatArray
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.simulate import Fault
from faultbond.synthesis.compile import CORE, FAST, FLAGS
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec

HERE = Path(__file__).parent
SAMPLES = 10_000
SEED = 71
ASKED = 1e-9
FAULTS = {  # by plant: parameter, factor, value
    "tank": ("K1", 1.6, None),
    "three_tank": ("V1", None, 0.3),
    "dc_motor": ("R", 1.5, None),
    "dc_motor_current": ("K", 0.8, None),
}
LONG = ("-std=gnu11", "-O2", "-w", "-include", str(HERE / "long.h"))
HEADER = ("plant", "hypotheses", "samples", "diagnoses", "largest difference", "asked")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compared:
    """Posteriors of the same diagnoses by both builds, (n_diagnoses, n_hypotheses); and their samples."""

    sample: FloatArray
    shipped: FloatArray
    exact: FloatArray

    @property
    def largest(self) -> float:
        """The largest difference."""
        return float(np.max(np.abs(self.shipped - self.exact)))


def compare(name: str, n_samples: int, folder: Path, *flags: str) -> Compared:
    """Pass a recording with a fault in its middle through both builds.

    Parameters
    ----------
    name : of the plant, as in `FAULTS`
    n_samples : length of the recording
    folder : where programs and recordings may be written
    flags : of the compiler besides those of the shipped build

    Raises
    ------
    RuntimeError
        Where a program does not compile or run, or both do not diagnose at the same samples.
    """
    graph = graph_of(name)
    model = build_plant(graph)
    spec = build_spec(build_step_model(model))
    text = folder / "run.c"
    text.write_text(core_text(spec, build_step_model(model, all_inputs=True)) + '#include "precision.c"\n')
    step, (parameter, factor, value) = graph.sample_time or 1.0, FAULTS[name]
    fault = Fault(parameter=parameter, factor=factor, value=value, start=0.5 * n_samples * step)
    given = block_of(case(name, SEED, [fault], seconds=n_samples * step).recording)
    np.hstack([given.time[:, None], given.dt[:, None], given.u, given.y]).tofile(folder / "recording")
    told = [posteriors(folder, options, spec.n_hypotheses) for options in ((*FLAGS, *FAST, *flags), LONG)]
    if not np.array_equal(told[0][:, 0], told[1][:, 0]):
        raise RuntimeError(
            f"{name}: diagnoses at {told[0][:, 0]} by the shipped build, at {told[1][:, 0]} by the other"
        )
    return Compared(sample=told[0][:, 0], shipped=told[0][:, 1:], exact=told[1][:, 1:])


def posteriors(folder: Path, options: Sequence[str], n_hypotheses: int) -> FloatArray:
    """Give samples and posteriors, (n_diagnoses, 1 + n_hypotheses), of the core that `compare` left, by other options.

    Raises
    ------
    RuntimeError
        Where it does not compile or run.
    """
    words = ["gcc", *options, f"-I{CORE}", f"-I{HERE}", str(folder / "run.c"), "-o", str(folder / "run"), "-lm"]
    for command in (words, [str(folder / "run"), str(folder / "recording"), str(folder / "out")]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.returncode} {done.stderr[-2000:]}")
    return np.fromfile(folder / "out").reshape(-1, 1 + n_hypotheses)


def main(argv: Sequence[str] | None = None) -> None:
    """Compare and print."""
    chosen = arguments("How far rounding moves posteriors.", argv, samples=SAMPLES, only="")
    rows = []
    for name in selected(FAULTS, chosen.only):
        with tempfile.TemporaryDirectory() as folder:
            found = compare(name, chosen.samples, Path(folder))
        count = (str(found.shipped.shape[1]), str(chosen.samples), str(len(found.sample)))
        rows.append((name, *count, f"{found.largest:.1e}", f"{ASKED:.0e}"))
    print(note(), as_text(HEADER, rows), sep="\n\n")


if __name__ == "__main__":
    main()
