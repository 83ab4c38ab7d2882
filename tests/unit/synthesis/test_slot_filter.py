"""Lanes with a slot: neutral roles change nothing, slopes follow the roles, ranges hold for what the slot adds."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from dense_filter import DenseFilter, dense_filter
from faultbond.arrays import FloatArray
from faultbond.contract.slots import with_slot
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.synthesis.engine import build_engine
from lanes import shared

EXAMPLES = Path(__file__).parents[3] / "examples"
PLANTS = ("dc_motor_current", "rlc", "tank", "quiet")  # quiet: no noise of the input


@dataclass(frozen=True, kw_only=True, eq=False)
class Built:
    """A plant with both engines, and the textbook filter of lanes with a slot, whose slopes are looked at."""

    spec: EngineSpec
    plain: Core
    slot: Core
    dense: DenseFilter

    def predict(self, numbers: FloatArray, u: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """Give the states after a step of a lane, and their slopes by z."""
        lane = self.dense.lane(numbers)
        return self.dense.predict(lane.z, lane.roles, u, lane.implicit, dt)[:2]

    def measure(self, numbers: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give the readings of a lane, and their slopes by z."""
        lane = self.dense.lane(numbers)
        return self.dense.measure(lane.z, lane.roles, u, lane.implicit)[:2]

    def engine_samples(self, rows: int) -> FloatArray:
        """Samples without any sense; some values are missing, all updates are made twice."""
        generator, place = np.random.default_rng(8), self.spec.sample_fields
        samples = np.zeros((rows, self.spec.n_sample))
        samples[:, place["dt"]], samples[:, place["scale"]], samples[:, place["again"]] = 0.02, 1.0, 1.0
        inputs = generator.uniform(0.3, 0.9, (rows + 1, len(self.spec.inputs)))
        samples[:, place["u_before"]], samples[:, place["u"]] = inputs[:-1], inputs[1:]
        samples[:, place["y"]] = generator.normal(2.0, 0.5, (rows, len(self.spec.outputs)))
        n_noisy = len(self.spec.noisy_inputs)
        samples[:, place["fade"]] = generator.uniform(0.0, 0.9, (rows, n_noisy))
        samples[:, place["fresh"]] = generator.uniform(0.0, 0.03, (rows, n_noisy))
        samples[:, place["use"]] = generator.random((rows, len(self.spec.outputs))) > 0.2
        return samples


def built(name: str) -> Built:
    """Both engines of an example."""
    graph = load_model(EXAMPLES / ("dc_motor" if name == "quiet" else name) / "model.yaml")
    if name == "quiet":
        graph = replace(graph, inputs=tuple(replace(item, noise=0.0) for item in graph.inputs))
    spec, engine = build_engine(graph)
    return Built(spec=spec, plain=engine, slot=engine.slot, dense=dense_filter(graph)[1].slot)


@pytest.fixture(scope="module", params=PLANTS)
def plant(request: pytest.FixtureRequest) -> Built:
    """Each plant, built once."""
    return built(request.param)


def correlated(engine: Core) -> FloatArray:
    """A healthy lane, shape (n_numbers,), with a covariance that is full."""
    spec, generator = engine.spec, np.random.default_rng(2)
    lane = engine.healthy_lane(np.full(len(spec.states), 2.0), np.eye(len(spec.states)))[:, 0]
    root = 0.03 * generator.normal(size=(spec.n_joint, spec.n_joint))
    lane[spec.covariance_slice] = pack(root @ root.T + 1e-3 * np.eye(spec.n_joint))
    return lane


def with_roles(spec: EngineSpec, lane: FloatArray, **roles: FloatArray) -> FloatArray:
    """The lane with a slot; roles that are not given are neutral."""
    wide = with_slot(spec, lane)
    for name, place in spec.slotted.role_fields.items():
        wide[place] = roles.get(
            name, np.full(place.stop - place.start, float(name in ("reads", "noise", "obeys", "moves")))
        )
    return wide


def acting(built: Built) -> FloatArray:
    """A lane whose slot acts on everything at once, by numbers without any sense."""
    spec, generator = built.spec, np.random.default_rng(5)
    n_p, n_u, n_y = len(spec.parameters), len(spec.inputs), len(spec.outputs)
    roles = {
        "theta": generator.uniform(-0.3, 0.3, n_p),
        "input": generator.uniform(0.2, 0.6, n_u),
        "obeys": generator.uniform(0.2, 0.8, n_u),
        "reads": generator.uniform(0.3, 0.8, n_y),
        "gain": generator.uniform(0.5, 1.5, n_y),
        "bias": generator.uniform(0.5, 1.5, n_y),
        "noise": generator.uniform(2.0, 5.0, n_y),
        "moves": generator.uniform(0.3, 0.8, 1),
        "input_beside": generator.uniform(0.2, 0.6, n_u),
        "bias_beside": generator.uniform(0.5, 1.5, n_y),
    }
    lane = with_roles(spec, correlated(built.plain), **roles)
    lane[spec.slotted.slot_slice] = [0.2, 0.4]
    return lane


def test_neutral_roles_change_nothing(plant: Built) -> None:
    """A slot whose size acts on nothing leaves the filter as it is, whatever the size; the size goes on at its rate."""
    spec, place = plant.spec, shared(plant.spec)
    one = correlated(plant.plain)[:, None]
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
    u = np.full(len(wide.inputs), 0.7)
    _, slope = plant.measure(lane, u)
    for k in range(wide.n_joint):
        ends = []
        for step in (1e-6, -1e-6):
            moved = lane.copy()
            moved[k] += step * max(1.0, abs(lane[k]))
            ends.append(plant.measure(moved, u)[0])
        difference = (ends[0] - ends[1]) / (2e-6 * max(1.0, abs(lane[k])))
        assert slope[:, k] == pytest.approx(difference, rel=1e-6, abs=1e-6 * (1e-9 + np.abs(slope).max()))


def test_slopes_of_a_step_are_its_differences(plant: Built) -> None:
    """Over a short time, where the Jacobian inside the method hardly counts, so are those of the next states."""
    lane, wide = acting(plant), plant.spec.slotted
    u, dt = np.full(len(wide.inputs), 0.7), 1e-5
    _, slope = plant.predict(lane, u, dt)
    slope[:, : len(wide.states)] -= np.eye(len(wide.states))
    for k in range(wide.n_joint):
        ends = []
        for step in (1e-4, -1e-4):
            moved = lane.copy()
            moved[k] += step
            own = moved[: len(wide.states)]
            ends.append(plant.predict(moved, u, dt)[0] - own)
        difference = (ends[0] - ends[1]) / 2e-4
        assert slope[:, k] == pytest.approx(difference, rel=2e-3, abs=1e-6 * np.abs(slope).max())


def test_each_role_acts_on_its_own(plant: Built) -> None:
    """A size d counts as d more of a factor, d more of an input, and 1 + d times or d more of a reading."""
    spec = plant.spec
    wide, lane, d = spec.slotted, correlated(plant.plain), 0.3
    u, size = np.full(len(spec.inputs), 0.7), wide.slot_slice.start

    def read(roles: dict[str, FloatArray], given: FloatArray = u, lane: FloatArray = lane) -> tuple[FloatArray, ...]:
        numbers = with_roles(spec, lane, **roles)
        numbers[size] = d
        return plant.predict(numbers, given, 0.02)[0], plant.measure(numbers, given)[0]

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
        plant.slot.advance(with_roles(spec, correlated(plant.plain), **roles)[:, None], sample)[1][0, :, 0]
        for roles in ({}, {"noise": times})
    )
    n_y = len(spec.outputs)
    assert noisy[:n_y] == pytest.approx(plain[:n_y], rel=1e-14)
    assert noisy[n_y:] - plain[n_y:] == pytest.approx((times - 1.0) * spec.output_noise**2, rel=1e-6)
    sample[:, spec.sample_fields["scale"]] = spec.thresholds.blank_factor
    one, other = (
        plant.slot.advance(with_roles(spec, correlated(plant.plain), **roles)[:, None], sample)[1][0, :, 0]
        for roles in ({}, {"noise": times})
    )
    assert np.array_equal(one, other)  # so that a lane of noise does not count what says nothing


def test_what_the_slot_adds_stays_in_the_range(plant: Built) -> None:
    """A size that takes a parameter out of its range acts as one that takes it to the end of its range."""
    spec = plant.spec
    size, u = spec.slotted.slot_slice.start, np.full(len(spec.inputs), 0.7)
    for k, item in enumerate(spec.parameters):
        for end, far in ((item.lower, -1e6), (item.upper, 1e6)):
            if not np.isfinite(end):
                continue
            lane = with_roles(spec, correlated(plant.plain), theta=np.eye(len(spec.parameters))[k])
            ends = []
            for value in (far, end - item.healthy):
                lane[size] = value
                ends.append(plant.predict(lane, u, 0.02)[0])
            assert ends[0] == pytest.approx(ends[1], rel=1e-9)
