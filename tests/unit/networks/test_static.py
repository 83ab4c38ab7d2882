"""Static networks of numbers and of logic: detection, diagnoses, branches, loops, noise, missing values."""

from collections.abc import Sequence
from dataclasses import replace
from math import exp, inf, nan, sqrt

import numpy as np
import pytest
import sympy as sp

from faultbond.contract.findings import Detection, Diagnosis
from faultbond.errors import RecordingError, StructureError
from faultbond.io.grid import GridPoint
from faultbond.model.text import parse_model
from faultbond.networks import polynomial_roots as static_solve
from faultbond.networks.detection import watch
from faultbond.networks.hypothesis import Hypothesis, advance
from faultbond.networks.static_network import (
    Observation,
    StaticNetwork,
    conflicts,
    observation,
    static_network,
    with_healthy,
)
from faultbond.thesis.tables import solve_suspects, table_relations

Row = tuple[float, ...]

PRODUCT = """
sample_time: none
inputs: {x: {}}
blocks:
  a: {law: p = A*x, parameters: {A: {nominal: 2, range: any}}}
  b: {law: y = B*p, parameters: {B: {nominal: 3, range: any}}}
sensors: {y: {reads: y}}
"""
SUM = """
sample_time: none
inputs: {x: {}, z: {}}
blocks:
  a: {law: p = A*x, parameters: {A: 2}}
  b: {law: q = B*z, parameters: {B: 3}}
  s: {law: s = p + q}
sensors: {p: {reads: p}, s: {reads: s}}
"""
GAUGES = """
sample_time: none
inputs: {in1: {}, in2: {}, in3: {}, in4: {}}
blocks:
  A: {law: S1 = in3 + in4}
  B: {law: S2 = in1 + in2}
  C: {law: S3 = S1*S2}
  D: {law: out1 = S1 + S2}
  E: {law: out2 = S1*S3}
sensors: {out1: {reads: out1, noise: 0.01}, out2: {reads: out2, noise: 0.01}}
"""


def grid_points(text: str, rows: Sequence[Row]) -> list[GridPoint]:
    """Give rows of inputs and readings as grid points."""
    count = len(parse_model(text).inputs)
    return [
        GridPoint(index=k, time=float(k), dt=0.0, u=np.array(row[:count]), y=np.array(row[count:]))
        for k, row in enumerate(np.array(rows, dtype=np.float64).tolist())
    ]


def report(text: str, rows: Sequence[Row]) -> tuple[Detection | None, list[Diagnosis]]:
    """Give the detection and the diagnoses of rows."""
    records = list(watch(parse_model(text), grid_points(text, rows)))
    if not records:
        return None, []
    first, *rest = records
    assert isinstance(first, Detection)
    return first, [item for item in rest if isinstance(item, Diagnosis)]


def estimates(diagnosis: Diagnosis) -> dict[tuple[str, ...], list[tuple[float, ...]]]:
    """Give the estimates by set of parameters, in the order in which they are reported."""
    found: dict[tuple[str, ...], list[tuple[float, ...]]] = {}
    for item in diagnosis.candidates:
        found.setdefault(item.parameters, []).append(tuple(suspect.estimate for suspect in item.suspects))
    return found


def singles(diagnosis: Diagnosis) -> dict[str, float]:
    """Give the only estimate of each single parameter."""
    return {names[0]: value for names, ((value,),) in estimates(diagnosis).items()}


def blocks(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Give the suspected blocks."""
    return [item.blocks for item in diagnosis.candidates]


def observed(text: str, rows: Sequence[Row]) -> tuple[StaticNetwork, list[Observation]]:
    """Give the network and its observations."""
    network = static_network(parse_model(text))
    return network, [observation(network, point) for point in grid_points(text, rows)]


def test_healthy_observations_report_nothing() -> None:
    """As long as all rows agree with the network there is no record."""
    assert report(PRODUCT, [(1, 6), (2, 12), (0, 0)]) == (None, [])


def test_detection_at_the_first_row_that_contradicts() -> None:
    """The detection names its row and sensor; one diagnosis follows for it and for each later row."""
    detection, diagnoses = report(SUM, [(1, 1, 2, 5), (1, 1, 2, 6), (1, 2, 2, 10)])
    assert detection == Detection(time=1.0, sample=1, change_time=1.0, signals=("s",))
    assert [item.time for item in diagnoses] == [1.0, 2.0]
    assert estimates(diagnoses[-1]) == {("B",): [(4.0,)]}


def test_rows_before_the_detection_do_not_count() -> None:
    """A healthy row before the fault is not held against the changed parameter."""
    _, diagnoses = report(SUM, [(1, 1, 2, 5), (1, 1, 4, 7)])
    assert estimates(diagnoses[-1]) == {("A",): [(4.0,)]}


def test_a_reading_that_a_suspect_cannot_change_clears_it() -> None:
    """B does not influence p, and so cannot explain it, at any value."""
    detection, (diagnosis,) = report(SUM, [(1, 1, 4, 7)])
    assert detection is not None
    assert detection.signals == ("p", "s")
    assert estimates(diagnosis) == {("A",): [(4.0,)]}


def test_larger_sets_when_no_smaller_one_explains() -> None:
    """Two changed parameters are found once no single one fits all rows, with values that fit all."""
    _, (diagnosis,) = report(SUM, [(1, 1, 4, 8)])
    assert estimates(diagnosis) == {("A", "B"): [(4.0, 4.0)]}


def test_no_set_up_to_the_limit_explains() -> None:
    """With one fault at most, two changed parameters leave a diagnosis without candidates."""
    _, diagnoses = report(SUM.replace("none\n", "none\nmax_faults: 1\n", 1), [(1, 1, 4, 8), (1, 1, 4, 8)])
    assert [item.candidates for item in diagnoses] == [(), ()]


def test_sets_that_observations_do_not_determine() -> None:
    """Where only a pair can explain a single row, one of its infinitely many solutions is given, with no certainty."""
    text = SUM.replace("a + b", "a").replace("sensors: {p: {reads: p}, s: {reads: s}}", "sensors: {s: {reads: s}}")
    pair = text.replace("{A: 2}", "{A: {nominal: 2, range: [1, 3]}}").replace(
        "{B: 3}", "{B: {nominal: 3, range: [2, 4]}}"
    )
    _, (diagnosis,) = report(pair, [(1, 1, 6.5)])
    (candidate,) = diagnosis.candidates
    a, b = candidate.suspects
    assert a.estimate + b.estimate == pytest.approx(6.5)
    assert a.sd == b.sd == inf
    network, rows = observed(pair, [(1, 1, 6.5)])
    assert solve_suspects(network, ("A", "B"), rows).free


def test_equations_without_real_solution_explain_nothing() -> None:
    """The square of a sum cannot be negative, whatever its parameters."""
    text = """
sample_time: none
inputs: {x: {}, z: {}}
blocks:
  a: {law: p = A*x + B*z, parameters: {A: {nominal: 1, range: [-2.1, 2.1]}, B: {nominal: 1, range: [0, 4]}}}
  b: {law: y = p**2}
sensors: {y: {reads: y}}
"""
    _, (diagnosis,) = report(text, [(1, 1, -4)])
    assert diagnosis.candidates == ()


def test_stated_ranges_discard_roots() -> None:
    """Of the two roots of a square, the one outside the range of its parameter is no diagnosis."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = (A*x)**2, parameters: {A: {nominal: 1, range: any}}}}
sensors: {y: {reads: y}}
"""
    _, (both,) = report(text, [(2, 36)])
    assert estimates(both) == {("A",): [(3.0,), (-3.0,)]}
    _, (one,) = report(text.replace("any", "[0, 10]"), [(2, 36)])
    assert estimates(one) == {("A",): [(3.0,)]}


def test_roots_outside_their_branch_are_discarded() -> None:
    """Friction of one value forward and another backward: a row tells of the branch that it is in."""
    text = """
sample_time: none
inputs: {v: {}, w: {}}
blocks:
  friction: {law: "f = where(v > 0, C1, C2)", parameters: {C1: 2, C2: {nominal: -3, range: any}}}
  load: {law: y = f + G*w, parameters: {G: 4}}
sensors: {y: {reads: y}}
"""
    _, diagnoses = report(text, [(1, 1, 7), (-1, 1, 1)])
    assert estimates(diagnoses[0]) == {("C1",): [(3.0,)], ("G",): [(5.0,)]}
    assert estimates(diagnoses[1]) == {("C1",): [(3.0,)]}


def test_branches_that_depend_on_the_suspect() -> None:
    """|A x| = 6 has a root in each branch; max(A x, 1) = 6 has one."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: "y = FORM", parameters: {A: {nominal: 1, range: any}}}}
sensors: {y: {reads: y}}
"""
    expected = {
        "abs(A*x)": [(3.0,), (-3.0,)],
        "max(A*x, 1)": [(3.0,)],
        "min(A*x, 10)": [(3.0,)],
        "where(A > 2, 2*A, A + 100)": [(3.0,), (-94.0,)],
        "A*x + sign(A)": [(2.5,)],
    }
    for form, values in expected.items():
        _, (diagnosis,) = report(text.replace("FORM", form), [(2, 6)])
        assert estimates(diagnosis) == {("A",): values}, form
    _, (diagnosis,) = report(text.replace("FORM", "x*sign(A)"), [(2, 0)])
    assert estimates(diagnosis) == {("A",): [(0.0,)]}


def test_roots_of_numbers() -> None:
    """A square root is undone by squaring, and a root with the wrong sign is not taken."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = sqrt(A*x + B) - 1, parameters: {A: 2, B: 1}}}
sensors: {y: {reads: y}}
"""
    _, (diagnosis,) = report(text, [(4, 4)])
    assert estimates(diagnosis) == {("A",): [(6.0,)], ("B",): [(17.0,)]}
    assert report(text, [(4, -3)])[1][0].candidates == ()


def test_quotients() -> None:
    """A parameter below a fraction line is found."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: q = x/P, parameters: {P: 4}}, b: {law: y = q/(q + B), parameters: {B: 2}}}
sensors: {y: {reads: y}}
"""
    _, (diagnosis,) = report(text, [(8, 0.6)])
    assert singles(diagnosis) == pytest.approx({"P": 8 / 3, "B": 4 / 3})


def test_functions_without_closed_form() -> None:
    """A parameter inside an exponential and outside of it is found by search, the other is cleared by a second row."""
    text = """
sample_time: none
max_faults: 1
inputs: {x: {}}
blocks: {a: {law: q = exp(A*x) + A, parameters: {A: 1}}, b: {law: y = K*q, parameters: {K: 3}}}
sensors: {y: {reads: y}}
"""
    rows = [(x, 3 * (exp(1.5 * x) + 1.5)) for x in (1.0, 2.0)]
    _, diagnoses = report(text, rows)
    assert set(estimates(diagnoses[0])) == {("A",), ("K",)}
    assert singles(diagnoses[1]) == pytest.approx({"A": 1.5})


def test_systems_that_are_too_large_are_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search finds some solutions of a few rows, and goes on when later rows discard them."""
    monkeypatch.setattr(static_solve, "MAX_SOLUTIONS", 0)
    text = """
sample_time: none
inputs: {x: {}, z: {}}
blocks:
  a: {law: p = A*x**2 - x, parameters: {A: {nominal: 1, range: any}}}
  b: {law: y = B*p**2 - z, parameters: {B: {nominal: 2, range: any}}}
sensors: {y: {reads: y}}
"""
    rows = [(x, z, -2 * (3 * x * x - x) ** 2 - z) for x, z in ((1, 1), (2, 1), (3, 2), (-1, 2))]
    _, diagnoses = report(text, rows)
    ((pair,),) = estimates(diagnoses[-1]).values()
    assert pair == pytest.approx((3.0, -2.0))


def test_what_was_searched_for_is_searched_again() -> None:
    """Points that a search found may not be all: when a row discards them, another search takes their place."""
    network, rows = observed(PRODUCT, [(4, 32)])
    wrong = Hypothesis(suspects=("A",), points=({"A": sp.Integer(5)},), systems=())
    seen = [with_healthy(network, row) for row in rows]
    assert not advance(network, wrong, seen).is_possible
    (point,) = advance(network, replace(wrong, searched=True), seen).points
    assert float(point["A"]) == pytest.approx(8 / 3)


def test_loops_of_blocks() -> None:
    """A feedback loop is solved at once: y = G (x - H y)."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {e: {law: e = x - H*y, parameters: {H: 0.5}}, g: {law: y = G*e, parameters: {G: 4}}}
sensors: {y: {reads: y}}
"""
    _, diagnoses = report(text, [(3, 4), (3, 2)])
    assert estimates(diagnoses[0]) == {("H",): [(1.25,)], ("G",): [(1.0,)]}
    noisy = text.replace("reads: y}", "reads: y, noise: 0.01}")
    _, diagnoses = report(noisy, [(3, 4.003), (3, 2.01)])
    assert singles(diagnoses[0])["G"] == pytest.approx(1.0, abs=0.02)
    with pytest.raises(StructureError, match="e, g form a loop that is not linear"):
        report(noisy.replace("H*y", "H*y**2"), [(3, 4)])


def test_equations_that_define_no_signal() -> None:
    """Equations of any form between stated signals are solved together."""
    text = """
sample_time: none
inputs: {x: {}}
blocks:
  one: {law: 0 = u*v - A*x, parameters: {A: 6}, signals: [u, v]}
  two: {law: 0 = u - B*v, parameters: {B: 1.5}}
sensors: {u: {reads: u}, v: {reads: v}}
"""
    detection, diagnoses = report(text, [(1, 3, 2), (1, 4, 2), (4, 8, 4)])
    assert detection is not None
    assert detection.sample == 1
    assert estimates(diagnoses[-1]) == {("A", "B"): [(8.0, 2.0)]}


def test_missing_values() -> None:
    """What is there of a row is used; a row without any reading is passed over."""
    rows = [(1, nan, 2, nan), (nan, 1, 3, 9), (1, 1, nan, nan), (2, nan, 6, nan)]
    detection, diagnoses = report(SUM, rows)
    assert detection is not None
    assert detection.sample == 1  # with x unknown, p = 3 and s = 9 leave q = 6
    assert [item.time for item in diagnoses] == [1.0, 3.0]
    assert estimates(diagnoses[0]) == {("B",): [(6.0,)]}
    assert estimates(diagnoses[1]) == {("A", "B"): [(3.0, 6.0)]}


def test_a_missing_input_behind_rounded_readings() -> None:
    """Two readings that give the same input but for rounding agree; otherwise they contradict each other."""
    text = """
sample_time: none
inputs: {u: {}}
blocks:
  a: {law: s = (u + A)**2, parameters: {A: 0.25}}
  b: {law: t = (u - B)**2, parameters: {B: 1}}
sensors: {s: {reads: s}, t: {reads: t}}
"""
    s = (-3.2123456789 + 0.25) ** 2
    assert report(text, [(nan, s, (-3.2123456789 - 1) ** 2)]) == (None, [])
    detection, _ = report(text, [(nan, s, (-3.2123456789 - 1) ** 2 + 0.1)])
    assert detection is not None


def test_laws_that_nobody_reads_do_not_matter() -> None:
    """A missing input is found in the branch of a maximum, however an unread law depends on it."""
    text = """
sample_time: none
inputs: {u: {}, v: {}}
blocks:
  a: {law: "s = max(u*v + A, B)", parameters: {A: 2, B: 10}}
  b: {law: t = exp(-(v - u)**2) + u}
  c: {law: w = sin(t)}
sensors: {s: {reads: s}}
"""
    assert report(text, [(nan, 1.75, 10.05)]) == (None, [])
    detection, _ = report(text, [(nan, 1.75, 9.95)])
    assert detection is not None


def test_rounded_data_are_not_taken_for_a_fault() -> None:
    """Values that are converted from a unit are no exact decimals, and agree nevertheless."""
    assert 57 * 0.01 != 0.57
    rows = [(0.57, 0.29, 1.14, 2.01), (0.57, 0.29, 1.71, 2.58), (0.58, 0.31, 1.74, 2.67)]
    scaled = [tuple(100 * value * 0.01 for value in row) for row in rows]
    detection, diagnoses = report(SUM, scaled)
    assert detection is not None
    assert detection.sample == 1
    assert singles(diagnoses[-1]) == pytest.approx({"A": 3.0})


def test_rounding_where_terms_cancel() -> None:
    """A difference of equal terms that is 1e-17 instead of 0 agrees; 1e-6 does not."""
    text = SUM.replace("p + q", "p - q")
    assert report(text, [(0.3, 0.2, 0.6, 0.0), (0.3, 0.2, 0.6, 1e-17)]) == (None, [])
    assert report(text, [(0.3, 0.2, 0.6, 1e-6)])[0] is not None


def test_a_double_root_of_rounded_data() -> None:
    """(A - 3)^2 = -1e-17 has no real root, but that is rounding."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = A**2 - 6*A*x + 9*x, parameters: {A: {nominal: 1, range: any}}}}
sensors: {y: {reads: y}}
"""
    _, (diagnosis,) = report(text, [(1, -1e-17)])
    assert singles(diagnosis) == pytest.approx({"A": 3.0})


def test_an_observation_seen_twice_tells_nothing_new() -> None:
    """The same row again, with a rounding error, neither determines a pair nor rejects it."""
    text = """
sample_time: none
inputs: {x: {}, z: {}}
blocks:
  a: {law: p = A*x, parameters: {A: {nominal: 2, range: any}}}
  b: {law: q = B*z, parameters: {B: {nominal: 3, range: any}}}
  s: {law: s = p + q}
sensors: {s: {reads: s}}
"""
    network, rows = observed(text, [(1, 2, 12), (1, 2, 12), (1, 2, 12 + 1e-11), (2, 1, 13)])
    assert solve_suspects(network, ("A", "B"), rows[:3]).free
    (point,) = solve_suspects(network, ("A", "B"), rows).points
    assert [float(point[name]) for name in "AB"] == pytest.approx([14 / 3, 11 / 3])


def test_a_suspect_without_influence_stays_open() -> None:
    """A factor of 0 says nothing of its parameter, and nothing can be explained by it."""
    network, (agreeing, wrong) = observed(PRODUCT, [(0, 0), (0, 5)])
    assert solve_suspects(network, ("A",), [agreeing]).free
    assert not solve_suspects(network, ("A",), [wrong]).explains
    assert table_relations(network, ("A", "B"), agreeing) == ()


def test_relation_with_its_singular_case() -> None:
    """Two factors are tied by their product; the relation fails where the other one is 0."""
    network, rows = observed(PRODUCT, [(4, 32)])
    (relation,) = table_relations(network, ("A", "B"), rows[0])
    assert (relation.text, relation.unless) == ("A = 8/B", ("B = 0",))


def test_constancy_of_two_roots() -> None:
    """A root that the second row does not share is dropped, the other kept."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = (A*x + 1)**2, parameters: {A: {nominal: 0, accuracy: 1, change: 1}}}}
sensors: {y: {reads: y}}
"""
    _, diagnoses = report(text, [(1, 9), (2, 25)])
    assert estimates(diagnoses[0]) == {("A",): [(2.0,), (-4.0,)]}
    assert estimates(diagnoses[1]) == {("A",): [(2.0,)]}


def test_irrational_roots_have_full_precision() -> None:
    """Both roots of A^2 = 2 are kept over further rows."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = A**2*x, parameters: {A: {nominal: 1, range: any}}}}
sensors: {y: {reads: y}}
"""
    _, diagnoses = report(text, [(1, 2), (3, 6), (0.1, 0.2)])
    assert estimates(diagnoses[-1]) == {("A",): [(sqrt(2.0),), (-sqrt(2.0),)]}


def test_fit_over_all_rows_with_noise() -> None:
    """With noise, estimate and standard deviation come from all rows, and the true set is kept."""
    rng = np.random.default_rng(1)
    x, z = rng.uniform(1.0, 4.0, (2, 50))
    text = SUM.replace("reads: p", "reads: p, noise: 0.1").replace("reads: s", "reads: s, noise: 0.1")
    rows = np.column_stack([x, z, 2 * x, 2 * x + 4 * z]) + rng.standard_normal((50, 4)) * [0, 0, 0.1, 0.1]
    _, diagnoses = report(text, [tuple(row) for row in rows])
    ((suspect,),) = (item.suspects for item in diagnoses[-1].candidates)
    assert suspect.parameter == "B"
    assert suspect.sd == pytest.approx(0.1 / sqrt(float(np.sum(z**2))), rel=1e-6)
    assert abs(suspect.estimate - 4.0) < 3.0 * suspect.sd


def test_noise_of_inputs_counts() -> None:
    """A reading that input noise explains is no fault, and one beyond it is."""
    text = PRODUCT.replace("x: {}", "x: {noise: 0.1}")
    assert report(text, [(1.2, 6.0)]) == (None, [])  # 6 times 0.2 is two standard deviations
    detection, _ = report(text, [(2.2, 6.0)])
    assert detection is not None


def test_both_roots_with_noise() -> None:
    """Each root is a fit of its own as long as both pass the test."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = (A*x + 1)**2, parameters: {A: {nominal: 1, range: any}}}}
sensors: {y: {reads: y, noise: 0.1}}
"""
    _, diagnoses = report(text, [(1, 9.05), (2, 24.95)])
    assert [item[0] for item in estimates(diagnoses[0])["A",]] == pytest.approx([2.0, -4.0], abs=0.05)
    assert [item[0] for item in estimates(diagnoses[1])["A",]] == pytest.approx([2.0], abs=0.05)


ROOT = """
sample_time: none
inputs: {u: {}}
blocks:
  a: {law: x = (u - A)**0.5, parameters: {A: 1}}
  b: {law: y = B*x - C, parameters: {B: 2, C: 0.5}}
sensors: {y: {reads: y, noise: 0.01}}
"""


def test_values_without_a_real_reading_explain_nothing() -> None:
    """With A beyond u the root is not real; that is no fit of the readings, however few are left."""
    rows = [(3.0, 0.2 * sqrt(2.0) - 0.5 + error) for error in (0.01, -0.01, 0.005, -0.005)]
    _, diagnoses = report(ROOT, rows)
    assert singles(diagnoses[-1]) == pytest.approx({"A": 2.98, "B": 0.2, "C": 3.05}, abs=0.01)


@pytest.mark.parametrize("noise", [", noise: 0.01", ""])
def test_a_healthy_network_without_a_real_reading(noise: str) -> None:
    """Where the nominal root is not real the reading contradicts, and a smaller A that explains it is found."""
    detection, diagnoses = report(ROOT.replace(", noise: 0.01", noise), [(0.5, 0.5), (0.5, 0.5)])
    assert detection is not None
    ((a,),) = estimates(diagnoses[-1])["A",]
    assert a == pytest.approx(0.25, abs=1e-6)


def test_infinite_readings_agree_with_nothing() -> None:
    """A quotient by an input of 0 is no number, and so agrees with no reading; unless there is none."""
    text = PRODUCT.replace("A*x", "A/x")
    assert report(text, [(0, nan), (1, 6)]) == (None, [])
    for noise in ("", ", noise: 0.1"):
        detection, _ = report(text.replace("reads: y", f"reads: y{noise}"), [(0, 6), (1, 6)])
        assert detection is not None
        assert detection.sample == 0


def test_infinite_slopes_are_no_error() -> None:
    """A root at 0 is infinitely steep in its noisy input, so that its reading says nothing; later rows do."""
    text = ROOT.replace("(u - A)**0.5", "A*u**0.5").replace("u: {}", "u: {noise: 0.02}").replace(", noise: 0.01", "")
    detection, _ = report(text, [(0, 3), (4, 3.5), (4, 9)])
    assert detection is not None
    assert detection.sample == 2


def test_readings_with_the_noise_of_one_input_alone() -> None:
    """Exact sensors behind one noisy input contradict each other long before they contradict the input."""
    text = SUM.replace("x: {}", "x: {noise: 5}").replace("s: {reads: s}", "s: {reads: s}, t: {reads: s + p}")
    assert report(text, [(1.1, 1, 2, 5, 7)]) == (None, [])
    detection, diagnoses = report(text, [(1.1, 1, 2, 5.001, 7.001)])
    assert detection is not None
    assert singles(diagnoses[-1]) == pytest.approx({"B": 3.001})


def test_readings_whose_input_is_missing_do_not_count() -> None:
    """They neither explain nor make the test of the others milder."""
    text = SUM.replace("reads: p", "reads: p, noise: 0.01").replace("reads: s", "reads: s, noise: 0.01")
    far = [(1, 1, 2.40, nan), (1, 1, 2.45, nan), (1, 1, 2.35, nan)]
    lacking = [(nan, 1, k, k) for k in range(40)]
    for rows in (far, [far[0], *lacking, *far[1:]]):
        _, diagnoses = report(text, rows)
        assert diagnoses[-1].candidates == ()
    _, diagnoses = report(text, [far[0], *lacking, far[0]])
    assert singles(diagnoses[-1]) == pytest.approx({"A": 2.4})


def test_a_pair_without_a_real_reading_at_the_nominal_values() -> None:
    """No single parameter gives 2.5 where u is 0.5, and the nominal pair gives no real number to start from."""
    text = ROOT.replace("C: 0.5", "C: {nominal: 0.5, suspect: no}")
    _, diagnoses = report(text, [(0.5, 2.5)])
    (((a, b),),) = estimates(diagnoses[-1]).values()
    assert b * sqrt(0.5 - a) - 0.5 == pytest.approx(2.5, abs=0.02)


def test_what_noisy_readings_leave_open() -> None:
    """A pair of which one row tells the sum only has no standard deviation; after a second row it has."""
    text = """
sample_time: none
inputs: {x: {}}
blocks:
  a: {law: y = A*x + B, parameters: {A: {nominal: 1, range: [0, 3]}, B: {nominal: 1, range: [0, 3]}}}
sensors: {y: {reads: y, noise: 0.1}}
"""
    _, diagnoses = report(text, [(1, 5), (2, 7.5)])
    before, after = ([suspect.sd for suspect in item.candidates[0].suspects] for item in diagnoses)
    assert before == [inf, inf]
    assert after == pytest.approx([0.1 * sqrt(2.0), 0.1 * sqrt(5.0)])


def test_as_many_errors_are_allowed_as_readings_less_parameters() -> None:
    """Two readings 0.496 apart, of noise 0.1, misfit by 12.3; 10.8 is allowed, and with a third 13.8."""
    text = SUM.replace("reads: p", "reads: p, noise: 0.1").replace("s: {reads: s}", "s: {reads: s, noise: 0.1}")
    far = [(1, 1, 2.752, nan), (1, 1, 3.248, nan)]
    _, diagnoses = report(text, far)
    assert [len(item.candidates) for item in diagnoses] == [1, 0]
    _, diagnoses = report(text, [*far, (1, 1, 3.0, nan)])
    assert singles(diagnoses[-1]) == pytest.approx({"A": 3.0})


def test_roots_of_pairs_with_noise() -> None:
    """Both roots of a pair are found once there are as many readings as parameters."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = A**2*x + B, parameters: {A: {nominal: 1, range: [-2.1, 2.1]}, B: {nominal: 1, range: [0, 4]}}}}
sensors: {y: {reads: y, noise: 0.01}}
"""
    _, diagnoses = report(text, [(1, 7), (2, 11), (3, 15)])
    found = sorted(pair for pairs in estimates(diagnoses[-1]).values() for pair in pairs)
    assert found == [pytest.approx((-2.0, 3.0)), pytest.approx((2.0, 3.0))]


def test_a_reading_of_0_without_noise() -> None:
    """Among readings of 1e-6, 0 instead of 1e-12 is a contradiction though the other sensor has noise."""
    text = SUM.replace("s: {reads: s}", "s: {reads: s, noise: 0.1}")
    _, diagnoses = report(text, [(1e-6, 1, 3e-6, 3), (1e-12, 1, 0, 3)])
    assert [len(item.candidates) for item in diagnoses] == [1, 0]


def test_a_root_at_the_bound_of_its_range() -> None:
    """Rounding of the bound does not exclude the root of 2."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = A**2*x, parameters: {A: {nominal: 3, range: [1.41421356238, 5]}}}}
sensors: {y: {reads: y}}
"""
    _, diagnoses = report(text, [(1, 2)])
    assert singles(diagnoses[0]) == pytest.approx({"A": sqrt(2.0)})


def test_an_equation_that_does_not_tell_its_unknown() -> None:
    """0 w = 0 says nothing of w, which is then what the sensor reads; 0 w = 1 is a contradiction."""
    text = """
sample_time: none
inputs: {g: {}, v: {}}
blocks: {a: {law: 0 = g*w - v, signals: w}}
sensors: {w: {reads: w}}
"""
    assert report(text, [(0, 0, 5), (2, 10, 5)]) == (None, [])
    detection, _ = report(text, [(0, 1, 5)])
    assert detection is not None


def test_blocks_with_noise() -> None:
    """With noise 0.01, C and E explain what they explain without it, and nothing else does."""
    detection, (diagnosis,) = report(GAUGES, [(2, 3, 2, 4, 11.01, 179.99), (2, 3, 2, 4, 11.01, 170)])
    assert detection is not None
    assert (detection.sample, detection.signals) == (1, ("out2",))
    assert blocks(diagnosis) == [("C",), ("E",)]
    _, (diagnosis,) = report(GAUGES, [(2, 3, 2, 4, 11.035, 170)])
    assert ("C",) not in blocks(diagnosis)  # 3.5 standard deviations of out1 are left, of which 3.3 are allowed


def test_blocks_differ_from_row_to_row() -> None:
    """A suspended block may give anything, anew in every observation; what explains each row alone is kept."""
    text = GAUGES.replace(", noise: 0.01", "")
    _, diagnoses = report(text, [(2, 3, 2, 4, 11, 170), (2, 3, 2, 4, 11, 90)])
    assert blocks(diagnoses[-1]) == [("C",), ("E",)]


def test_blocks_need_real_signals() -> None:
    """A square behind a suspended block can be anything but negative."""
    text = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: c = x + 1}, b: {law: d = c**2 + c}}
sensors: {d: {reads: d}}
"""
    _, diagnoses = report(text, [(1, 30), (1, -4)])
    assert blocks(diagnoses[0]) == [("a",), ("b",)]
    assert blocks(diagnoses[1]) == [("b",)]


def test_trusted_blocks_are_no_suspects() -> None:
    """A block with `suspect: no` is never in a diagnosis."""
    text = GAUGES.replace(", noise: 0.01", "").replace("{law: S3 = S1*S2}", "{law: S3 = S1*S2, suspect: no}")
    _, (diagnosis,) = report(text, [(2, 3, 2, 4, 11, 170)])
    assert blocks(diagnosis) == [("E",)]


LOGIC = """
sample_time: none
inputs: {A: {unit: logic}, B: {unit: logic}}
blocks: {N: {law: n = ~A}, O: {law: o = n | B}, X: {law: x = A ^ B}}
sensors: {o: {reads: o, unit: logic}, x: {reads: x, unit: logic}}
"""


def test_logic() -> None:
    """Rows of logic are detected and explained by the smallest sets of gates that explain all of them."""
    detection, diagnoses = report(LOGIC, [(1, 1, 1, 0), (1, 0, 1, 1), (1, 0, 0, 0)])
    assert detection == Detection(time=1.0, sample=1, change_time=1.0, signals=("o",))
    assert blocks(diagnoses[0]) == [("N",), ("O",)]
    assert blocks(diagnoses[1]) == [("N", "X"), ("O", "X")]
    assert [item.probability for item in diagnoses[1].candidates] == [0.5, 0.5]


def test_logic_with_missing_values() -> None:
    """A missing input may have had any value; a row without readings is passed over."""
    assert report(LOGIC, [(nan, 1, 1, 1), (1, 1, nan, nan)]) == (None, [])
    detection, _ = report(LOGIC, [(nan, 1, 0, 1)])
    assert detection is not None
    assert detection.signals == ("o", "x")


def test_logic_that_is_neither() -> None:
    """A value between 0 and 1 is refused with its row."""
    with pytest.raises(RecordingError, match=r"row 1: o is 0\.5; expected 0 or 1"):
        report(LOGIC, [(1, 1, 1, 0), (1, 1, 0.5, 0)])


def test_models_that_are_no_static_networks() -> None:
    """A model in time, and one without suspects, are refused in one line."""
    with pytest.raises(StructureError, match="needs `blocks` and `sample_time: none`"):
        static_network(parse_model(PRODUCT.replace("none", "1 s").replace("reads: y", "reads: y, noise: 1")))
    trusted = PRODUCT.replace("range: any}}", "range: any}}, suspect: no")
    with pytest.raises(StructureError, match="leave one to be suspected"):
        static_network(parse_model(trusted))


def test_conflicts() -> None:
    """A reading that contradicts names the suspects that it follows from, of parameters and of blocks."""
    network, (seen,) = observed(SUM, [(1, 1, 2, 8)])
    assert conflicts(network, with_healthy(network, seen)) == [frozenset({"A", "B"})]
    network, (seen,) = observed(GAUGES, [(2, 3, 2, 4, 12, 180)])
    assert conflicts(network, with_healthy(network, seen)) == [frozenset({"A", "B", "D"})]


def test_many_suspects() -> None:
    """Of twelve parameters in two sums, the pair that changed is found, conflicts spare those that cannot matter."""
    count = 12
    law = "  b{k}: {{law: a{k} = P{k}*x{k}, parameters: {{P{k}: {{nominal: {nominal}, range: any}}}}}}"
    terms = "\n".join(law.format(k=k, nominal=k + 1) for k in range(count))
    text = f"""
sample_time: none
inputs: {{{", ".join(f"x{k}: {{}}" for k in range(count))}}}
blocks:
{terms}
  left: {{law: l = {" + ".join(f"a{k}" for k in range(count // 2))}}}
  right: {{law: r = {" + ".join(f"a{k}" for k in range(count // 2, count))}}}
sensors: {{l: {{reads: l}}, r: {{reads: r}}}}
"""
    rng = np.random.default_rng(2)
    x = rng.integers(1, 9, (4, count)).astype(np.float64)
    gains = np.arange(1.0, count + 1.0)
    gains[[1, 9]] = 7.0, -2.0
    half = count // 2
    rows = [(*row, row[:half] @ gains[:half], row[half:] @ gains[half:]) for row in x]
    _, diagnoses = report(text, rows)
    assert len(diagnoses[0].candidates) == half * half
    assert estimates(diagnoses[-1]) == {("P1", "P9"): [(7.0, -2.0)]}


def test_an_equation_of_a_signal_alone() -> None:
    """It leaves the wanted unknown free, or has no real solution at all."""
    signal = sp.Symbol("u@2")
    assert static_solve.real_points((signal**2 - 2,), ["A"]) is None
    assert static_solve.real_points((signal**2 + 2,), ["A"]) == []
