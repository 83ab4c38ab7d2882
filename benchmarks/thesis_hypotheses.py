"""Sections 6.1.2 and 6.5 of the thesis: which hypotheses of the motor can be tested, and what cannot be told apart."""

from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from itertools import combinations

from benchmarks.thesis_motor import EXAMPLES, HALF, HYPOTHESES, NOMINAL, record_of, samples, system
from benchmarks.thesis_page import Line, Table, equal, number, set_text, sets_text, words
from faultbond.analysis.ranks import Reduced, reduce, set_ranks
from faultbond.analysis.solutions import OtherSolutions, other_solutions, reachable
from faultbond.analysis.testable import Verdict, generic_run, judge
from faultbond.analysis.twins import twins
from faultbond.dynamics.plant import build_plant
from faultbond.dynamics.step import StepModel, build_step_model
from faultbond.model.text import load_model
from faultbond.sets import largest
from faultbond.structure.numeric import Value
from faultbond.structure.solution import solve_samples

FAULT = Fraction(6, 5)  # what the parameters of a hypothesis are multiplied with
LONGER = (10, 4, 6, -2, 8, 3, -4, 7)  # volts, for windows of four samples each
BEHAVIOURS = 25  # random motors

TABLES_6_5_AND_6_6 = {  # hypothesis: potential conflict set, in the order printed; D is our C, Km our K
    "R": "L D Km J",
    "L": "R D Km J",
    "D": "R L Km J",
    "Km": "R L D J",
    "J": "R L D Km",
    "R L": "D Km J",
    "R D": "L Km J",
    "R Km": "L D J",
    "R J": "L D Km",
    "L D": "R Km J",
    "L Km": "R D J",
    "L J": "R D Km",
    "D Km": "R L J",
    "D J": "R L Km",
    "Km J": "R L D",
}
ORDER = "R L D Km J"
PROTOTYPE = {  # reach of triples with other random motors, where a failed solver counted as none: lower bounds
    "RLJ": 0.48,
    "RLC": 0.52,
    "RLK": 0.96,
    "RJC": 0.60,
    "RJK": 1.0,
    "RCK": 0.28,
    "LJC": 0.44,
    "LJK": 0.64,
    "LCK": 0.92,
}


@cache
def model(name: str) -> StepModel:
    """Give one of the models as a step in time."""
    return build_step_model(build_plant(load_model(EXAMPLES / f"{name}.yaml")))


@cache
def shown(name: str) -> Reduced:
    """Give what a plant shows when everything is excited."""
    return reduce([generic_run(model(name))])


def verdicts(name: str) -> dict[frozenset[str], Verdict]:
    """Give the verdict on every set of parameters, by the thesis' names for them."""
    names = [_printed(item.name) for item in model(name).plant.graph.parameters]
    found = judge(shown(name), range(len(names)), len(names)).verdicts
    return {frozenset(names[k] for k in item.parameters): item for item in found}


def _printed(name: str) -> str:
    """Give the name that section 6.5 has for a parameter."""
    return {"C": "D", "K": "Km"}.get(name, name)


def tables_6_5_and_6_6() -> Table:
    """Give the testable hypotheses with their potential conflict sets."""
    found = verdicts("motor")
    everything = frozenset(ORDER.split())
    testable = [item for item, verdict in found.items() if verdict.testable]
    lines = []
    for k, (names, others) in enumerate(TABLES_6_5_AND_6_6.items(), start=1):
        hypothesis = tuple(names.split())
        rest = everything - {*hypothesis}
        ours = set_text(rest, ORDER) if frozenset(hypothesis) in testable else "not testable"
        lines.append(equal(f"{k}. {set_text(hypothesis)}", set_text(others.split(), ORDER), ours))
    return Table(
        title="Tables 6.5 and 6.6: all the hypotheses that are testable",
        source="6.5, page 149",
        words="`faultbond analyse examples/thesis/motor.yaml`. In the first column the hypotheses of table 6.5, in the "
        "next two the set assumed healthy, table 6.6. D is the friction, C elsewhere, Km the constant K.",
        lines=(
            *lines,
            number("number of testable hypotheses", "15", len(testable)),
            words(
                "sets 6 to 15 in table 6.6 are equivalent to",
                "sets 6 to 15 in table 6.6",
                "sets 6 to 15 in table 6.5",
                "erratum: as the lines above show",
            ),
        ),
    )


def section_6_5() -> Table:
    """Give how many hypotheses can be tested, and how many have to be."""
    speed, current = (list(verdicts(name).items()) for name in ("motor", "motor_current"))
    small, large = ([item for item, verdict in found if verdict.testable] for found in (speed, current))
    triples = [verdict for item, verdict in speed if len(item) == 3]
    more = [verdict for item, verdict in speed if len(item) > 3]
    anything = sum(item.identifiable and not item.falsifiable for item in triples)
    unsolved = sum(not item.identifiable for item in more)
    whole = dict(current)[frozenset(ORDER.split())]
    return Table(
        title="Section 6.5: how many hypotheses",
        source="6.1.2 and 6.5, pages 124, 148 to 150",
        words="`faultbond analyse` on `motor.yaml` and `motor_current.yaml` of `examples/thesis`. A set explains "
        "anything if the data fix its values but cannot contradict it.",
        lines=(
            number("lumped parameters of equation 6.3", "3", shown("motor").rank.value, "rank of the sensitivities"),
            words("rank of sets of one to five components", "", ", ".join(_ranks("motor"))),
            equal("sets of three components always explain", "all", _part(anything, len(triples)), f"{len(triples)}"),
            equal("sets of four and five cannot be solved", "all", _part(unsolved, len(more)), f"{len(more)}"),
            number("sets that have to be tested, V and omega", "10", len(largest(small))),
            number("lumped parameters with the current", "5", shown("motor_current").rank.value),
            number("testable with the current", "30", len(large), f"of {len(current)}"),
            equal(
                "all five faulty, with the current",
                "can be told",
                "can be told" if whole.testable else "explain anything",
                "erratum: their values can be found, but nothing could contradict them; hence 30 and not 31",
            ),
            number("sets that have to be tested with the current", "5", len(largest(large))),
        ),
    )


def _ranks(name: str) -> list[str]:
    found = []
    for size in range(1, 6):
        ranks, _ = set_ranks(shown(name), list(combinations(range(5), size)))
        found.append("/".join(str(rank) for rank in sorted(set(ranks.tolist()))))
    return found


def _part(count: int, total: int) -> str:
    return "all" if count == total else f"{count} of {total}"


def section_6_1_2() -> Table:
    """Give all solutions of each hypothesis on the smallest number of samples."""
    printed = {"R": "one", "L": "one", "J": "one", "C": "one", "K": "one", "RL": "one", "JK": "two"}
    remarks = {"K": "erratum: a single fault can have two as well"}
    lines = [_roots(names, printed.get("".join(names), ""), remarks.get("".join(names), "")) for names in HYPOTHESES]
    return Table(
        title="Section 6.1.2: solutions on the smallest number of samples",
        source="6.1.2, page 124",
        words="`faultbond analyse examples/thesis/motor.yaml --closed 2`. The exact record of appendix A, the "
        "parameters of the hypothesis 6/5 of nominal: three samples for one parameter, four for two.",
        lines=(*lines, *_windows()),
    )


def _roots(names: tuple[str, ...], printed: str, remark: str) -> Line:
    faulty = {**NOMINAL, **{name: NOMINAL[name] * FAULT for name in names}}
    found = _solutions(names, faulty)
    count = {1: "one", 2: "two"}.get(len(found), str(len(found)))
    values = " and ".join(f"({', '.join(f'{float(root[name]):.5g}' for name in names)})" for root in found)
    same = count == printed if printed else None
    return Line(what=set_text(names), printed=printed, ours=f"{count}: {values}", same=same, remark=remark)


def _solutions(
    names: tuple[str, ...], faulty: Mapping[str, Fraction], volts: tuple[int, ...] = LONGER[:5], back: int = 0
) -> list[dict[str, Value]]:
    """Give what a record says of a set of parameters, the true values first."""
    _, solution = system("motor").parameters(names)
    known: dict[str, Value] = {**NOMINAL, "dt": HALF, **samples(record_of(faulty, volts), back)}
    found = solve_samples(solution, known)
    return sorted(found, key=lambda root: sum(abs(float(root[name] - faulty[name])) for name in names))


def _windows() -> list[Line]:
    """Give the second solution of {J, K} from each four samples of a longer record."""
    names = ("J", "K")
    faulty = {**NOMINAL, **{name: NOMINAL[name] * FAULT for name in names}}
    found = [_solutions(names, faulty, LONGER, back) for back in range(3, -1, -1)]
    lines = []
    for k, (first, *rest) in enumerate(found):
        true = all(first[name] == faulty[name] for name in names)
        others = " and ".join(f"({', '.join(f'{float(root[name]):.5g}' for name in names)})" for root in rest)
        ours = f"{'the true one' if true else 'not the true one'} and {others}"
        remark = "erratum: the second one fits its own four samples only" if k == 3 else ""
        what = f"{{J, K}}, samples {k + 2} to {k + 5} of a longer record"
        lines.append(words(what, "both describe the behaviour" if k == 3 else "", ours, remark))
    return lines


def long_record() -> Table:
    """Give what a long record leaves."""
    found = other_solutions(model("motor"), HYPOTHESES)
    alone = [item.parameters for item in found if item.unique]
    lines = [words(set_text(item.parameters), "", _both(item), _swap(item)) for item in found if not item.unique]
    both = {item.parameters: item for item in found}
    return Table(
        title="Section 6.1.2: solutions on a long record",
        source="6.1.2, page 124",
        words="`faultbond analyse examples/thesis/motor.yaml`, under what cannot be told apart. The parameters of each "
        "hypothesis are 1.3 of nominal; all positive values are searched that give the same outputs.",
        lines=(
            equal(
                "{J, K}",
                "two solutions",
                "one solution" if both["J", "K"].unique else "two solutions",
                "erratum: the second one of the smallest window does not last",
            ),
            words("one solution only", "", sets_text(alone)),
            *lines,
        ),
    )


def _both(item: OtherSolutions) -> str:
    texts = (", ".join(f"{value:.4f}" for value in values) for values in (item.true, *item.others))
    return " and ".join(f"({text})" for text in texts)


def _swap(item: OtherSolutions) -> str:
    laws = {("R", "C"): "(R, C) and (L C/J, J R/L)", ("L", "J"): "(L, J) and (J R/C, L C/R)"}
    return f"the time constants change places: {laws[item.parameters]}" if item.parameters in laws else ""


def twin_faults() -> Table:
    """Give different sets with the same outputs."""
    pairs = [(one, other) for one, other in combinations(HYPOTHESES, 2) if len(one) == len(other)]
    found = [item for item in twins(model("motor"), pairs) if item.first_powers is not None]
    return Table(
        title="Section 6.5: different faults with the same outputs",
        source="6.5, page 148, says it of three and more components",
        words="`faultbond analyse examples/thesis/motor.yaml`. For any s > 0 all three lumped parameters of equation "
        "6.3 are the same for both; shown are the families in which every parameter is nominal times a power of s.",
        lines=tuple(words(f"{set_text(item.first)} and {set_text(item.second)}", "", item.words, "") for item in found),
    )


def reach() -> Table:
    """Give how many random motors each triple explains with positive values."""
    triples = list(combinations("RLJCK", 3))
    found = reachable(model("motor"), triples, behaviours=BEHAVIOURS)
    lines = []
    for item in found:
        name = "".join(item.parameters)
        other = PROTOTYPE.get(name)
        remark = "not run before" if other is None else f"{other:.2f} in an independent run, a lower bound"
        ours = f"{item.reached} of {item.tried}"
        lines.append(equal(set_text(item.parameters), "always explains", ours, remark, same=item.reached == item.tried))
    return Table(
        title="Section 6.5: what three components can explain",
        source="6.1.2 and 6.5, pages 124 and 148",
        words="The thesis: with three components a positive answer is always obtained. Near nominal this holds, for "
        f"large faults it is an erratum: of {BEHAVIOURS} random motors, all five parameters between half and twice "
        "nominal, a triple explains only those whose behaviour it reaches with positive values. The counts are lower "
        "bounds: a fit that does not converge counts as none.",
        lines=tuple(lines),
    )
