"""Which sets of suspects are identifiable, falsifiable, testable."""

import re
from dataclasses import replace
from itertools import combinations
from math import comb

import numpy as np
import pytest

from faultbond.analysis import testable
from faultbond.analysis.ranks import ReducedSensitivities, above_noise, reduce, told_rank
from faultbond.analysis.testable import (
    EXPLAINS_ANYTHING,
    NOT_IDENTIFIABLE,
    Judgement,
    SetVerdict,
    choose_sets,
    generic_run,
    judge,
    sets_to_test,
    unseen_instruments,
)
from faultbond.arrays import FloatArray
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.errors import StructureError
from faultbond.model.text import parse_model
from faultbond.report.shortcomings import hidden_sentence, unclaimed_sentence
from faultbond.synthesis.specify import build_spec
from plants import example, named, run, stated

TABLE_6_5 = [*[(name,) for name in "RLKJC"], *combinations("RLKJC", 2)]


def generic(model: StepModel, largest: int) -> Judgement:
    """The verdicts on all sets of suspects up to a size, everything excited."""
    suspects = [k for k, item in enumerate(model.plant.graph.parameters) if item.suspect]
    return judge(reduce([generic_run(model)]), suspects, largest)


def test_motor_has_the_fifteen_sets_of_the_table() -> None:
    """From voltage and speed, the sets of table 6.5 are testable and no other; every triple explains anything (G20)."""
    model = example("dc_motor")
    found = generic(model, 5)
    assert (found.rank.value, found.rank.clear, found.left_out) == (3, True, 0)
    assert len(found.verdicts) == 31
    assert named(model, (item.parameters for item in found.verdicts if item.testable)) == TABLE_6_5
    triples = [item for item in found.verdicts if len(item.parameters) == 3]
    assert all(item.identifiable and not item.falsifiable for item in triples)
    assert not any(item.identifiable for item in found.verdicts if len(item.parameters) > 3)
    assert not any(item.uncertain for item in found.verdicts)


def test_motor_with_current() -> None:
    """With the current measured 30 sets are testable; the five together are identifiable, not falsifiable (E12)."""
    found = generic(example("dc_motor_current"), 5)
    assert found.rank.value == 5
    assert sum(item.testable for item in found.verdicts) == 30
    whole = found.verdicts[-1]
    assert (len(whole.parameters), whole.identifiable, whole.falsifiable) == (5, True, False)


def test_motor_at_rest() -> None:
    """In a true steady state only one combination of the motor's parameters shows: no pair is testable."""
    model = example("dc_motor")
    R, L, K, J, C = (item.nominal for item in model.plant.graph.parameters)
    speed = 6.0 * K / (R * C + K * K)
    found = reduce([run(model, np.full(40, 6.0), 0.3, [L * C * speed / K, J * speed])])
    assert (found.rank.value, found.rank.clear) == (1, True)
    assert not any(item.testable for item in judge(found, range(5), 2).verdicts)


def test_tank() -> None:
    """Six of the tank's seven combinations show: all 119 sets up to size five are testable, none of size six."""
    model = example("tank")
    found = generic(model, 7)
    assert (found.rank.value, found.rank.clear) == (6, True)
    assert sum(item.testable for item in found.verdicts) == 119
    assert all(item.testable for item in found.verdicts if len(item.parameters) <= 5)
    unit_of_flow = {"K1", "K2", "K3", "K4", "K6", "K7"}  # all but the pressure of the pump change with it
    (without_pump,) = (item for item in found.verdicts if len(item.parameters) == 6 and not item.identifiable)
    assert set(named(model, [without_pump.parameters])[0]) == unit_of_flow
    assert without_pump.falsifiable


def test_tank_with_valves_that_stand_still() -> None:
    """With constant valves only four combinations show, and K1 and K7, K4 and K6 are dependent."""
    model = example("tank")
    seen = reduce([run(model, np.tile([60.0, 40.0], (60, 1)), 30.0, [0.02])])
    assert (seen.rank.value, seen.rank.clear) == (4, True)
    found = judge(seen, range(7), 2)
    bad = [item for item in found.verdicts if not item.identifiable]
    assert sorted(sorted(chosen) for chosen in named(model, (item.parameters for item in bad))) == [
        ["K1", "K7"],
        ["K4", "K6"],
    ]
    assert all(item.falsifiable for item in bad)


def test_ranks_of_the_other_examples() -> None:
    """Only what scales together stays hidden: one factor of force in the carriage, of volume in tank 4, R C in rc."""
    assert generic(example("rc"), 1).rank.value == 1
    assert generic(example("rlc"), 1).rank.value == 2
    assert generic(example("emps"), 1).rank.value == 4
    assert generic(example("cascaded_tanks"), 1).rank.value == 6


def test_nothing_testable_leaves_the_smallest_sets() -> None:
    """Where one time constant is all that shows, each of R and C explains anything; the bank still gets both."""
    found = choose_sets(example("rc", ("max_faults: 1", "max_faults: 2")))
    assert found.sets == ((0,), (1,))
    assert found.dropped == (((0, 1), NOT_IDENTIFIABLE),)


def test_sets_that_explain_anything_are_dropped() -> None:
    """Of the RLC circuit's sets, the pairs explain anything and are dropped with that reason."""
    found = choose_sets(example("rlc", ("max_faults: 1", "max_faults: 2")))
    assert found.sets == ((0,), (1,), (2,))
    assert found.dropped == tuple((pair, EXPLAINS_ANYTHING) for pair in combinations(range(3), 2))


def test_a_part_that_no_sensor_sees() -> None:
    """A parameter without any effect on a sensor is not identifiable, alone or with others, and never chosen."""
    model = stated(
        "name: two circuits\nsample_time: 0.1 s\nmax_faults: 2\ninputs: {V: {unit: V}}\ncomponents:\n"
        "  source: {type: Se, law: e = V}\n  other: {type: Se, law: e = V}\n"
        "  R: {type: R, parameters: {R: 2 ohm}}\n  C: {type: C, parameters: {C: 1 F}}\n"
        "  S: {type: R, parameters: {S: {nominal: 3 ohm, suspect: no}}}\n  D: {type: R, parameters: {D: 4 ohm}}\n"
        "junctions: {line: 1, node: 0}\nbonds: [source -> line -> S, line -> node -> C, node -> R, other -> D]\n"
        "sensors: {v: {reads: node.e, unit: V, noise: 1 mV}}\n"
    )
    found = choose_sets(model)
    assert named(model, found.sets) == [("R",), ("C",)]
    dropped = named(model, (chosen for chosen, _ in found.dropped))
    assert dropped == [("D",), ("R", "C"), ("R", "D"), ("C", "D")]
    assert [reason == EXPLAINS_ANYTHING for _, reason in found.dropped] == [False, True, False, False]


def test_no_suspects_no_sets() -> None:
    """A plant without suspects has no sets."""
    trusted = [(value, f"{{nominal: {value}, suspect: no}}") for value in ("10 kohm", "100 uF")]
    assert choose_sets(example("rc", *trusted)).sets == ()


def test_all_sets_where_no_run_tells_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the equations have no solution along any random run, no set is dropped."""
    monkeypatch.setattr(testable, "sensitivities", lambda _recursion, runs, **_: (None,) * len(runs))
    with pytest.raises(StructureError, match="the equations of DC motor have no finite solution along random inputs"):
        generic_run(example("dc_motor"))
    found = choose_sets(example("dc_motor"))
    assert (len(found.sets), found.dropped) == (15, ())


def test_many_sets_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond a number of sets the largest are not judged, and counted."""
    monkeypatch.setattr(testable, "MOST_SETS", 40)
    seen = ReducedSensitivities(
        outputs=("y",),
        parameters=tuple(f"P{k}" for k in range(9)),
        steps=np.ones(9),
        relative=np.ones(9, dtype=bool),
        columns=np.eye(9),
        row_outputs=np.zeros(9, dtype=np.intp),
        lengths=np.ones(9),
        matrix=np.eye(9),
        rank=told_rank(np.ones(9)),
    )
    found = judge(seen, range(9), 3)
    assert len(found.verdicts) == 40
    assert found.left_out == 9 + comb(9, 2) + comb(9, 3) - 40
    assert found.verdicts[-1].parameters == tuple(combinations(range(9), 2))[40 - 9 - 1]


def values(*logarithms: float) -> FloatArray:
    """Singular values from their decades."""
    return 10.0 ** np.array(logarithms)


def test_a_clear_gap_tells_the_rank() -> None:
    """A rank is told at the gap, whatever the size of the smallest value kept, if the gap is wide."""
    found = told_rank(values(1, 0, -3, -14.5, -15))
    assert (found.value, found.least, found.clear) == (3, 3, True)
    assert found.kept == pytest.approx(1e-4)
    assert found.dropped == pytest.approx(10**-15.5)
    assert told_rank(values(0, -8, -9, -14)).value == 3
    assert told_rank(values(0, -8, -9)).value == 3
    assert told_rank(np.zeros(3)).value == 0


def test_no_gap_is_uncertain() -> None:
    """Values that fall into rounding without a gap leave the rank open: every column may count."""
    found = told_rank(values(0, -2, -4, -6, -8, -10, -12, -13.5, -15))
    assert (found.value, found.least, found.clear) == (9, 4, False)


def test_uncertain_sets_are_kept() -> None:
    """A set whose sensitivities are dependent but for a trace counts as identifiable, and as uncertain."""
    angle = 1e-11
    matrix = np.array([[1.0, 1.0, 0.0, 1.0], [0.0, angle, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    rank = told_rank(values(0, -3, -6, -8, -10, -11.5, -13, -14))
    seen = ReducedSensitivities(
        outputs=("y",),
        parameters=("A", "B", "C", "D"),
        steps=np.ones(4),
        relative=np.ones(4, dtype=bool),
        columns=matrix,
        row_outputs=np.zeros(3, dtype=np.intp),
        lengths=np.ones(4),
        matrix=matrix,
        rank=rank,
    )
    verdicts = {item.parameters: item for item in judge(seen, range(4), 2).verdicts}
    assert (verdicts[0, 1].identifiable, verdicts[0, 1].uncertain) == (True, True)
    assert verdicts[0, 2].testable


def test_noise_hides_what_is_small() -> None:
    """Above noise count only combinations whose effect exceeds three noises: fewer in a short record than in a long."""
    model = example("tank")
    ranks = []
    for n in (60, 600):
        found = run(model, np.tile([60.0, 40.0], (n, 1)), 1.0, [0.02])
        seen = reduce([found], np.array([2.8e-6, 180.0]))
        assert seen.rank.value == 4
        changes = np.array([item.change / item.scale for item in model.plant.graph.parameters])
        effects = np.linalg.svd(seen.columns * seen.lengths * changes, compute_uv=False)
        hidden = above_noise(seen, changes)
        assert np.linalg.svd(hidden.matrix, compute_uv=False) == pytest.approx(effects[:4], rel=1e-6)
        assert hidden.rank.value == int(np.sum(effects > 3.0))
        ranks.append(hidden.rank.value)
    assert ranks[0] < ranks[1] <= 4


def test_where_rounding_decides_all_verdicts_are_uncertain() -> None:
    """Singular values that fall into rounding without a gap leave no rank that is certain, so no verdict."""
    clear, blurred = (
        told_rank(np.array(values)) for values in ([1.0, 0.5, 0.0], [1.0, 1e-4, 1e-8, 1e-10, 1e-12, 1e-14])
    )
    seen = reduce([generic_run(example("dc_motor"))])
    for rank in (clear, blurred):
        shown = judge(replace(seen, rank=replace(seen.rank, clear=rank.clear)), range(5), 1)
        assert {item.uncertain for item in shown.verdicts} == {not rank.clear}
    assert not blurred.clear


def test_without_testable_sets_the_smallest_identifiable_are_tested() -> None:
    """Of two suspects of which each alone and both explain anything, each alone is tested."""
    verdicts = tuple(
        SetVerdict(parameters=chosen, identifiable=True, falsifiable=False, uncertain=False)
        for chosen in ((0,), (1,), (0, 1))
    )
    choice = sets_to_test(Judgement(rank=told_rank(np.array([1.0, 0.5])), verdicts=verdicts))
    assert choice.sets == ((0,), (1,))
    assert choice.dropped == (((0, 1), EXPLAINS_ANYTHING),)


def test_what_shows_only_where_inputs_are_used_is_tested() -> None:
    """A leak that flows from 60 bar on only: a random supply lies below; where the fit has seen it, it does not."""
    text = """
name: filling
sample_time: 1 s
max_faults: 1
constants: {p0: 60 bar}
inputs: {ps: {unit: bar}}
components:
  orifice: {type: Sf, law: "f = K*sqrt(max(ps - vessel.e, 0))", parameters: {K: 1e-8 m^3/s/Pa^0.5}}
  store: {type: C, law: q = C*e, parameters: {C: 1e-9 m^3/Pa}}
  outlet: {type: Sf, law: "f = -L*max(vessel.e - p0, 0)", parameters: {L: 1e-11 m^3/s/Pa}}
junctions: {vessel: 0}
bonds: [orifice -> vessel -> store, outlet -> vessel]
sensors: {p: {reads: vessel.e, unit: bar, noise: 0.1 bar}}
"""
    fitted = text.replace("unit: bar}}\ncomp", "unit: bar, fitted_range: [130, 170]}}\ncomp")
    assert choose_sets(build_step_model(build_plant(parse_model(text)))).dropped == (((2,), NOT_IDENTIFIABLE),)
    assert choose_sets(build_step_model(build_plant(parse_model(fitted)))).sets == ((0,), (1,), (2,))


DRAINED = """\
name: tank in the rain
sample_time: 1 s
constants: {full: 100 percent}
inputs:
  u: {unit: percent}
  v: {unit: percent}
  rain: {unit: l/s, unknown: 0.02 l/s over 300 s}
components:
  pump: {type: Sf, law: f = G*u, parameters: {G: 2e-6 m^3/s/percent}}
  tank1: {type: C, law: e = q/A1, parameters: {A1: 0.015 m^2}}
  pipe: {type: R, law: f = K12*sign(e)*sqrt(abs(e)), parameters: {K12: 1.6e-4 m^2.5/s}}
  tank2: {type: C, law: e = q/A2, parameters: {A2: 0.015 m^2}}
  outlet: {type: R, law: f = K2*v/full*sqrt(e), parameters: {K2: 2e-4 m^2.5/s}}
  roof: {type: Sf, law: f = rain}
junctions: {n1: 0, n2: 0, mid: 1}
bonds: [pump -> n1 -> tank1, n1 -> mid -> n2, mid -> pipe, n2 -> tank2, n2 -> outlet, roof -> n2]
sensors:
  l1: {reads: n1.e, unit: cm, noise: 0.1 cm}
  l2: {reads: n2.e, unit: cm, noise: 0.1 cm}
"""


def test_an_instrument_whose_fault_an_unknown_input_may_do_is_no_hypothesis() -> None:
    """As the parameters of which that is so: the outlet's valve, its coefficient and the second tank; no sensor is."""
    model = build_step_model(build_plant(parse_model(DRAINED)))
    assert unseen_instruments(model) == {"v"}
    spec = build_spec(model)
    assert [item.name for item in spec.instruments] == ["l1", "l2", "u"]
    assert hidden_sentence(spec) == (
        "It was not tested whether A2 and K2 changed, or whether input v is wrong, of which no run with the model "
        "showed anything: such a fault is put down to others."
    )
    known = build_step_model(build_plant(parse_model(DRAINED.replace(", unknown: 0.02 l/s over 300 s", ""))))
    assert unseen_instruments(known) == frozenset()
    spec = build_spec(known)
    assert {item.name for item in spec.instruments} >= {"l1", "l2", "u", "v"}
    assert hidden_sentence(spec) == ""


@pytest.mark.parametrize(
    ("moves", "told"),
    [
        ({}, ""),
        ({"A1": "3 %"}, ""),
        ({"A1": "40 %"}, "Of A1 only changes by more than half would be told: healthy data seem to move it so far "),
        ({"A1": "40 %", "K12": "90 %"}, "Of A1 and K12 only changes by more than half would be told: healthy data "),
    ],
)
def test_of_what_moves_while_healthy_little_is_told(moves: dict[str, str], told: str) -> None:
    """A change that a healthy part may make is no fault, so that none was found says little of it."""
    text = DRAINED
    for name, size in moves.items():
        text = re.sub(rf"\b{name}: ([^{{}},]+)([,}}])", rf"{name}: {{nominal: \1, healthy_change: {size}}}\2", text)
    said = unclaimed_sentence(build_spec(build_step_model(build_plant(parse_model(text)))))
    assert said.startswith(told)
    assert bool(said) is bool(told)
