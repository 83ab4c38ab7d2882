"""Chapter 3 and sections 6.1.1 and 6.4 of the thesis: its static systems, propagated, suspended and solved.

What the thesis prints stands here as data; what we print comes from the files of examples/thesis.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import sympy as sp

from benchmarks.thesis_page import Line, Table, equal, number, numbers, set_text, sets, words
from faultbond.analysis.static_hypothesis import is_consistent
from faultbond.analysis.static_network import READING, Observation, StaticNetwork, observation, static_network
from faultbond.analysis.static_propagation import suspend
from faultbond.analysis.static_tables import Solved, relations, solve, table_of_pairs, table_of_singles
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.parser import parse_expression
from faultbond.model.text import load_model
from faultbond.sets import (
    common_subsets,
    conflict_sets,
    hypotheses,
    hypotheses_left,
    minimal_diagnoses,
    minimal_hitting_sets,
)
from faultbond.structure.logic import explains, logic_network, predict
from faultbond.structure.symbols import to_sympy

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "thesis"


def observed(figure: str, rows: Iterable[Sequence[float]] = ()) -> tuple[StaticNetwork, list[Observation]]:
    """Give the network of a figure with its observations, or with others: inputs, then outputs."""
    network = static_network(load_model(EXAMPLES / f"{figure}.yaml"))
    count = len(network.graph.inputs)
    points: Iterable[GridPoint] = [
        GridPoint(index=k, time=float(k), dt=0.0, u=np.array(row[:count]), y=np.array(row[count:]))
        for k, row in enumerate(rows)
    ]
    if not points:
        points = on_grid(read_rows(EXAMPLES / f"{figure}.csv", columns_of(network.graph)), Grid(None))
    return network, [observation(network, point) for point in points]


def falling(solved: Solved) -> list[tuple[sp.Expr, ...]]:
    """Give solutions, the largest first, as the thesis lists them."""
    return sorted((tuple(point.values()) for point in solved.points), key=lambda item: -float(item[0]))


def predicted(network: StaticNetwork, seen: Observation, suspended: Sequence[str] = ()) -> Mapping[str, object]:
    """Give what follows from the inputs of an observation alone, with some blocks suspended."""
    inputs = {name: value for name, value in seen.values.items() if not name.startswith(READING)}
    return suspend(network, replace(seen, values=inputs, sensors=()), suspended, {}).known


def figures_3_4_and_3_5() -> Table:
    """Give both diagnoses of two multipliers in a row."""
    network, (seen,) = observed("fig_3_4")
    (single,) = table_of_singles(network, [seen])
    known = predicted(network, seen)
    (tied,) = relations(network, ("i", "ii"), seen)
    return Table(
        title="Figures 3.4 and 3.5: two multipliers in a row",
        source="3.4.1 and 3.5.2, pages 25 and 29",
        words="`examples/thesis/fig_3_4.yaml`: A = 4 goes in, D = 32 is measured.",
        lines=(
            number("B from A", "8", as_exact(known["B"])),
            number("D from A, healthy", "24", as_exact(known["D"])),
            number("component *ii* suspended", "4", falling(single["ii"])[0][0]),
            number("component *i* suspended", "2 2/3", falling(single["i"])[0][0]),
            words("both suspended", "i = 1, ii = 8 for example", tied.text, "one observation ties the two"),
        ),
    )


def as_exact(value: object) -> sp.Expr:
    """Give a propagated number as a fraction."""
    return sp.Rational(Fraction(value)) if isinstance(value, Fraction | float) else sp.nan


def full_adder() -> Table:
    """Give the diagnoses of figures 3.7 to 3.11."""
    graph = load_model(EXAMPLES / "fig_3_7.yaml")
    network = logic_network(graph)
    (row,) = read_rows(EXAMPLES / "fig_3_7.csv", columns_of(graph))
    names = [*(item.name for item in graph.inputs), *(item.name for item in graph.sensors)]
    seen = dict(zip(names, (bool(value) for value in (*row.u, *row.y)), strict=True))
    healthy = predict(network, {name: seen[name] for name in network.inputs})
    found = minimal_diagnoses(network.suspects, lambda suspended: explains(network, suspended, [seen]))

    def verdict(*suspended: str) -> str:
        return "consistent" if explains(network, frozenset(suspended), [seen]) else "inconsistent"

    return Table(
        title="Figures 3.7 to 3.11: a full adder",
        source="3.6, pages 31 to 36",
        words="`examples/thesis/fig_3_7.yaml`. Its inputs are in the figure only; those of Reiter's paper, "
        f"{', '.join(f'{name} = {int(seen[name])}' for name in names)}, agree with all that the text says.",
        lines=(
            number("X1 gives, from A and B", "1", int(healthy["x"])),
            number("X2 needs, from C and D", "0", int(seen["C"] ^ seen["D"])),
            equal("{O1} suspended, figure 3.8", "inconsistent", verdict("O1")),
            equal("{X2, A2, A1} suspended, figure 3.9", "consistent", verdict("X2", "A2", "A1")),
            equal("{X2, A2} suspended, figure 3.10", "consistent", verdict("X2", "A2")),
            equal("{X1} suspended, figure 3.11", "consistent", verdict("X1")),
            number("number of minimal diagnoses", "3", len(found.sets)),
            sets(
                "minimal diagnoses",
                (("X1",), ("X2", "A2"), ("X2", "O2")),
                found.sets,
                "erratum: there is no O2, O1 is meant",
                "X1 X2 A1 A2 O1",
            ),
            sets("minimal conflicts", (), minimal_hitting_sets(found.sets), "", "X1 X2 A1 A2 O1"),
        ),
    )


def table_3_3() -> Table:
    """Give the parameter of each multiplier from each of two observations."""
    network, rows = observed("fig_3_12")
    table = table_of_singles(network, rows)
    printed = {"M1": ("4", "2 1/2"), "M2": ("4", "4")}
    lines = [
        number(f"{name} from observation {k + 1}", printed[name][k], falling(table[k][name])[0][0])
        for k in range(2)
        for name in ("M1", "M2")
    ]
    left = [(name,) for name in network.suspects if solve(network, (name,), rows).explains]
    return Table(
        title="Table 3.3: comparing the two observations",
        source="3.7.1, figures 3.12 and 3.13, page 40",
        words="`examples/thesis/fig_3_12.yaml`: y = M1 x1 + M2 x2, nominal M1 = 2, M2 = 3.",
        lines=(*lines, sets("explains both observations", [("M2",)], left)),
    )


def table_of_figure_3_14(which: int) -> Table:
    """Give table 3.4 or 3.5: all single diagnoses from one observation."""
    printed = (
        {"M1": ("2 2/3", "-5 1/3"), "M2": ("4 1/2", "-7 1/2"), "M3": ("27 3/4",)},
        {"M1": ("2.6368", "-6.6368"), "M2": ("3.6368", "-5.6368"), "M3": ("29",)},
    )[which]
    network, rows = observed("fig_3_14")
    table = table_of_singles(network, rows)[which]
    values = rows[which].values
    inputs = ", ".join(f"{name} = {values[name]}" for name in ("x1", "x2", "x3"))
    expected = as_exact(predicted(network, rows[which])["y"])
    lines = [numbers(name, printed[name], [item[0] for item in falling(table[name])]) for name in network.suspects]
    first = "fig_3_14.yaml`: y = (M1 x1 + M2 x2)^2 + M3 x3, nominal M1 = 1, M2 = 2, M3 = 4, which follow from the text"
    scale = "fig_3_14.yaml`. The text leaves the scale of the inputs of figure 3.16 open; 2 is the simplest"
    return Table(
        title=f"Table 3.{4 + which}: all the diagnoses from the {('first', 'second')[which]} observation",
        source=f"3.7.2, figure 3.{(14, 16)[which]}, page 42",
        words=f"`examples/thesis/{(first, scale)[which]}. Observed: {inputs}, y = {values[READING + 'y']}.",
        lines=(number("expected output", ("65", "")[which], expected), *lines),
    )


def figure_3_17() -> Table:
    """Give the pairs that explain two observations, and which of them a third leaves."""
    network, rows = observed("fig_3_14")
    (pairs,) = table_of_pairs(network, rows)
    third = [*rows, observed("fig_3_14", [(1, 3, 1, 79)])[1][0]]
    remark = "erratum: not the only one, so that (2, 15) is not yet known to be the fault"
    lines = [_pair(pair, pairs[pair], remark if pair == ("M1", "M3") else "fits too") for pair in pairs]
    left = [(pair, falling(solve(network, pair, third))) for pair in pairs]
    return Table(
        title="Figure 3.17: the diagnosis of two components",
        source="3.7.2, page 43",
        words="The same file, both observations together.",
        lines=(
            *lines,
            words(
                "with a third observation x = (1, 3, 1), y = 79",
                "",
                "; ".join(f"({', '.join(pair)}) = {_point(item)}" for pair, found in left for item in found),
                "made with M1 = 2, M3 = 15: three observations tell",
            ),
        ),
    )


def _pair(pair: tuple[str, ...], solved: Solved, remark: str) -> Line:
    found = falling(solved)
    printed = "(2, 15)" if pair == ("M1", "M3") else ""
    same = len(found) == 1 if printed else None
    ours = ", ".join(_point(item) for item in found)
    return Line(what=f"({', '.join(pair)})", printed=printed, ours=ours, same=same, remark=remark)


def _point(values: Sequence[sp.Expr]) -> str:
    texts = [str(value) if value.is_Integer else f"{float(value):.4f}" for value in values]
    return f"({', '.join(texts)})"


NOISY = ((1.013, 1.987), (2.016, 1.006))  # table 3.6: the inputs of M1 and M2
OUTPUTS = {"as printed, 10.082 and 8.003": (10.082, 8.003), "10 and 8": (10.0, 8.0)}


def table_3_6() -> Table:
    """Give the parameters from two noisy observations, with the outputs that are printed and with those meant."""
    printed = {"M1": ("3.987", "2.471"), "M2": ("4.013", "3.944")}
    remark = "erratum: the printed column belongs to the outputs 10 and 8"
    lines = []
    for title, outputs in OUTPUTS.items():
        rows = [(*inputs, output) for inputs, output in zip(NOISY, outputs, strict=True)]
        table = table_of_singles(*observed("fig_3_12", rows))
        for k, name in ((0, "M1"), (0, "M2"), (1, "M1"), (1, "M2")):
            value = float(falling(table[k][name])[0][0])
            lines.append(
                number(f"{name} from observation {k + 1}, outputs {title}", printed[name][k], value)
                if title == "10 and 8"
                else number(f"{name} from observation {k + 1}, outputs {title}", printed[name][k], value, remark)
            )
    return Table(
        title="Table 3.6: results with noisy measurements",
        source="3.8, page 45",
        words="The system of table 3.3, inputs as printed.",
        lines=tuple(lines),
    )


def section_3_10() -> Table:
    """Give the number of hypotheses."""
    return Table(
        title="Section 3.10: the number of hypotheses",
        source="3.10, page 50, and 6.3, page 140",
        words="All sets of components but the empty one.",
        lines=(
            number("four components", "15", len(hypotheses("ABCD"))),
            number("five components", "31", len(hypotheses("ABCDE"))),
            number(
                "four components, by the 2^N of section 6.3",
                "16",
                len(hypotheses("ABCD")),
                "erratum: 2^N - 1, the empty set is no hypothesis",
            ),
        ),
    )


SUBSETS = {  # table 6.1: the subset taken as healthy, and the parameters of the others from observation 1 and 2
    ("A", "B"): ("1.0", "0.66"),
    ("A", "C"): ("3.0", "3.0"),
    ("B", "C"): ("-0.4", "0.0"),
    ("A",): ("5.667 - 0.667*C", "5.4 - 0.6*C"),
    ("B",): ("2.8 - 0.8*C", "2.4 - 0.6*C"),
    ("C",): ("18/B - 4", "15/B - 3"),
}


def table_6_1() -> Table:
    """Give the parameters outside each subset from each observation alone."""
    network, rows = observed("fig_6_1")
    lines = []
    for subset, printed in SUBSETS.items():
        for k, text in enumerate(printed):
            suspects = tuple(name for name in network.suspects if name not in subset)
            what = f"{set_text(subset)} healthy, observation {k + 1}: {suspects[0]}"
            remark = "erratum: 0.667, as in the text" if text == "0.66" else ""
            if len(suspects) == 1:
                lines.append(number(what, text, falling(solve(network, suspects, [rows[k]]))[0][0], remark))
            else:
                (found,) = relations(network, suspects, rows[k])
                ours = found.text.partition(" = ")[2]
                lines.append(equal(what, text, ours, same=_is_printed_law(text, ours, suspects[1])))
    return Table(
        title="Table 6.1: two observations of a system which has parameters",
        source="6.1.1, figure 6.1, page 122",
        words="`examples/thesis/fig_6_1.yaml`: Vo = B (Vi + A) + C Vi. Nominal A = 2, B = 5, C = 4 is the only choice "
        "that gives this table. Observed: (Vi, Vo) = (4, 34) and (3, 27).",
        lines=tuple(lines),
    )


def _is_printed_law(printed: str, ours: str, name: str) -> bool:
    """Whether two laws of one parameter agree to three decimals of what is printed, at several values."""
    one, other = (to_sympy(parse_expression(text)) for text in (printed, ours))
    symbols = {str(symbol): symbol for symbol in one.free_symbols | other.free_symbols}
    gaps = [(one - other).subs(symbols[name], value) for value in (1, 2, 3)]
    return all(abs(float(gap)) <= 0.0005 * (1 + value) for value, gap in zip((1, 2, 3), gaps, strict=True))


def table_6_2() -> Table:
    """Give the pairs of parameters from two observations each."""
    printed = {("B", "C"): ("3", "4"), ("A", "C"): ("1.2", "2"), ("A", "B"): ("2", "3")}
    network, rows = observed("fig_6_1")
    found = table_of_pairs(network, rows)
    lines = [
        numbers(
            f"{set_text(set(network.suspects) - {*pair})} healthy, observations {k + 1} and {k + 2}: {', '.join(pair)}",
            printed[pair],
            falling(table[pair])[0],
        )
        for pair in printed
        for k, table in enumerate(found)
    ]
    nominal = {name: sp.Rational(Fraction(network.values[name])) for name in network.suspects}
    ours = [{**nominal, **table[pair].points[0]} for pair in printed for table in found]
    sums = sorted({item["B"] + item["C"] for item in ours}, key=float)
    products = sorted({item["A"] * item["B"] for item in ours}, key=float)
    return Table(
        title="Table 6.2: using three observations to solve the parameter values",
        source="6.1.1, page 123",
        words="The same file, with the third observation (1, 13).",
        lines=(*lines, numbers("B + C, equation 6.2", ["7"], sums), numbers("A B, equation 6.2", ["6"], products)),
    )


def conflicts_of_6_1() -> Table:
    """Give conflict sets and diagnoses, with constancy over observations and without."""
    network, rows = observed("fig_6_1")
    tested = (frozenset[str](), *hypotheses("ABC", 2))
    apart = {item: all(solve(network, _ordered(item), [row]).explains for row in rows) for item in tested}
    constant = {item: solve(network, _ordered(item), rows).explains for item in tested}
    every = conflict_sets("ABC", apart)
    conflicts = conflict_sets("ABC", constant)
    diagnoses = minimal_hitting_sets(conflicts)
    points = {item: falling(solve(network, _ordered(item), rows))[0] for item in diagnoses}
    remark = "erratum: {A, C} meets all three as well; table 6.2 even gives its values"
    return Table(
        title="Section 6.1: conflict sets and hitting sets",
        source="6.1 and 6.1.2, pages 119 and 126",
        words="The same file. A set is a conflict if no values of the other parameters explain the observations: "
        "values of each observation's own in the first two lines, constant values in the others.",
        lines=(
            sets("conflict sets, each observation by itself", [("A", "B", "C")], every),
            sets("minimal hitting sets of these", [("A",), ("B",), ("C",)], minimal_hitting_sets(every)),
            sets("conflict sets, values constant", [("A", "B", "C"), ("A", "B"), ("B", "C")], conflicts),
            sets("minimal hitting sets of these", [("B",)], diagnoses, remark),
            numbers("value of B in {B}", ["3.0"], points[frozenset("B")]),
            numbers("values of A and C in {A, C}", ["1.2", "2"], points[frozenset("AC")], "printed in table 6.2"),
        ),
    )


def _ordered(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(names))


SIGNALS = ("S1", "S2", "S3", "out1", "out2")
HYPOTHESES = {  # 6.4.1: what follows with these suspended, and whether that explains the observation
    ("D",): (("6", "5", "30", "?", "180"), False),
    ("C", "D"): (("6", "5", "?", "?", "?"), True),
    ("C",): (("6", "5", "30", "11", "?"), True),
}


def figure_6_13() -> Table:
    """Give the tables of 6.4.1, and all diagnoses of the system."""
    network, (seen,) = observed("fig_6_13")
    lines = []
    for suspended, (printed, explained) in HYPOTHESES.items():
        known = predicted(network, seen, suspended)
        ours = tuple(str(known.get(name, "?")) for name in SIGNALS)
        remark = "erratum: S3 is the output of C, which is suspended" if suspended == ("C",) else ""
        what = f"{set_text(suspended)} suspended: {', '.join(SIGNALS)}"
        lines.append(equal(what, ", ".join(printed), ", ".join(ours), remark))
        verdict = {True: "explains", False: "does not explain"}
        ours_verdict = verdict[is_consistent(network, suspended, seen)]
        lines.append(equal(f"{set_text(suspended)} as a hypothesis", verdict[explained], ours_verdict))
    found = minimal_diagnoses(network.suspects, lambda suspended: is_consistent(network, suspended, seen))
    follow = " and ".join(set_text(item) for item in found.sets if len(item) == 1)
    return Table(
        title="Figure 6.13: adders and multipliers",
        source="6.4.1, pages 142 and 143",
        words="`examples/thesis/fig_6_13.yaml`. How the parts are joined follows from the values printed; the measured "
        "outputs are not printed, out1 = 11 and out2 = 170 are ours.",
        lines=(
            *lines,
            sets("all minimal diagnoses", (), found.sets, f"{follow} for any wrong out2; pairs depend on the joints"),
        ),
    )


VERDICTS = {  # table 6.4: the hypothesis, whether it explains, the set taken as healthy, whether that is a conflict
    "ABC": (True, "D", "no"),
    "ABD": (False, "C", "yes"),
    "ACD": (False, "B", "yes"),
    "BCD": (True, "A", "no"),
}


def table_6_4() -> Table:
    """Give what follows from the verdicts on the four largest hypotheses of four components."""
    verdicts = {frozenset(names): explained for names, (explained, _, _) in VERDICTS.items()}
    conflicts = conflict_sets("ABCD", verdicts)
    tested = [names for names, explained in verdicts.items() if explained]
    lines = [
        equal(
            f"{set_text(names)} {'explains' if explained else 'does not explain'}: is {set_text(rest)} a conflict set?",
            printed,
            "yes" if frozenset(rest) in conflicts else "no",
        )
        for names, (explained, rest, printed) in VERDICTS.items()
    ]
    return Table(
        title="Table 6.4: example of a multiple fault diagnosis",
        source="6.4.2, page 144",
        words="Four components A to D; the verdicts on four hypotheses are given.",
        lines=(
            *lines,
            sets("common subset of the hypotheses that explain", [("B", "C")], common_subsets(tested)),
            sets("minimal hitting sets of the conflict sets", [("B", "C")], minimal_hitting_sets(conflicts)),
            sets("put forward", [("B", "C"), ("A", "B", "C"), ("B", "C", "D")], hypotheses_left(verdicts)),
        ),
    )


def chapter_3() -> tuple[Table, ...]:
    """Give the tables of chapter 3, but for those of its stores."""
    return (
        figures_3_4_and_3_5(),
        full_adder(),
        table_3_3(),
        table_of_figure_3_14(0),
        table_of_figure_3_14(1),
        figure_3_17(),
        table_3_6(),
        section_3_10(),
    )


def chapter_6() -> tuple[Table, ...]:
    """Give the tables of sections 6.1 and 6.4."""
    return table_6_1(), table_6_2(), conflicts_of_6_1(), figure_6_13(), table_6_4()
