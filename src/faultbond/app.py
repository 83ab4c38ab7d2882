"""Placeholder."""

from pathlib import Path

from faultbond.errors import FaultbondError
from faultbond.io.faults import FaultRequest
from faultbond.io.out import Out
from faultbond.types import Method


def check(model: Path, *, out: Out) -> None:
    """Tell what was understood of a model."""
    raise FaultbondError("`check` is not built yet.")


def simulate(
    model: Path, *, inputs: str, faults: tuple[FaultRequest, ...], seed: int | None, output: Path, out: Out
) -> None:
    """Write a recording of the simulated plant; `inputs` is a path or `-`."""
    raise FaultbondError("`simulate` is not built yet.")


def run(model: Path, recording: str, *, method: Method, report: Path | None, out: Out) -> bool:
    """Watch a recording, a path or `-`, and tell whether a fault was detected."""
    raise FaultbondError("`run` is not built yet.")


def demo(*, report: Path, out: Out) -> None:
    """Find a fault in the built-in water tank and write the report."""
    raise FaultbondError("`demo` is not built yet.")
