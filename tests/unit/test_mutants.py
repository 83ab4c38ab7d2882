"""The campaign of damaged inputs: a small part of it, and that it notices what is wrong."""

import os
from pathlib import Path

import pytest
from benchmarks.trust.mutants import Case, Outcome, campaign, try_out

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that can be forked")


def test_no_mutant_is_an_internal_error(tmp_path: Path) -> None:
    """Damaged models, recordings and states end with one line at most, in time and in memory."""
    told: list[str] = []
    counts = campaign(16, 11, tmp_path, told.append, ("rc",))
    assert told == []
    assert counts.total() == 16
    assert len({name.partition(":")[0] for name in counts}) >= 3


def test_what_is_wrong_is_noticed() -> None:
    """Every fault that is counted is seen."""
    good = Outcome(code=2, seconds=1.0, megabytes=10.0, errors="one line\n", output="")
    assert list(good.faults()) == []
    bad = Outcome(code=3, seconds=11.0, megabytes=2000.0, errors="RuntimeWarning: x\n\x1b\n", output="9" * 60)
    assert len(list(bad.faults())) == 7


def test_a_mutant_has_a_process_of_its_own(tmp_path: Path) -> None:
    """Its exit code, both streams and its memory are taken; those of the campaign stay as they are."""
    outcome = try_out(Case(arguments=("check", str(tmp_path / "none.yaml")), what="model"), tmp_path)
    assert outcome.code == 2
    assert outcome.errors.endswith(
        "none.yaml: cannot be read: No such file or directory; give the path of a model file\n"
    )
    assert outcome.output == ""
