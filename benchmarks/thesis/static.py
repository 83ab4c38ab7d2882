"""Chapter 3 of the thesis: its static systems, propagated, suspended and solved.

What the thesis prints stands here as data; what we print comes from the files of examples/thesis.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
import sympy as sp

from benchmarks.thesis.motor import THESIS
from benchmarks.thesis.page import Line, Parts, Table, equal, number, numbers, sets, table, words
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.text import load_model
from faultbond.networks.logic.diagnoses import explains, logic_network, predict
from faultbond.networks.propagation import suspend
from faultbond.networks.static_network import READING, Observation, StaticNetwork, observation, static_network
from faultbond.sets import hypotheses, minimal_diagnoses, minimal_hitting_sets
from faultbond.thesis.tables import Solved, solve_suspects, table_of_pairs, table_of_singles, table_relations


def observed(figure: str, rows: Iterable[Sequence[float]] = ()) -> tuple[StaticNetwork, list[Observation]]:
    """Give the network of a figure with its observations, or with others: inputs, then outputs."""
    network = static_network(load_model(THESIS / f"{figure}.yaml"))
    count = len(network.graph.inputs)
    points: Iterable[GridPoint] = [
        GridPoint(index=k, time=float(k), dt=0.0, u=np.array(row[:count]), y=np.array(row[count:]))
        for k, row in enumerate(rows)
    ]
    if not points:
        points = on_grid(read_rows(THESIS / f"{figure}.csv", columns_of(network.graph)), Grid(None))
    return network, [observation(network, point) for point in points]


def falling(solved: Solved) -> list[tuple[sp.Expr, ...]]:
    """Give solutions, the largest first, as the thesis lists them."""
    return sorted((tuple(point.values()) for point in solved.points), key=lambda item: -float(item[0]))


def predicted(network: StaticNetwork, seen: Observation, suspended: Sequence[str] = ()) -> Mapping[str, object]:
    """Give what follows from the inputs of an observation alone, with some blocks suspended."""
    inputs = {name: value for name, value in seen.values.items() if not name.startswith(READING)}
    return suspend(network, replace(seen, values=inputs, sensors=()), suspended, {}).known


@table("3.4.1 and 3.5.2, pages 25 and 29")
def figures_3_4_and_3_5() -> Parts:
    """Figures 3.4 and 3.5: two multipliers in a row."""
    network, (seen,) = observed("fig_3_4")
    (single,) = table_of_singles(network, [seen])
    known = predicted(network, seen)
    (tied,) = table_relations(network, ("i", "ii"), seen)
    yield "`examples/thesis/fig_3_4.yaml`: A = 4 goes in, D = 32 is measured."
    yield number("B from A", "8", as_exact(known["B"]))
    yield number("D from A, healthy", "24", as_exact(known["D"]))
    yield number("component *ii* suspended", "4", falling(single["ii"])[0][0])
    yield number("component *i* suspended", "2 2/3", falling(single["i"])[0][0])
    yield words("both suspended", "i = 1, ii = 8 for example", tied.text, "one observation ties the two")


def as_exact(value: object) -> sp.Expr:
    """Give a propagated number as a fraction."""
    return sp.Rational(Fraction(value)) if isinstance(value, Fraction | float) else sp.nan


def full_adder() -> Table:
    """Give the diagnoses of figures 3.7 to 3.11."""
    graph = load_model(THESIS / "fig_3_7.yaml")
    network = logic_network(graph)
    (row,) = read_rows(THESIS / "fig_3_7.csv", columns_of(graph))
    names = [*(item.name for item in graph.inputs), *(item.name for item in graph.sensors)]
    seen = dict(zip(names, (bool(value) for value in (*row.u, *row.y)), strict=True))
    healthy = predict(network, {name: seen[name] for name in network.inputs})
    found = minimal_diagnoses(network.suspects, lambda suspended: explains(network, suspended, [seen]))
    others = frozenset(network.suspects) - {"X2"}
    needed = [x for x in (0, 1) if explains(network, others, [{"x": bool(x), "C": seen["C"], "D": seen["D"]}])]

    def verdict(*suspended: str) -> str:
        return "consistent" if explains(network, frozenset(suspended), [seen]) else "inconsistent"

    return Table(
        "Figures 3.7 to 3.11: a full adder",
        "3.6, pages 31 to 36",
        "`examples/thesis/fig_3_7.yaml`. Its inputs are in the figure only; those of Reiter's paper, "
        f"{', '.join(f'{name} = {int(seen[name])}' for name in names)}, agree with all that the text says.",
        lines=(
            number("X1 gives, from A and B", "1", int(healthy["x"])),
            numbers("input that X2 needs, from C and D", ["0"], needed),
            equal("{O1} suspended, figure 3.8", "inconsistent", verdict("O1")),
            equal("{X2, A2, A1} suspended, figure 3.9", "consistent", verdict("X2", "A2", "A1")),
            equal("{X2, A2} suspended, figure 3.10", "consistent", verdict("X2", "A2")),
            equal("{X1} suspended, figure 3.11", "consistent", verdict("X1")),
            number("number of minimal diagnoses", "3", len(found.sets)),
            sets(
                "minimal diagnoses",
                (("X1",), ("X2", "A2"), ("X2", "O2")),
                found.sets,
                "erratum: O1 is meant, there is no O2",
                "X1 X2 A1 A2 O1",
            ),
            sets("minimal conflicts", (), minimal_hitting_sets(found.sets), "", "X1 X2 A1 A2 O1"),
        ),
    )


@table("3.7.1, figures 3.12 and 3.13, page 40")
def table_3_3() -> Parts:
    """Table 3.3: comparing the two observations."""
    network, rows = observed("fig_3_12")
    table = table_of_singles(network, rows)
    printed = {"M1": ("4", "2 1/2"), "M2": ("4", "4")}
    lines = [
        number(f"{name} from observation {k + 1}", printed[name][k], falling(table[k][name])[0][0])
        for k in range(2)
        for name in ("M1", "M2")
    ]
    left = [(name,) for name in network.suspects if solve_suspects(network, (name,), rows).explains]
    yield "`examples/thesis/fig_3_12.yaml`: y = M1 x1 + M2 x2, nominal M1 = 2, M2 = 3."
    yield from lines
    yield sets("explains both observations", [("M2",)], left)


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
        f"Table 3.{4 + which}: all the diagnoses from the {('first', 'second')[which]} observation",
        f"3.7.2, figure 3.{(14, 16)[which]}, page 42",
        f"`examples/thesis/{(first, scale)[which]}. Observed: {inputs}, y = {values[READING + 'y']}.",
        lines=(number("expected output", ("65", "")[which], expected), *lines),
    )


@table("3.7.2, page 43")
def figure_3_17() -> Parts:
    """Figure 3.17: the diagnosis of two components."""
    network, rows = observed("fig_3_14")
    (pairs,) = table_of_pairs(network, rows)
    third = [*rows, observed("fig_3_14", [(1, 3, 1, 79)])[1][0]]
    count = sum(len(solved.points) for solved in pairs.values())
    remark = f"erratum: (2, 15) is one of {count} solutions of {len(pairs)} pairs"
    lines = [_pair(pair, pairs[pair], remark if pair == ("M1", "M3") else "fits too") for pair in pairs]
    left = [(pair, falling(solve_suspects(network, pair, third))) for pair in pairs]
    yield "The same file, both observations together."
    yield from lines
    yield words(
        "with a third observation x = (1, 3, 1), y = 79",
        "",
        "; ".join(f"({', '.join(pair)}) = {_point(item)}" for pair, found in left for item in found),
        "made with M1 = 2, M3 = 15: three observations tell",
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


@table("3.8, page 45")
def table_3_6() -> Parts:
    """Table 3.6: results with noisy measurements."""
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
    yield "The system of table 3.3, inputs as printed."
    yield from lines


@table("3.10, page 50, and 6.3, page 140")
def section_3_10() -> Parts:
    """Section 3.10: the number of hypotheses."""
    yield "All sets of components but the empty one."
    yield number("four components", "15", len(hypotheses("ABCD")))
    yield number("five components", "31", len(hypotheses("ABCDE")))
    yield number(
        "four components, by the 2^N of section 6.3",
        "16",
        len(hypotheses("ABCD")),
        "erratum: 2^N - 1, the empty set is no hypothesis",
    )
