"""What the figures of speed compare with: filters that are filters, a lane that is told of its fault, shown spreads."""

import shutil

import numpy as np
import pytest
from benchmarks.shared.plants import graph_of
from benchmarks.shared.play import engine_of
from benchmarks.shared.told import told_lane
from benchmarks.shared.turns import Work, spread, turns
from benchmarks.speed import peak, peers, tank_loops

from faultbond.arrays import FloatArray
from faultbond.contract.spec import pack, unpack

N, N_OUTPUTS = 4, 2


def one_sample(x: FloatArray, p: FloatArray, reading: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """The same sample by textbook formulas in matrices."""
    transition, slopes = peers._system(N, N_OUTPUTS)
    x, p = transition @ x, transition @ p @ transition.T + 1e-4 * np.eye(N)
    s = slopes @ p @ slopes.T + np.eye(N_OUTPUTS)
    gain, off = p @ slopes.T @ np.linalg.inv(s), reading - slopes @ x
    likelihood = -0.5 * (off @ np.linalg.solve(s, off) + np.linalg.slogdet(2.0 * np.pi * s)[1])
    return x + gain @ off, p - gain @ s @ gain.T, float(likelihood)


def test_filters_in_loops_are_filters() -> None:
    """Mean, covariance and likelihood of each are those of the textbook, so they do the work that is timed."""
    generator = np.random.default_rng(3)
    x, p, likelihood = generator.normal(size=(3, N)), np.repeat(np.eye(N)[None], 3, axis=0), np.zeros(3)
    reading = np.array([1.5, -0.7])
    wanted = [one_sample(row.copy(), np.eye(N), reading) for row in x]
    peers._filters(peers._predict, peers._update, x, p, likelihood, *peers._system(N, N_OUTPUTS), reading)
    for k, (mean, covariance, said) in enumerate(wanted):
        np.testing.assert_allclose(x[k], mean, rtol=1e-12)
        np.testing.assert_allclose(p[k], covariance, rtol=1e-10, atol=1e-14)
        assert likelihood[k] == pytest.approx(said)


def test_filters_of_filterpy_are_filters() -> None:
    """After two samples a filter of theirs stands where the textbook's does, and says how likely the readings were."""
    work = peers.by_filterpy([(1, N)], N_OUTPUTS, 2)
    if work is None:
        pytest.skip("FilterPy is not installed")
    filters, (x, p, total) = work.prepare(), (np.zeros(N), np.eye(N), 0.0)
    for _ in range(2):
        x, p, said = one_sample(x, p, np.zeros(N_OUTPUTS))
        total += said
    assert work.run(filters) == pytest.approx(total)
    np.testing.assert_allclose(filters[0][0].P, p, rtol=1e-10, atol=1e-14)


def tank_lane(drifting: int | None) -> FloatArray:
    """A lane of a tank that is half known; with a slot that acts on a factor, if one is named."""
    spec, core = engine_of("tank")
    plain = core.healthy_lane(np.array([8000.0]), np.array([[1e4]]))[:, 0]
    if drifting is None:
        return plain
    wide = spec.slotted
    lane, n = np.zeros(wide.n_numbers), spec.n_joint
    full = np.zeros((n + 2, n + 2))
    full[:n, :n], full[n, n], full[n + 1, n + 1] = unpack(spec, plain[spec.covariance_slice]), 0.01, 1e-6
    full[n, n + 1] = full[n + 1, n] = 2e-5
    lane[: n + 2], lane[wide.covariance_slice] = [*plain[:n], 0.05, 1e-4], pack(full)
    for name, value in (
        ("reads", 1.0),
        ("gain", 0.3),
        ("bias", 1e-6),
        ("noise", 1.2),
        ("input", 0.1),
        ("obeys", 0.9),
        ("input_gain", 0.02),
        ("moves", 1.0),
    ):
        lane[wide.role_fields[name]] = value
    lane[wide.role_fields["theta"]][drifting] = 1.0
    return lane


def tank_samples() -> FloatArray:
    """Packed samples of a tank: both readings, one of them, a gap, a blanked one; the last does not say much."""
    spec, _ = engine_of("tank")
    rows, place = np.zeros((6, spec.n_sample)), spec.sample_fields
    rows[:, place["dt"]], rows[:, place["u_before"]], rows[:, place["u"]] = 1.0, [20.0, 60.0], [25.0, 65.0]
    rows[:, place["y"]] = [1.3e-4, 8300.0]
    rows[:, place["use"]] = rows[:, place["scale"]] = rows[:, place["again"]] = 1.0
    rows[:, place["fresh"]] = spec.input_variance
    rows[:, place["bound"]], rows[:, place["nis"]] = 20.0, [1.5, 0.0]
    rows[1, place["use"]] = [0.0, 1.0]
    rows[2, place["gap"]], rows[2, place["kick"]] = 50.0, 1e-5
    rows[3, place["scale"]], rows[5, place["scale"]] = [1e5, 2.0], 1e3
    return rows


@pytest.mark.parametrize("drifting", [None, 0, 4, 6])
def test_loops_for_the_tank_do_the_work_of_the_core(drifting: int | None) -> None:
    """Mean, covariance and likelihood are those of the compiled filters, of plain lanes and of those with a slot."""
    spec, core = engine_of("tank")
    lane, rows = tank_lane(drifting), tank_samples()
    plain = drifting is None
    kind, engine = (spec, core) if plain else (spec.slotted, core.slot)
    banks = tank_loops.banks(spec, [lane])
    tank_loops.run(rows, banks)
    x, p, _, likelihood = (item[0] for item in banks[0 if plain else 1])
    wanted = engine.advance(lane[:, None], rows)[0][:, 0]
    full = unpack(kind, wanted[kind.covariance_slice])
    sd = np.sqrt(np.diag(full))
    np.testing.assert_allclose(x, wanted[: kind.n_joint], rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(p / np.outer(sd, sd), full / np.outer(sd, sd), atol=1e-7)
    assert likelihood == pytest.approx(wanted[-1], rel=1e-9)


@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
@pytest.mark.parametrize("drifting", [None, 2])
def test_filters_that_count_are_the_filters(drifting: int | None) -> None:
    """What counts operations gives the lane of the core; a sample that says little takes fewer of them."""
    spec, core = engine_of("tank")
    lane, rows = tank_lane(drifting), tank_samples()
    with peak.counting(graph_of("tank"), spec) as count:
        counts, after = count(lane, rows[0])
        fewer, _ = count(lane, rows[5])
    wanted = (core if drifting is None else core.slot).advance(lane[:, None], rows[:1])[0][:, 0]
    np.testing.assert_allclose(after, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max() * 1e-12)
    assert 500 < fewer < counts < 5000


def test_the_text_of_lanes_reads_as_the_counting_one_expects() -> None:
    """One line of `lanes.h` makes a lane a number; in its place stands the number that counts."""
    assert peak.LANES_H.read_text(encoding="utf-8").count(peak.LANES_OF) == 1


@pytest.mark.parametrize("kept", [False, True])
def test_a_lane_that_is_told_of_a_capacitor(kept: bool) -> None:
    """C is as told; a charge that stays moves the voltage, as uncertain as C makes it; else nothing moves."""
    spec, core = engine_of("rlc")
    k = spec.parameter_slice.start + [item.name for item in spec.parameters].index("C")
    (state,) = (i for i, item in enumerate(spec.states) if any(spec.parameters[j].name == "C" for j, _ in item.jumps))
    mean = np.arange(1.0, 1.0 + len(spec.states))
    healthy = core.healthy_lane(mean, 0.01 * np.eye(len(mean)))[:, 0]
    lane = told_lane(spec, healthy, "C", 2.0, 0.1, kept=kept)[:, 0]
    before, after = (unpack(spec, item[spec.covariance_slice]) for item in (healthy, lane))
    assert lane[k] == pytest.approx(2.0 * healthy[k])
    assert after[k, k] == pytest.approx((0.1 * healthy[k]) ** 2)
    assert lane[state] == pytest.approx(healthy[state] * (0.5 if kept else 1.0))
    slope = -lane[state] / lane[k] if kept else 0.0
    assert after[state, k] == pytest.approx(slope * after[k, k])
    if not kept:
        assert after[state, state] == before[state, state]
    rest = np.delete(np.arange(spec.n_joint), [state, k])
    np.testing.assert_array_equal(after[np.ix_(rest, rest)], before[np.ix_(rest, rest)])


def test_works_take_turns_on_what_was_prepared_for_them() -> None:
    """Each turn prepares anew; the first does not count; a time is that of one unit."""
    seen: list[str] = []

    def work(name: str, count: int) -> Work:
        return Work(prepare=lambda: [name], run=lambda given: seen.append(given.pop()), count=count)

    times = turns([work("a", 1), work("b", 10)], 3)
    assert seen == ["a", "b"] * 4
    assert times.shape == (3, 2)
    assert spread(np.array([1.0, 2.0, 3.0, 4.0, 5.0]), ".1f", 10.0) == "30.0 (20.0 to 40.0)"
