"""Other values of the same suspects that give exactly the same outputs: golden values G19, errata E9 and E10."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from faultbond.analysis.other_roots import other_solutions, reachable
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.errors import ModelError
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"
NOMINAL = {"R": 3.0, "L": 2.5, "K": 2.0, "J": 1.5, "C": 0.4}
SECOND: dict[tuple[str, ...], tuple[float, float]] = {("R", "C"): (0.8667, 2.34), ("L", "J"): (14.625, 0.4333)}  # G19


@pytest.fixture(scope="module")
def motor() -> StepModel:
    """Give the motor seen from voltage and speed."""
    return build_step_model(build_plant(load_model(EXAMPLES / "dc_motor" / "model.yaml")))


def test_a_long_record_leaves_a_second_solution_to_two_pairs_only(motor: StepModel) -> None:
    """Of all singles and pairs of the motor, {R, C} and {L, J} have a second solution, the swap of G19; {J, K} not."""
    sets = [chosen for size in (1, 2) for chosen in combinations(NOMINAL, size)]
    for found in other_solutions(motor, sets):
        assert found.true == pytest.approx([1.3 * NOMINAL[name] for name in found.parameters])
        expected = SECOND.get(found.parameters)
        assert found.unique == (expected is None), found
        if expected is not None:
            assert len(found.others) == 1
            assert found.others[0] == pytest.approx(expected, abs=1e-3)


def test_the_second_solution_swaps_the_time_constants(motor: StepModel) -> None:
    """(R', C') = (L C/J, J R/L) and (L', J') = (J R/C, L C/R), for other sizes of the fault too."""
    factor = 0.8
    electric, mechanic = other_solutions(motor, [("R", "C"), ("L", "J")], factor)
    (r, c), (ell, j) = electric.true, mechanic.true
    swapped = (NOMINAL["L"] * c / NOMINAL["J"], NOMINAL["J"] * r / NOMINAL["L"])
    assert electric.others[0] == pytest.approx(swapped, rel=1e-6)
    swapped = (j * NOMINAL["R"] / NOMINAL["C"], ell * NOMINAL["C"] / NOMINAL["R"])
    assert mechanic.others[0] == pytest.approx(swapped, rel=1e-6)


def test_a_set_beyond_the_rank_is_a_continuum(motor: StepModel) -> None:
    """Four parameters of the motor cannot be told from three effects: infinitely many values give the same outputs."""
    (found,) = other_solutions(motor, [("R", "L", "J", "C")])
    assert found.continuum
    assert not found.unique


def test_a_solution_outside_its_range_is_none() -> None:
    """With R kept above 2 ohm the second solution of {R, C}, at 0.87 ohm, is not one."""
    text = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")
    bounded = text.replace("{R: 3 ohm}", "{R: {nominal: 3 ohm, range: [2 ohm, 20 ohm]}}")
    assert bounded != text
    model = build_step_model(build_plant(parse_model(bounded)))
    (found,) = other_solutions(model, [("R", "C")])
    assert found.unique


def test_what_there_is_no_time_for_is_said_to_be_skipped(motor: StepModel) -> None:
    """Without time no set is looked at: none counts as unique, and none has a number of roots."""
    for found in other_solutions(motor, [("R",), ("R", "C")], seconds=0.0):
        assert found.skipped == "no time left; raise --budget"
        assert found.roots is None
        assert not found.unique
    assert [item.roots for item in other_solutions(motor, [("R", "C"), ("R",)], seconds=None)] == [2, 1]


def test_small_sets_come_first(motor: StepModel) -> None:
    """With time for a single look the single suspects are looked at, whatever the order of the question."""
    sets = [*combinations(NOMINAL, 4), *((name,) for name in NOMINAL)]
    found = other_solutions(motor, sets, seconds=1e-3)
    skipped = [bool(item.skipped) for item in found]
    assert skipped == sorted(skipped, reverse=True)
    assert skipped[0]


def test_values_that_the_plant_cannot_have_are_said(motor: StepModel) -> None:
    """A plant whose equations end where a parameter is off has no outputs there; the set is skipped, others are not."""
    text = (
        "name: line\nsample_time: 1 s\ninputs: {u: {unit: m}}\ncomponents:\n"
        "  source: {type: Se, law: e = u*log(limit - A), parameters: {A: {nominal: 1, range: [0.5, 1.2]}}}\n"
        "  pipe: {type: R, parameters: {R: 3}}\n  tank: {type: C, parameters: {C: 2}}\n"
        "constants: {limit: 1.25}\njunctions: {line: 1}\nbonds: [source -> line -> pipe, line -> tank]\n"
        "sensors: {flow: {reads: pipe.f, noise: 0.01}}\n"
    )
    model = build_step_model(build_plant(parse_model(text)))
    one, other = other_solutions(model, [("A",), ("R",)])
    assert one.skipped == "no finite solution with these values"
    assert other.unique


def test_an_unknown_name_is_refused(motor: StepModel) -> None:
    """A name that is no parameter is named, with those that are."""
    with pytest.raises(ModelError, match="no parameter Q; there are R, L, K, J, C"):
        other_solutions(motor, [("Q",)])


def test_a_triple_explains_only_what_positive_values_can_give(motor: StepModel) -> None:
    """Of random motors {R, L, J} reaches just those whose three lumps it can give with positive values, less than all.

    With L J/K = a, (J R + L C)/K = b, (R C + K^2)/K = c and nominal K, C: R = (K c - K^2)/C > 0, and J is a root of
    R J^2 - K b J + C K a = 0, real if (K b)^2 >= 4 R C K a.
    """
    names, tried, seed = list(NOMINAL), 15, 3
    factors = np.exp(np.random.default_rng(seed).uniform(np.log(0.5), np.log(2.0), (tried, len(names))))
    possible = 0
    for row in factors:
        r, ell, k, j, c = row * np.array(list(NOMINAL.values()))
        lumps = ell * j / k, (j * r + ell * c) / k, (r * c + k**2) / k
        needed = (NOMINAL["K"] * lumps[2] - NOMINAL["K"] ** 2) / NOMINAL["C"]
        spare = (NOMINAL["K"] * lumps[1]) ** 2 - 4 * needed * NOMINAL["C"] * NOMINAL["K"] * lumps[0]
        possible += bool(needed > 0 and spare >= 0)
    (found,) = reachable(motor, [("R", "L", "J")], behaviours=tried, seed=seed)
    assert 0 < possible < tried
    assert (found.reached, found.tried) == (possible, tried)
