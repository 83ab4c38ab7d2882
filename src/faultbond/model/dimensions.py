"""Check of dimensions when a model is loaded: units of bonds are inferred, contradictions refused.

Every region of bonds joined by junctions has one dimension of effort and one of flow. These, and the dimensions of
numbers written without a unit, are unknowns; each law gives linear equations between powers of base units.
"""

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction

from faultbond.errors import ModelError
from faultbond.model.expression import RATE, TABLE, Binary, Call, Expression, Name, Negative, Number
from faultbond.model.parser import constant_value, to_text
from faultbond.model.source import shown
from faultbond.model.units import DIMENSIONLESS, SECOND, Dimension, coulomb_hint, percent_hint
from faultbond.model.values import Values
from faultbond.model.wiring import Wiring

UNKNOWN = "?"  # starts the name of an unknown dimension
MAX_WORK = 200_000
MAX_BLAME_WORK = 20_000
_SAME = {"abs", "min", "max", "where"}
_PURE = {"exp", "log", "sin", "cos", "tan", "tanh"}


def _unknown(name: str) -> Dimension:
    """Give an unknown dimension: of an effort `e:..`, a flow `f:..`, a signal `s:..`, or a number without unit."""
    return Dimension(((UNKNOWN + name, Fraction(1)),))


def _unknowns(form: Dimension) -> tuple[tuple[str, Fraction], ...]:
    return tuple(item for item in form.powers if item[0].startswith(UNKNOWN))


def _known(form: Dimension) -> Dimension:
    return Dimension(tuple(item for item in form.powers if not item[0].startswith(UNKNOWN)))


class Solver:
    """Solves for unknown dimensions, one equation after the other.

    A form is a dimension with unknown ones among its base units. After `MAX_WORK` terms the solver leaves the rest
    undetermined: a hostile model could need hours.
    """

    def __init__(self) -> None:
        self._solved: dict[str, Dimension] = {}
        self.work = 0

    def reduced(self, form: Dimension) -> Dimension:
        """Give the form in terms of what is still unknown."""
        while self.work <= MAX_WORK and any(name in self._solved for name, _ in form.powers):
            result = _known(form)
            for name, power in _unknowns(form):
                inner = self._solved.get(name)
                self.work += len(_unknowns(result)) + (1 if inner is None else len(_unknowns(inner)))
                result *= Dimension(((name, power),)) if inner is None else inner**power
            form = result
        return form

    def equate(self, left: Dimension, right: Dimension) -> bool:
        """Demand that two forms agree; False if they cannot."""
        if self.work > MAX_WORK:
            return True
        ratio = self.reduced(left / right)
        if self.work > MAX_WORK:
            return True
        unknown = _unknowns(ratio)
        if not unknown:
            return ratio == DIMENSIONLESS
        name, power = max(unknown, key=lambda item: ":" not in item[0])  # a number's before a region's
        self._solved[name] = (ratio / Dimension(((name, power),))) ** (-1 / power)
        return True


class Checker:
    """Infers dimensions of expressions and refuses contradictions."""

    def __init__(self, plant: Wiring, values: Values) -> None:
        self.values, self.solver, self.n_parts = values, Solver(), 0
        self.regions = regions(plant)

    def _name(self, name: str) -> Dimension:
        if name in self.values.measures:
            measure = self.values.measures[name]
            return measure.dimension if measure else _unknown(name)
        if "." not in name:
            return _unknown(f"s:{name}")  # a signal of a block network
        part, _, signal = name.partition(".")
        region = self.regions[f"{part}.{signal[1:]}" if signal[1:] else part]
        match signal[0]:
            case "e" | "f" as kind:
                return _unknown(f"{kind}:{region}")
            case "q":
                return _unknown(f"f:{region}") * SECOND
        return _unknown(f"e:{region}") * SECOND

    def infer(self, expression: Expression, where: str) -> tuple[Dimension | None, bool]:
        """Give the form of an expression (None: cannot be followed), and whether it is a bare number of any unit."""
        self.n_parts += 1
        match expression:
            case Number():
                return DIMENSIONLESS, True
            case Name(text):
                return self._name(text), False
            case Negative(operand):
                return self.infer(operand, where)
            case Binary("*" | "/" as operator, left, right):
                (a, a_free), (b, b_free) = self.infer(left, where), self.infer(right, where)
                if a is None or b is None:
                    return None, False
                return (a * b if operator == "*" else a / b), a_free and b_free
            case Binary("**", base, exponent):
                form, free = self.infer(base, where)
                value = constant_value(exponent)
                if value is None:
                    self._pure(exponent, "an exponent", where)
                    return None, False
                return (None if form is None else form ** Fraction(value).limit_denominator(1000)), free
            case Binary(operator, left, right):
                return self._common((left, right), f"the two sides of `{operator}`", expression, where)
            case Call():
                return self._call(expression, where)

    def _call(self, call: Call, where: str) -> tuple[Dimension | None, bool]:
        function, arguments = call.function, call.arguments
        if function.startswith(TABLE):
            return self._table(function.removeprefix(TABLE), call, where)
        if function == "where":
            self.infer(arguments[0], where)
            return self._common(arguments[1:], "the two results of where()", call, where)
        if function in _SAME:
            return self._common(arguments, f"the arguments of {function}()", call, where)
        if function in _PURE:
            return DIMENSIONLESS, self._pure(arguments[0], f"the argument of {function}()", where)
        form, free = self.infer(arguments[0], where)
        if function == RATE:
            return (None if form is None else form / SECOND), free
        if function == "sqrt":
            return (None if form is None else form ** Fraction(1, 2)), free
        return DIMENSIONLESS, free

    def _table(self, name: str, call: Call, where: str) -> tuple[Dimension | None, bool]:
        """Demand the unit of the x axis of what goes in; what comes out has that of the y axis."""
        into, out = self.values.tables[name]
        form, free = self.infer(call.arguments[0], where)
        if into is not None and form is not None and not free and not self.solver.equate(form, into.dimension):
            problem = f"`{shown(to_text(call.arguments[0]))}` is in {self._words(form)}, but x of the table {name}"
            raise ModelError(f"{where}{problem} is in {into.dimension}; mend the law or the unit of the table")
        return (_unknown(f"t:{name}") if out is None else out.dimension), False

    def _pure(self, expression: Expression, what: str, where: str) -> bool:
        """Demand no dimension; give whether the expression is a bare number."""
        form, free = self.infer(expression, where)
        if _scaled(expression):
            return free  # in tanh(f/0.05) the number stands for 0.05 of whatever f is measured in
        if form is not None and not free and not self.solver.equate(form, DIMENSIONLESS):
            dimension = self._words(form)
            problem = f"{what}, `{shown(to_text(expression))}`, must be dimensionless but is in {dimension}"
            raise ModelError(f"{where}{problem}; divide it by a constant in {dimension}")
        return free

    def _common(
        self, parts: Iterable[Expression], what: str, whole: Expression, where: str
    ) -> tuple[Dimension | None, bool]:
        """Demand that all parts of a sum agree; a bare number takes the unit of the others."""
        first: tuple[Expression, Dimension] | None = None
        free = True
        for part in parts:
            form, part_free = self.infer(part, where)
            if part_free:
                continue
            free = False
            if form is None:
                continue
            if first is None:
                first = (part, form)
            elif not self.solver.equate(first[1], form):
                problem = f"{what} in `{shown(to_text(whole))}` disagree"
                raise ModelError(f"{where}{problem}: {self._versus(first, (part, form))}")
        if free:
            return DIMENSIONLESS, True
        return (first[1] if first else None), False

    def _versus(self, left: tuple[Expression, Dimension], right: tuple[Expression, Dimension]) -> str:
        """Give the words for two expressions whose dimensions differ, and what to do."""
        a, b = (shown(to_text(expression)) for expression, _ in (left, right))
        advice = self._hint(left[1], right[1]) or "mend the law or the unit of a parameter"
        if any(_unknowns(self.solver.reduced(form)) for _, form in (left, right)):
            return f"`{a}` is in the unit of `{b}` times {self._words(left[1] / right[1])}; {advice}"
        return f"`{a}` is in {self._words(left[1])}, `{b}` in {self._words(right[1])}; {advice}"

    def _words(self, form: Dimension) -> str:
        return str(_known(self.solver.reduced(form)))

    def _hint(self, left: Dimension, right: Dimension) -> str:
        one, other = (_known(self.solver.reduced(form)) for form in (left, right))
        return coulomb_hint(one, other) or percent_hint(one, other)

    def unit_of(self, signal: str) -> str | None:
        """Give the SI unit of a signal, `1` if it is dimensionless; None where laws and units do not fix it."""
        form = self.solver.reduced(self._name(signal))
        if _unknowns(form):
            return None
        text = str(form)
        return "N*m" if text == "J" and signal.partition(".")[2].startswith("e") else text  # an effort is a torque

    def law(self, left: Expression, right: Expression, where: str) -> None:
        """Demand that the two sides of a law agree.

        Raises
        ------
        ModelError
            where they do not.
        """
        sides = [(side, *self.infer(side, where)) for side in (left, right)]
        known = [(side, form) for side, form, free in sides if form is not None and not free]
        if len(known) == 2 and not self.solver.equate(known[0][1], known[1][1]):
            raise ModelError(f"{where}the two sides disagree: {self._versus(known[0], known[1])}")

    def expect(self, expression: Expression, dimension: Dimension, what: str, where: str) -> None:
        """Demand a dimension of an expression: a sensor's unit, say.

        Raises
        ------
        ModelError
            where it has another.
        """
        form, free = self.infer(expression, where)
        if form is None or free or self.solver.equate(form, dimension):
            return
        found = self._words(form)
        problem = f"`{shown(to_text(expression))}` is in {found}, but {what} in {dimension}"
        advice = self._hint(form, dimension) or f"use a unit of {found}, or mend the expression"
        raise ModelError(f"{where}{problem}; {advice}")


def regions(plant: Wiring) -> dict[str, str]:
    """Give for every port (`pipe`, `K.1`, `K.2`) and junction the region of bonds that it belongs to."""
    parent: dict[str, str] = {}

    def find(port: str) -> str:
        while parent.setdefault(port, port) != port:
            parent[port] = port = parent.setdefault(parent[port], parent[port])
        return port

    def port(name: str, number: int) -> str:
        return f"{name}.{number}" if name in plant.parts and plant.parts[name].type.n_ports == 2 else name

    for bond in plant.bonds:
        parent[find(port(bond.tail, 2))] = find(port(bond.head, 1))
    return {name: find(name) for name in list(parent)}


Demand = Callable[[Checker], None]


def check_demands(demands: Sequence[Demand], start: Callable[[], Checker]) -> Checker:
    """Check all demands, and give who knows then; where one alone spoils the others, it is the one in the message.

    Raises
    ------
    ModelError
        if the demands contradict each other.
    """
    checker = start()
    first = _first_failure(demands, checker)
    if first is None:
        return checker
    index, error = first
    if (index + 1) * (checker.n_parts + checker.solver.work) <= MAX_BLAME_WORK:
        rests = ([*demands[:item], *demands[item + 1 :]] for item in range(index + 1))
        spoilers = [item for item, rest in enumerate(rests) if _first_failure(rest, start()) is None]
        if len(spoilers) == 1:
            others = [*demands[: spoilers[0]], *demands[spoilers[0] + 1 :], demands[spoilers[0]]]
            error = (_first_failure(others, start()) or first)[1]
    raise error


def _first_failure(demands: Sequence[Demand], checker: Checker) -> tuple[int, ModelError] | None:
    for index, demand in enumerate(demands):
        try:
            demand(checker)
        except ModelError as error:
            return index, error
    return None


def _scaled(expression: Expression) -> bool:
    """Whether a product or quotient holds a bare number, which may then carry any unit."""
    match expression:
        case Negative(operand):
            return _scaled(operand)
        case Binary("*" | "/", left, right):
            return isinstance(left, Number) or isinstance(right, Number) or _scaled(left) or _scaled(right)
    return False
