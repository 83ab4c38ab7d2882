"""The benchmark of generated programs: what it passes, and what it takes for a failure."""

import shutil
from pathlib import Path

import pytest
from benchmarks.targets.healthy import healthy_rows
from benchmarks.targets.million import passed

SMALL = 20.0  # MB, of a program that only copies


def test_rows_are_a_recording_of_the_tank() -> None:
    """As many rows as wanted, one each second, in columns of the model, and never the same twice."""
    head, *rows = healthy_rows(120).decode().splitlines()
    assert head == "time,u_in,u_out,flow,pressure"
    assert [row.partition(",")[0] for row in rows] == [str(k) for k in range(120)]
    assert len({row.partition(",")[2] for row in rows}) == 120


@pytest.mark.skipif(shutil.which("cat") is None or not Path("/proc/self/status").exists(), reason="no such system")
def test_a_program_is_measured_and_a_failure_is_told() -> None:
    """The memory is that of the program, not of what began it; one that ends otherwise is an error."""
    held = bytearray(80_000_000)
    processor, wall, peak = passed(["cat"], bytes(2_000_000))
    assert (processor >= 0.0, wall > 0.0) == (True, True)
    assert 0.0 < peak < SMALL < len(held) / 1e6
    with pytest.raises(RuntimeError, match="ended with 3"):
        passed(["sh", "-c", "cat >/dev/null; exit 3"], b"1\n")
