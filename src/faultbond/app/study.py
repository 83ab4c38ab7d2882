"""The sections of an analysis, each worked out when its turn comes. Loads casadi and sympy."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from faultbond.analysis.capability import CapabilityView, in_general, on_record
from faultbond.analysis.equilibrium import reference_levels, stands
from faultbond.analysis.groups import NearGroup
from faultbond.analysis.input_advice import ENOUGH, Stimulus, input_advice
from faultbond.analysis.other_roots import SECONDS as ROOT_SECONDS
from faultbond.analysis.other_roots import other_solutions
from faultbond.analysis.replay import recorded_runs
from faultbond.analysis.sensitivity import BIAS, GAIN, Recursion, build_recursion
from faultbond.analysis.sensor_advice import advise_sensors
from faultbond.analysis.smallest import SECONDS as SIZE_SECONDS
from faultbond.analysis.smallest import smallest_faults
from faultbond.analysis.twins import SECONDS as TWIN_SECONDS
from faultbond.analysis.twins import compare
from faultbond.app.answers import answers
from faultbond.app.disorder import refuse_disorder
from faultbond.app.engine import build_watcher
from faultbond.app.parameter_names import check_names
from faultbond.app.realisations import compiled_detector
from faultbond.app.rows import naming, no_time, sample_of, texts_of
from faultbond.app.section import Section, Work
from faultbond.app.simulation import START_POINTS, solved_start, start_of
from faultbond.app.wishes import Wishes
from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.diagnosability.isolability import Interpretation, isolability
from faultbond.diagnosability.overdetermined import minimal_sets, minimal_supports, signatures
from faultbond.diagnosability.placement import sensors_to_isolate
from faultbond.diagnosability.structural import StructuralModel, structural_model
from faultbond.equations.component_network import ComponentNetwork
from faultbond.equations.step import StepModel, is_guessed
from faultbond.errors import ModelError, RecordingError, StructureError
from faultbond.fit.samples import judged_parts
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.memory_table import Recording
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.validity import without_states
from faultbond.report import analysis
from faultbond.report.closed_forms import print_routes, routes_record
from faultbond.synthesis.engine import build_engine, build_model
from faultbond.types import TimeGrid

MOST_SETS = 120  # sets whose other solutions are looked for; single suspects where there are more
MOST_TWINS = 10  # suspects up to which pairs are compared as twins; single suspects where there are more
REST_SAMPLES = (400, 100, 25)  # of the record of inputs at rest, as many as the plant has a solution for
REST_NUMBERS = 3 * 10**6  # in the sensitivities along it, which is the shorter for more of them
MOST_UNKNOWNS = 80  # states, slow errors and parameters up to which smallest faults are worked out
MOST_TESTS = 2000  # minimal sets of equations that are looked for
MOST_WITHIN = 100_000  # samples in which a smallest fault is to be found
AT_REST, WHEN_RECORDED = "while the inputs stand still", "on the recording"
MOST_GROUPS = 5  # groups for which a change of an input is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class _Study:
    """A plant with all that its sections share."""

    graph: BondGraph
    network: ComponentNetwork
    model: StepModel
    recursion: Recursion
    points: tuple[GridPoint, ...]
    start: Mapping[str, float]


def sections(graph: BondGraph, network: ComponentNetwork, wishes: Wishes) -> Iterator[tuple[str, Work]]:
    """Give the title of each section and how it is worked out, in order.

    Raises
    ------
    ModelError
        Where a parameter is asked for that does not exist.
    """
    study = _study(graph, network, wishes)
    if not study.network.suspects:
        return
    view = in_general(study.model, study.recursion)
    yield "testable sets", lambda: _general(study, view)
    recorded = _recorded(study) if study.points else None
    if recorded is not None:
        yield "the recording", lambda: _on_data(study, recorded)
    yield "structure", lambda: _structure(study)
    yield "other solutions", lambda: _solutions(study, wishes, view, recorded)
    if study.graph.grid is not TimeGrid.NONE:
        yield "smallest faults", lambda: _smallest(study, wishes, view)
    yield "further sensors", lambda: _sensors(study)
    if study.graph.inputs and study.graph.grid is not TimeGrid.NONE:
        yield "test inputs", lambda: _inputs(study, wishes, recorded)
    yield "routes", lambda: _routes(study, wishes)  # the longest, by far: it would stand before what is asked first


def _study(graph: BondGraph, network: ComponentNetwork, wishes: Wishes) -> _Study:
    _check(graph, wishes)
    points = _points(graph, wishes.data) if wishes.data is not None else ()
    start = {} if wishes.data is None else solved_start(graph, wishes.data) if graph.valid_when is None else None
    graph = without_states(graph)
    start = start_of(graph, points[:START_POINTS]) if start is None else start
    model = build_model(graph)
    return _Study(
        graph=graph,
        network=network,
        model=model,
        recursion=build_recursion(model.plant),
        points=points,
        start=start,
    )


def _check(graph: BondGraph, wishes: Wishes) -> None:
    """Refuse wishes that cannot be fulfilled before anything is worked out."""
    for names in wishes.separate:
        check_names(graph, names)
    if wishes.separate and len(set(map(frozenset, wishes.separate))) < max(2, len(wishes.separate)):
        raise ModelError("--separate: expected two sets or more, no two alike, such as K4 K6,K1")
    grid = graph.sample_time or 1.0
    if wishes.within is not None and wishes.within > MOST_WITHIN * grid:
        raise ModelError(
            f"--within: {wishes.within:.6g} s are more than {MOST_WITHIN} samples of {graph.name}; "
            f"give at most {MOST_WITHIN * grid:.6g} s"
        )


def _points(graph: BondGraph, recording: Recording) -> tuple[GridPoint, ...]:
    """Give the grid points that have a value; a gap of days holds millions that have none.

    Where the model does not always hold, those of the longest time in which it does.
    """
    grid = Grid(graph.sample_time, steady=True, row_time=graph.row_time, held=graph.held_inputs)
    texts = texts_of(recording)
    rows = on_grid(read_rows(recording, columns_of(graph), texts), grid)
    with naming(recording):
        points = tuple(point for point in rows if np.isfinite(point.u).any() or np.isfinite(point.y).any())
    if not points:
        raise RecordingError(no_time(recording, texts))
    refuse_disorder(grid, recording)
    if graph.valid_when is not None:
        parts = judged_parts(str(recording), tuple(map(sample_of, points)), build_watcher(graph))
        longest = max((part for _, part in parts), key=len)
        points = tuple(point for point in points if longest[0].time <= point.time <= longest[-1].time)
    return points


def _general(study: _Study, view: CapabilityView) -> Section:
    return Section(
        record=analysis.groups_record(view),
        show=lambda console: analysis.print_view(
            console, study.graph, view, "What the sensors can tell", "with everything excited"
        ),
    )


def _recorded(study: _Study) -> CapabilityView:
    model = study.model
    declared = {item.name: item.start.mean for item in study.graph.components if item.start is not None}
    stores = model.plant.network.states
    start = np.array([study.start.get(item.name, declared.get(item.component or "", 0.0)) for item in stores])
    times = np.array([point.time for point in study.points])
    inputs = np.array([point.u for point in study.points]).reshape(len(times), len(study.graph.inputs))
    readings = np.array([point.y for point in study.points]).reshape(len(times), len(study.graph.sensors))
    return on_record(model, study.recursion, recorded_runs(model, study.recursion, times, inputs, start, readings))


def _on_data(study: _Study, view: CapabilityView) -> Section:
    return Section(
        record={"on_data": analysis.groups_record(view)},
        show=lambda console: analysis.print_view(
            console, study.graph, view, "What this recording can tell", "effects that its noise does not hide"
        ),
    )


def _structure(study: _Study) -> Section:
    model = structural_model(study.model.plant.network, study.network.suspects)
    found = {kind.value: isolability(model, kind) for kind in Interpretation}
    tests = _tests(model)
    stores = study.model.plant.network.states
    sensors = _structural_sensors(model, {name for item in stores if item.lag for name in (item.name, item.rate)})
    return Section(
        record=analysis.structure_record(study.network.suspects, found, tests, sensors),
        show=lambda console: analysis.print_structure(console, study.network.suspects, found, tests, sensors),
    )


def _tests(model: StructuralModel) -> analysis.StructuralTests | None:
    """The smallest sets of equations that can be checked, and of faults that a check responds to, if not too many."""
    try:
        sets = minimal_sets(model.equations, model.n_variables, limit=MOST_TESTS)
        supports = minimal_supports(model.equations, model.n_variables, model.faults, limit=MOST_TESTS)
    except StructureError:
        return None
    rows = signatures(supports, model.faults)
    faults = tuple(tuple(model.fault_names[k] for k in np.flatnonzero(row)) for row in rows)
    return analysis.StructuralTests(n_sets=len(sets), faults=faults)


def _structural_sensors(model: StructuralModel, unread: Collection[str]) -> tuple[tuple[str, ...], ...]:
    """The smallest sets of up to two signals, none of them `unread`, whose sensors isolate all that can be isolated."""
    unread = {*unread, *model.fault_names}
    places = [k for k, name in enumerate(model.variable_names) if "->" not in name and name not in unread]
    try:
        found = sensors_to_isolate(model, places, max_sensors=2)
    except StructureError:
        return ()
    return tuple(tuple(model.variable_name(k) for k in chosen) for chosen in found if chosen)


def _routes(study: _Study, wishes: Wishes) -> Section:
    told = answers(study.graph, study.network, wishes)
    late = told.forms_left_out, told.routes_left_out
    return Section(
        record=routes_record(study.network, told.found, *late),
        show=lambda console: print_routes(console, study.network, told.found, *late),
    )


def _solutions(study: _Study, wishes: Wishes, view: CapabilityView, recorded: CapabilityView | None) -> Section:
    """Other values of each identifiable set, and sets that imitate each other."""
    graph = study.graph
    names = [item.name for item in graph.parameters]
    small = [item for item in view.judgement.verdicts if item.identifiable and len(item.parameters) <= graph.max_faults]
    if len(small) > MOST_SETS:
        small = [item for item in small if len(item.parameters) == 1]
    sets = [tuple(names[k] for k in item.parameters) for item in small]
    found = other_solutions(study.model, sets, seconds=ROOT_SECONDS * wishes.budget) if sets else ()
    largest = 2 if len(study.network.suspects) <= MOST_TWINS else 1
    alike = compare(study.model, largest=largest, seconds=TWIN_SECONDS * wishes.budget)
    return Section(
        record=analysis.hypotheses_record(graph, view, recorded, found, alike),
        show=lambda console: analysis.print_solutions(console, graph, found, alike),
    )


def _smallest(study: _Study, wishes: Wishes, view: CapabilityView) -> Section:
    unknowns = study.model.v.numel()
    if unknowns > MOST_UNKNOWNS * wishes.budget:
        raise StructureError(
            f"{study.graph.file}: the detector of {study.graph.name} follows {unknowns} states and parameters, and "
            f"smallest faults are worked out for up to {MOST_UNKNOWNS * wishes.budget}; state parameters that do not "
            f"fail as constants, or raise --budget to {-(-unknowns // MOST_UNKNOWNS)}"
        )
    spec, engine = build_engine(study.graph)
    samples = [sample_of(point) for point in study.points] or None
    try:
        seconds = SIZE_SECONDS * wishes.budget
        sizes = smallest_faults(
            study.model,
            spec,
            engine,
            compiled_detector(spec.thresholds),
            samples,
            within=wishes.within,
            hidden=_hidden(study, view, spec),
            seconds=seconds,
        )
        order = [item.name for item in spec.parameters]
        found = sorted(sizes, key=lambda item: order.index(item.parameter) if item.parameter in order else len(order))
    except RecordingError as error:
        raise StructureError(str(error)) from error
    return Section(
        record=analysis.smallest_record(found),
        show=lambda console: analysis.print_smallest(console, study.graph, found, _guessed(study)),
    )


def _guessed(study: _Study) -> dict[str, float]:
    """Give about where inputs are taken to be of which nobody says anything, SI, by name; none beside a recording."""
    if study.points:
        return {}
    levels = zip(study.graph.inputs, reference_levels(study.model).tolist(), strict=True)
    return {item.name: level for item, level in levels if is_guessed(item)}


def _hidden(study: _Study, view: CapabilityView, spec: EngineSpec) -> dict[str, str]:
    """Give what looks like what an unknown input may do, parameters and faults of instruments, each with the reason."""
    unknown = " and ".join(item.name for item in study.graph.unknown_inputs)
    names = [item.name for item in study.graph.parameters]
    single = [item for item in view.judgement.verdicts if len(item.parameters) == 1 and not item.identifiable]
    hidden = [names[item.parameters[0]] for item in single if unknown]
    hidden += [f"{item.name}{BIAS}" for item in spec.outputs if item.hidden]
    hidden += [f"{item.name}{kind}" for kind in (BIAS, GAIN) for item in spec.inputs if item.hidden]
    return dict.fromkeys(hidden, f"what {unknown} may do hides it")


def _sensors(study: _Study) -> Section:
    advice = advise_sensors(study.model, study.recursion)
    return Section(
        record=analysis.sensors_record(study.graph, advice),
        show=lambda console: analysis.print_sensor_advice(console, advice),
    )


def _inputs(study: _Study, wishes: Wishes, recorded: CapabilityView | None) -> Section:
    """What to move so that sets can be told apart: those that were named, else those that look alike."""
    note = "" if wishes.separate else f"for what looks alike {WHEN_RECORDED if recorded is not None else AT_REST}"
    groups: Sequence[Sequence[tuple[str, ...]]]
    if wishes.separate:
        groups = [wishes.separate]
    else:
        view = recorded if recorded is not None else _at_rest(study)
        names = [item.name for item in study.graph.parameters]
        groups = [tuple((names[k],) for k in alike) for alike in _look_alikes(view)][:MOST_GROUPS]
    levels = _recorded_levels(study)
    found: tuple[Stimulus, ...] = tuple(input_advice(study.model, group, inputs=levels) for group in groups)
    if not wishes.separate:  # alike in direction, but far enough apart in a record of that length, needs no move
        found = tuple(item for item in found if not item.choices or item.choices[0].before < ENOUGH)
    return Section(
        record=analysis.inputs_record(found),
        show=lambda console: analysis.print_input_advice(console, found, note, alike=bool(groups)),
    )


def _look_alikes(view: CapabilityView) -> list[list[int]]:
    """Give the classes of single suspects that look alike, then of those nearly alike in one step or in several.

    Instruments are none: no input is advised for them.
    """
    found = [[chosen[0] for chosen in group.sets] for group in view.groups if len(group.sets[0]) == 1]
    near: list[set[int]] = []
    for pair in view.near_groups:
        if len(pair.sets[0]) == 1 and not any(view.is_instrument(chosen) for chosen in pair.sets):
            joined = {chosen[0] for chosen in pair.sets}.union(*(item for item in near if not _apart(item, pair)))
            near = [*(item for item in near if _apart(item, pair)), joined]
    return found + sorted(sorted(item) for item in near)


def _recorded_levels(study: _Study) -> FloatArray | None:
    """Give where the inputs were in the recording (n_inputs,), SI, at three quarters; None without one.

    In the middle of one that goes both ways, or on and off, nothing moves.
    """
    told = np.array([point.u for point in study.points]).reshape(len(study.points), len(study.graph.inputs))
    return np.nanquantile(told, 0.75, axis=0) if len(told) and np.isfinite(told).any(axis=0).all() else None


def _apart(suspects: set[int], pair: NearGroup) -> bool:
    return suspects.isdisjoint(chosen[0] for chosen in pair.sets)


def _at_rest(study: _Study) -> CapabilityView:
    """What can be told where all inputs stand still: from where the reference run ended, else from where it rests."""
    model, levels = study.model, reference_levels(study.model)
    begins = stands(model, levels)
    size = len(study.graph.sensors) * (len(study.graph.parameters) + len(model.states))
    for count in [item for item in REST_SAMPLES if item * size <= REST_NUMBERS] or REST_SAMPLES[-1:]:
        times = np.arange(count, dtype=np.float64) * (study.graph.sample_time or 1.0)
        for stand in begins:
            with suppress(StructureError):
                held = np.tile(levels, (count, 1))
                runs = recorded_runs(model, study.recursion, times, held, stand.contents)
                return on_record(model, study.recursion, runs)
    raise StructureError(
        f"{study.graph.file}: {study.graph.name} has no finite solution while its inputs stand still at their "
        "references; give a recording of the healthy plant with --data"
    )
