"""Lanes with a slot: neutral roles change nothing, slopes follow the roles, ranges hold for what the slot adds."""

from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import load_model
from faultbond.runtime.slotted import shared, widened
from faultbond.runtime.start import healthy_lane
from faultbond.synthesis.filter import LanePlant, build_filter
from faultbond.synthesis.machine import VirtualMachine
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).parents[3] / "examples"
PLANTS = ("dc_motor_current", "rlc", "tank", "quiet")  # quiet: no noise of the input


@dataclass(frozen=True, kw_only=True, eq=False)
class Built:
    """A plant with both filters, and the view of a lane with a slot as a function of numbers."""

    spec: EngineSpec
    plain: VirtualMachine
    slot: VirtualMachine
    predict: ca.Function  # (z, roles, u, implicit, dt) -> states, slopes, effective v
    measure: ca.Function  # (z, roles, u, implicit) -> readings, slopes

    def engine_samples(self, rows: int) -> FloatArray:
        """Samples without any sense; some values are missing, all updates are made twice."""
        generator, place = np.random.default_rng(8), self.spec.sample_fields
        samples = np.zeros((rows, self.spec.n_sample))
        samples[:, place["dt"]], samples[:, place["scale"]], samples[:, place["again"]] = 0.02, 1.0, 1.0
        inputs = generator.uniform(0.3, 0.9, (rows + 1, len(self.spec.inputs)))
        samples[:, place["u_before"]], samples[:, place["u"]] = inputs[:-1], inputs[1:]
        samples[:, place["y"]] = generator.normal(2.0, 0.5, (rows, len(self.spec.outputs)))
        samples[:, place["use"]] = generator.random((rows, len(self.spec.outputs))) > 0.2
        return samples


def built(name: str) -> Built:
    """Both filters of an example."""
    graph = load_model(EXAMPLES / ("dc_motor" if name == "quiet" else name) / "model.yaml")
    if name == "quiet":
        graph = replace(graph, inputs=tuple(replace(item, noise=0.0) for item in graph.inputs))
    plant = build_plant(graph)
    model, wide_model = build_step_model(plant), build_step_model(plant, all_inputs=True)
    spec = build_spec(model)
    wide = spec.slotted
    lane, dt = ca.SX.sym("lane", wide.n_numbers), ca.SX.sym("dt")
    u, implicit = ca.SX.sym("u", len(spec.inputs)), ca.SX.sym("implicit", len(spec.loops))
    view = LanePlant(spec=wide, model=wide_model, roles={name: lane[where] for name, where in wide.role_fields.items()})
    z = lane[: wide.n_joint]
    return Built(
        spec=spec,
        plain=VirtualMachine(build_filter(spec, model)),
        slot=VirtualMachine(build_filter(wide, wide_model)),
        predict=ca.Function("p", [lane, u, implicit, dt], list(view.predict(z, u, implicit, dt)[:2])),
        measure=ca.Function("m", [lane, u, implicit], list(view.measure(z, u, implicit)[:2])),
    )


@pytest.fixture(scope="module", params=PLANTS)
def plant(request: pytest.FixtureRequest) -> Built:
    """Each plant, built once."""
    return built(request.param)


def correlated(spec: EngineSpec) -> FloatArray:
    """A healthy lane, shape (n_numbers,), with a covariance that is full."""
    generator = np.random.default_rng(2)
    lane = healthy_lane(spec, np.full(len(spec.states), 2.0), np.eye(len(spec.states)))[:, 0]
    root = 0.03 * generator.normal(size=(spec.n_joint, spec.n_joint))
    lane[spec.covariance_slice] = pack(root @ root.T + 1e-3 * np.eye(spec.n_joint))
    return lane


def with_roles(spec: EngineSpec, lane: FloatArray, **roles: FloatArray) -> FloatArray:
    """The lane with a slot; roles that are not given are neutral."""
    wide = widened(spec, lane)
    for name, place in spec.slotted.role_fields.items():
        wide[place] = roles.get(name, np.full(place.stop - place.start, float(name in ("reads", "noise"))))
    return wide


def acting(built: Built) -> FloatArray:
    """A lane whose slot acts on everything at once, by numbers without any sense."""
    spec, generator = built.spec, np.random.default_rng(5)
    n_p, n_u, n_y = len(spec.parameters), len(spec.inputs), len(spec.outputs)
    roles = {
        "theta": generator.uniform(-0.3, 0.3, n_p),
        "input": generator.uniform(0.2, 0.6, n_u),
        "reads": generator.uniform(0.3, 0.8, n_y),
        "gain": generator.uniform(0.5, 1.5, n_y),
        "bias": generator.uniform(0.5, 1.5, n_y),
        "noise": generator.uniform(2.0, 5.0, n_y),
    }
    lane = with_roles(spec, correlated(spec), **roles)
    lane[spec.slotted.slot_slice] = [0.2, 0.4]
    return lane


def test_neutral_roles_change_nothing(plant: Built) -> None:
    """A slot whose size acts on nothing leaves the filter as it is, whatever the size; the size goes on at its rate."""
    spec, place = plant.spec, shared(plant.spec)
    one = correlated(spec)[:, None]
    two = with_roles(spec, one[:, 0])[:, None]
    two[spec.slotted.slot_slice, 0] = [0.5, -2.0]
    for sample in plant.engine_samples(20):
        one, seen_one = plant.plain.advance(one, sample[None, :])
        two, seen_two = plant.slot.advance(two, sample[None, :])
        assert two[place, 0] == pytest.approx(one[: spec.n_joint, 0], rel=1e-9, abs=1e-12)
        full = unpack(spec.slotted, two[spec.slotted.covariance_slice, 0])
        assert full[np.ix_(place, place)] == pytest.approx(
            unpack(spec, one[spec.covariance_slice, 0]), rel=1e-7, abs=1e-12
        )
        assert not np.any(full[spec.slotted.slot_slice])
        assert two[spec.slotted.loop_slice, 0] == pytest.approx(one[spec.loop_slice, 0], rel=1e-9)
        assert two[-1, 0] == pytest.approx(one[-1, 0], rel=1e-9)
        assert seen_two == pytest.approx(seen_one, rel=1e-9, abs=1e-12)
    assert two[spec.slotted.slot_slice, 0] == pytest.approx([0.5 - 20 * 0.02 * 2.0, -2.0])


def test_roles_are_kept(plant: Built) -> None:
    """What a slot acts on is the same after a sample, to the last bit."""
    lane, wide = acting(plant)[:, None], plant.spec.slotted
    following, _ = plant.slot.advance(lane, plant.engine_samples(3))
    roles = slice(wide.loop_slice.stop, wide.n_numbers - 1)
    assert np.array_equal(following[roles], lane[roles])
    assert np.all(np.isfinite(following))


def test_slopes_of_readings_are_their_differences(plant: Built) -> None:
    """The slopes of readings by z, size included, are the differences that small changes of z make."""
    lane, wide = acting(plant), plant.spec.slotted
    u, implicit = np.full(len(wide.inputs), 0.7), np.zeros(len(wide.loops))
    _, slope = (item.full() for item in plant.measure(lane, u, implicit))
    for k in range(wide.n_joint):
        ends = []
        for step in (1e-6, -1e-6):
            moved = lane.copy()
            moved[k] += step * max(1.0, abs(lane[k]))
            ends.append(plant.measure(moved, u, implicit)[0].full()[:, 0])
        difference = (ends[0] - ends[1]) / (2e-6 * max(1.0, abs(lane[k])))
        assert slope[:, k] == pytest.approx(difference, rel=1e-6, abs=1e-6 * (1e-9 + np.abs(slope).max()))


def test_slopes_of_a_step_are_its_differences(plant: Built) -> None:
    """Over a short time, where the Jacobian inside the method hardly counts, so are those of the next states."""
    lane, wide = acting(plant), plant.spec.slotted
    u, implicit, dt = np.full(len(wide.inputs), 0.7), np.zeros(len(wide.loops)), 1e-5
    _, slope = (item.full() for item in plant.predict(lane, u, implicit, dt))
    slope[:, : len(wide.states)] -= np.eye(len(wide.states))
    for k in range(wide.n_joint):
        ends = []
        for step in (1e-4, -1e-4):
            moved = lane.copy()
            moved[k] += step
            own = moved[: len(wide.states)]
            ends.append(plant.predict(moved, u, implicit, dt)[0].full()[:, 0] - own)
        difference = (ends[0] - ends[1]) / 2e-4
        assert slope[:, k] == pytest.approx(difference, rel=2e-3, abs=1e-6 * np.abs(slope).max())


def test_each_role_acts_on_its_own(plant: Built) -> None:
    """A size d counts as d more of a factor, d more of an input, and 1 + d times or d more of a reading."""
    spec = plant.spec
    wide, lane, d = spec.slotted, correlated(spec), 0.3
    u, implicit = np.full(len(spec.inputs), 0.7), np.zeros(len(spec.loops))
    size = wide.slot_slice.start

    def read(roles: dict[str, FloatArray], given: FloatArray = u, lane: FloatArray = lane) -> tuple[FloatArray, ...]:
        numbers = with_roles(spec, lane, **roles)
        numbers[size] = d
        states = plant.predict(numbers, given, implicit, 0.02)[0].full()[:, 0]
        return states, plant.measure(numbers, given, implicit)[0].full()[:, 0]

    plain = read({})
    for k in range(len(spec.parameters)):
        moved = lane.copy()
        moved[spec.parameter_slice.start + k] += d
        pairs = zip(read({"theta": np.eye(len(spec.parameters))[k]}), read({}, lane=moved), strict=True)
        assert all(one == pytest.approx(two, rel=1e-12) for one, two in pairs)
    for k in range(len(spec.inputs)):
        unit = np.eye(len(spec.inputs))[k]
        pairs = zip(read({"input": unit}), read({}, u + d * unit), strict=True)
        assert all(one == pytest.approx(two, rel=1e-12) for one, two in pairs)
    for k in range(len(spec.outputs)):
        unit = np.eye(len(spec.outputs))[k]
        assert read({"gain": unit})[1] == pytest.approx(plain[1] * (1.0 + d * unit), rel=1e-12)
        assert read({"bias": unit})[1] == pytest.approx(plain[1] + d * unit, rel=1e-12)
        assert read({"reads": 1.0 - unit})[1] == pytest.approx(plain[1] * (1.0 - unit), rel=1e-12)


def test_noise_counts_by_its_role(plant: Built) -> None:
    """A sensor with four times the noise variance adds three more of them to the variance of its innovation."""
    spec, generator = plant.spec, np.random.default_rng(1)
    times = generator.uniform(0.5, 6.0, len(spec.outputs))
    sample = plant.engine_samples(1)
    plain, noisy = (
        plant.slot.advance(with_roles(spec, correlated(spec), **roles)[:, None], sample)[1][0, :, 0]
        for roles in ({}, {"noise": times})
    )
    n_y = len(spec.outputs)
    assert noisy[:n_y] == pytest.approx(plain[:n_y], rel=1e-14)
    assert noisy[n_y:] - plain[n_y:] == pytest.approx((times - 1.0) * spec.output_noise**2, rel=1e-6)
    sample[:, spec.sample_fields["scale"]] = spec.thresholds.blank_factor
    one, other = (
        plant.slot.advance(with_roles(spec, correlated(spec), **roles)[:, None], sample)[1][0, :, 0]
        for roles in ({}, {"noise": times})
    )
    assert np.array_equal(one, other)  # so that a lane of noise does not count what says nothing


def test_what_the_slot_adds_stays_in_the_range(plant: Built) -> None:
    """A size that takes a parameter out of its range acts as one that takes it to the end of its range."""
    spec = plant.spec
    size, u, implicit = spec.slotted.slot_slice.start, np.full(len(spec.inputs), 0.7), np.zeros(len(spec.loops))
    for k, item in enumerate(spec.parameters):
        for end, far in ((item.lower, -1e6), (item.upper, 1e6)):
            if not np.isfinite(end):
                continue
            lane = with_roles(spec, correlated(spec), theta=np.eye(len(spec.parameters))[k])
            ends = []
            for value in (far, end - item.healthy):
                lane[size] = value
                ends.append(plant.predict(lane, u, implicit, 0.02)[0].full())
            assert ends[0] == pytest.approx(ends[1], rel=1e-9)
