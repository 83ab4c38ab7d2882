"""What sensors can tell, in general and along a recording."""

from collections import Counter

import numpy as np
import pytest

from faultbond.analysis.capability import CapabilityView, in_general, largest_size, on_record
from faultbond.analysis.groups import Group
from faultbond.analysis.replay import recorded_runs
from faultbond.analysis.sensitivity import build_recursion
from plants import example, stated


def counts(view: CapabilityView) -> dict[int, int]:
    """The number of testable sets by size."""
    return dict(Counter(len(item.parameters) for item in view.judgement.verdicts if item.testable))


def test_all_sizes_of_the_motor() -> None:
    """Fifteen sets of one and two suspects; with the current thirty, of one to four (thesis 6.5)."""
    models = [example(name) for name in ("dc_motor", "dc_motor_current")]
    first, second = (counts(in_general(model, build_recursion(model.plant))) for model in models)
    assert first == {1: 5, 2: 10}
    assert second == {1: 5, 2: 10, 3: 10, 4: 5}


def test_valves_that_stand_still_hide_what_their_movement_shows() -> None:
    """Along a record of constant valves K4 and K6 are one group, as are K1 and K7; in general there is no group."""
    model = example("tank")
    recursion = build_recursion(model.plant)
    assert in_general(model, recursion).groups == ()
    times = np.arange(400.0)
    runs = recorded_runs(model, recursion, times, np.tile([60.0, 35.0], (400, 1)), np.array([0.05]))
    view = on_record(model, recursion, runs)
    names = [item.name for item in model.plant.graph.parameters]
    found = {tuple(names[k] for chosen in group.sets for k in chosen) for group in view.groups}
    assert any({"K4", "K6"} <= set(group) for group in found)
    assert any({"K1", "K7"} <= set(group) for group in found)
    assert view.judgement.rank.value < 6


def test_a_sudden_change_is_told_by_the_store_that_keeps_its_content() -> None:
    """Of three tanks in a row four faults act as one once they last; from their beginning two of them do."""
    model = example("three_tank")
    view = in_general(model, build_recursion(model.plant))

    def named(groups: tuple[Group, ...]) -> set[frozenset[str]]:
        return {frozenset(view.names[k] for chosen in group.sets for k in chosen) for group in groups}

    assert named(view.groups) == {frozenset({"V1", "V2", "V3", "T3"})}
    assert named(view.sudden_groups) == {frozenset({"V3", "T3"}), frozenset({"T1", "q0.bias"})}


def test_an_instrument_may_look_like_a_component() -> None:
    """The tank's leak and an outlet valve that opens further than it says are one; so are K4 and that valve's gain."""
    model = example("tank")
    view = in_general(model, build_recursion(model.plant))
    found = [{view.names[k] for chosen in group.sets for k in chosen} for group in view.sudden_groups]
    assert found == [{"K4", "u_out.gain"}, {"K6", "u_out.bias"}]
    assert view.sudden_groups[0].reason == "only K4*u_out.gain acts"
    assert all(view.is_instrument(chosen) == ("." in view.names[chosen[0]]) for chosen in view.sudden_groups[0].sets)


def test_where_all_explains_anything_singles_are_compared() -> None:
    """Of the resistor and the capacitor no set is testable; that they look alike is still told."""
    model = example("rc")
    view = in_general(model, build_recursion(model.plant))
    assert counts(view) == {}
    assert [group.sets for group in view.groups] == [((0,), (1,))]


@pytest.mark.parametrize(("n", "most", "size"), [(5, 2, 5), (12, 2, 12), (13, 2, 6), (20, 2, 3), (20, 4, 4), (1, 2, 1)])
def test_sizes_that_are_judged(n: int, most: int, size: int) -> None:
    """All sizes of a few suspects; of many those that stay below four thousand sets, and what max_faults asks."""
    assert largest_size(n, most) == size


def test_what_only_noise_hides_is_near_not_alike() -> None:
    """Of a motor at rest but for a trace of movement R and C differ, by less than the noise: a near group, no group."""
    model = example("dc_motor")
    rest = np.array([2.5 * 10.0 * 0.4 / 5.2, 1.5 * 20.0 / 5.2])
    inputs = np.full((400, 1), 10.0)
    inputs[200:] += 1e-4
    recursion = build_recursion(model.plant)
    view = on_record(model, recursion, recorded_runs(model, recursion, np.linspace(0.0, 7.98, 400), inputs, rest))
    assert view.judgement.rank.value == 1
    assert view.groups == ()
    (still,) = view.sudden_groups  # from the change on the input does not move at all
    assert [view.names[k] for (k,) in still.sets] == ["V.bias", "V.gain"]
    near = [{view.names[k] for chosen in group.sets for k in chosen} for group in view.near_groups]
    assert {"R", "C"} in near  # once it lasts
    assert {"R", "V.bias"} in near  # while it is new


def test_nearness_is_in_units_of_the_noise() -> None:
    """What tells a from b shows in a sensor that is too noisy to tell it."""
    text = (
        "name: two sensors\nsample_time: none\ninputs: {u: {}}\nblocks:\n"
        "  p: {law: x = (a + b)*u, parameters: {a: 2, b: 3}}\n  q: {law: z = a*u}\n"
        "sensors: {y: {reads: x, noise: 0.01}, w: {reads: z, noise: NOISE}}\n"
    )
    models = [stated(text.replace("NOISE", noise)) for noise in ("0.01", "1e9")]
    fine, coarse = (in_general(model, build_recursion(model.plant)) for model in models)
    assert (fine.groups, fine.near_groups, coarse.groups) == ((), (), ())
    assert [item.sets for item in coarse.near_groups] == [((0,), (1,))]
