"""The likelihood of innovations, its slopes, and the tests of what is left."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app.likelihood import begun_likelihood, likelihood_engine
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.errors import ModelError, RecordingError
from faultbond.fit import objective
from faultbond.fit.evidence import all_known, evidence_of, likelihoods, tempered
from faultbond.fit.objective import (
    FitPoint,
    FittedPlant,
    evaluate_likelihood,
    follow_alone,
    likelihood_value,
    score_recordings,
)
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.session import build_fit, free_parameters
from faultbond.fit.unknowns import unknowns_of
from faultbond.fit.whiteness import test_whiteness as whiteness_of
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_engine, build_model

RC = """
name: rc
sample_time: 0.1 s
inputs: {V: {unit: V, noise: 0.2 V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 ohm}}
  C: {type: C, parameters: {C: 50 mF}, start: {q: 0.1 C, sd: 0.02 C}}
junctions: {loop: 1}
bonds: [source -> loop -> R, loop -> C]
sensors: {v: {reads: C.e, unit: V, noise: 0.1 V}, i: {reads: loop.f, unit: A, noise: 0.05 A}}
slow_error: {v: 0.3 V over 2 s}
"""
AFTER = RC.replace("0.3 V over 2 s", "{size: 0.3 V over 2 s, after: [V], each: 0.4 V/V}")


def recording(n: int = 60, seed: int = 1) -> list[Sample]:
    """Give grid points with steps of the input, noise for readings, and two values missing."""
    rng = np.random.default_rng(seed)
    points = []
    for k in range(n):
        y = np.array([2.0, 0.1]) + 0.3 * rng.standard_normal(2)
        if k in (7, 20):
            y[k % 2] = np.nan
        points.append(Sample(time=0.1 * k, dt=0.1 if k else 0.0, u=np.array([3.0 * (k % 20 < 10)]), y=y))
    return points


def prepared(text: str, points: list[Sample]) -> tuple[FittedPlant, tuple[HealthyRecording, ...], FitPoint]:
    """Give what a fit needs, from a model text and a recording."""
    graph = parse_model(text)
    model = build_model(graph)
    core = build_engine(graph)[1]
    return build_fit(model, likelihood_engine(model), core, [("made", points)], free_parameters(graph))


def test_filters_at_once_are_those_of_each_alone() -> None:
    """Whatever the number, also one that fills no register; each from its own start."""
    plant, (record,), point = prepared(RC, recording())
    begun = plant.lanes(plant.unknowns.fill(plant.base, point.values)[0][None], point.starts[:1])
    many = np.repeat(begun, 19, axis=1)
    many[0] *= np.linspace(0.5, 2.0, 19)
    ends, seen = plant.engine.advance(many, record.samples)
    for k in range(19):
        end, alone = plant.engine.advance(many[:, k : k + 1], record.samples)
        assert np.array_equal(ends[:, k], end[:, 0])
        assert np.array_equal(seen[:, :, k], alone[:, :, 0])
    assert len(np.unique(ends[0])) == 19


def test_a_search_takes_a_step_in_half_as_many_parts() -> None:
    """Of a circuit that is quicker than its samples that changes the likelihood, and by less than a nat."""
    quick = RC.replace("R: 10 ohm", "R: 1 ohm")
    plant, records, point = prepared(quick, recording())
    model = build_model(parse_model(quick))
    assert model.substeps == 8
    all_parts, half = (begun_likelihood(model, fewer)() for fewer in (1, 2))
    fine, same, coarse = (
        likelihood_value(replace(plant, engine=engine), records, point) for engine in (plant.engine, all_parts, half)
    )
    assert fine == same
    assert 0.0 < abs(coarse - fine) < 1.0


def dense_likelihood(points: list[Sample], each: float) -> float:
    """Give the likelihood of the readings of `RC` from their joint normal distribution, without a filter.

    each : by how much the slow error is larger for each volt by which V moves
    """
    r, c, h, n = 10.0, 0.05, 0.1, len(points)
    pole = -1.0 / (r * c)
    gamma = 1.0 - 1.0 / np.sqrt(2.0)
    z = pole * h
    k1, scale = 1.0 / (1.0 - gamma * z), z / (1.0 - gamma * z)
    a = 1.0 + 1.5 * scale + 0.5 * (scale * (1.0 + scale) - 2.0 * k1 * scale)  # ROS2 on a linear plant
    b = 1.0 - a  # at rest the voltage is that of the source
    # unknowns: start, slow error s_0..s_n-1 as driven by white noise, input noise w_0..w_n-1
    size = 1 + 2 * n
    x, x_mean = np.zeros((n, size)), np.zeros(n)
    x[0, 0], x_mean[0] = 0.02 / c, 0.1 / c
    slow, decay, felt = np.zeros((n, size)), np.exp(-h / 2.0), 0.0
    slow[0, 1] = 0.3
    for k in range(1, n):
        x[k], x_mean[k] = a * x[k - 1], a * x_mean[k - 1] + b * points[k - 1].u[0]
        x[k, 1 + n + k - 1] += b * 0.2
        slow[k] = decay * slow[k - 1]
        felt = decay * felt + points[k].u[0] - points[k - 1].u[0]
        slow[k, 1 + k] = np.hypot(0.3, each * felt) * np.sqrt(1.0 - decay**2)
    current = -x / r
    for k in range(n):
        current[k, 1 + n + k] += 0.2 / r
    current_mean = (np.array([p.u[0] for p in points]) - x_mean) / r
    rows = np.concatenate([x + slow, current])
    mean = np.concatenate([x_mean, current_mean])
    noise = np.concatenate([np.full(n, 0.1), np.full(n, 0.05)])
    y = np.concatenate([[p.y[j] for p in points] for j in (0, 1)])
    here = np.isfinite(y)
    covariance = (rows @ rows.T + np.diag(noise**2))[np.ix_(here, here)]
    off = (y - mean)[here]
    _, log_det = np.linalg.slogdet(2.0 * np.pi * covariance)
    return float(-0.5 * (off @ np.linalg.solve(covariance, off) + log_det))


@pytest.mark.parametrize(("text", "each"), [(RC, 0.0), (AFTER, 0.4)])
def test_the_likelihood_is_that_of_the_joint_distribution(text: str, each: float) -> None:
    """Innovations one by one give the density of all readings, with input noise, slow error and missing values.

    Also of a slow error that is larger after the input has moved.
    """
    points = recording()
    plant, records, begin = prepared(text, points)
    assert evaluate_likelihood(plant, records, begin).value == pytest.approx(dense_likelihood(points, each), rel=1e-9)


def test_the_score_is_the_slope() -> None:
    """The score is the derivative of the likelihood, also by start, noise, memories and what follows moves.

    Where it is not large it is off by less than a thousandth of what scatters it, so that a fit ends within as much of
    a standard error; elsewhere by little of it.
    """
    text = AFTER.replace(", start: {q: 0.1 C, sd: 0.02 C}", "")
    plant, records, begin = prepared(text, recording())
    old, layout = plant.unknowns, plant.layout
    places = [*old.places[old.n_theta :].tolist(), layout.first_memory, layout.first_each]
    parameters = tuple(zip(old.places.tolist(), old.parameters, strict=False))
    plant = replace(plant, unknowns=unknowns_of(layout, plant.base, parameters, tuple(places)))
    begin = replace(begin, values=plant.unknowns.nominal)
    found = evaluate_likelihood(plant, records, begin)
    for k in range(len(found.score)):
        values = []
        for sign in (1.0, -1.0):
            move = np.zeros(len(found.score))
            move[k] = sign * 1e-5
            n = len(begin.values)
            there = replace(
                begin, values=begin.values + move[:n], starts=begin.starts + (move[n:] * begin.sizes.ravel())
            )
            values.append(evaluate_likelihood(plant, records, there).value)
        off = found.score[k] - (values[0] - values[1]) / 2e-5
        assert abs(off) < 1e-3 * np.sqrt(found.information[k, k]) + 1e-4 * abs(found.score[k])


@pytest.mark.parametrize("keep", [False, True])
def test_what_a_start_does_is_followed_as_long_as_it_shows(keep: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lane that has come back to the first is left out, and slopes are those of all lanes to the end."""
    plant, records, begin = prepared(RC.replace(", start: {q: 0.1 C, sd: 0.02 C}", ""), recording(900))
    widths: list[int] = []

    def advance(lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        widths.append(lanes.shape[1])
        return plant.engine.advance(lanes, samples)

    watched = replace(plant, engine=cast("Any", SimpleNamespace(advance=advance)))

    def scored() -> tuple[FloatArray, FloatArray]:
        (found,) = score_recordings(watched, records, begin)
        whole = evaluate_likelihood(watched, records, begin)
        return (found.scores, found.information) if keep else (whole.score, whole.information)

    score, information = scored()
    assert widths[-1] == widths[0] - 1 == 1 + len(begin.values)
    monkeypatch.setattr(objective, "BACK", float("nan"))
    widths.clear()
    whole, known = scored()
    assert set(widths) == {2 + len(begin.values)}
    assert score == pytest.approx(whole, abs=1e-6 * float(np.sqrt(known[-1, -1])))
    assert np.any(score[..., -1] != whole[..., -1])
    np.testing.assert_allclose(information, known, rtol=1e-9, atol=1e-9 * float(known[-1, -1]))


@pytest.mark.parametrize("own", [False, True])
def test_what_is_no_start_is_followed_to_the_end(own: bool) -> None:
    """A gain does nothing while its input is 0, and much later on; the same where each recording has its own."""
    text = RC.replace("law: e = V", "law: e = K*V, parameters: {K: 1}").replace(", noise: 0.2 V", "")
    text = text.replace(", start: {q: 0.1 C, sd: 0.02 C}", "")
    points = [replace(item, u=item.u * (k >= 400)) for k, item in enumerate(recording(900))]
    plant, records, begin = prepared(text, points)
    gain = [item.name for item in plant.unknowns.parameters].index("K")
    place = gain
    if own:
        place = -1
        plant = replace(plant, own=((int(plant.unknowns.places[gain]), 0.1),))
        begin = replace(begin, starts=np.array([[0.1, 1.0]]), sizes=np.array([[0.02, 0.1]]))
    (found,) = score_recordings(plant, records, begin)
    assert not np.any(found.scores[:400, place])
    assert np.count_nonzero(found.scores[401:, place]) > 490


def test_a_start_in_a_tiny_unit_is_not_lost_in_rounding() -> None:
    """What a recording says of its start is the same in any unit, be that a part in 1e15 of where it is."""
    plant, records, begin = prepared(RC.replace(", start: {q: 0.1 C, sd: 0.02 C}", ""), recording())
    begin = replace(begin, starts=np.full((1, 1), 3e3))
    usual, tiny = (
        evaluate_likelihood(plant, records, replace(begin, sizes=np.full((1, 1), size))).score[-1] / size
        for size in (1.0, 3e-12)
    )
    assert tiny == pytest.approx(usual, rel=1e-3)


def test_what_a_sensor_would_show_is_told_where_it_reads_as_stated() -> None:
    """Of one with `valid_when` too, as of the same one without; it was told as nothing at all, in kelvin."""
    points = recording(200)
    plain, records, begin = prepared(RC, points)
    text = RC.replace("unit: V, noise: 0.1 V}", "unit: V, noise: 0.1 V, valid_when: {when: V > 1, settling: 0.3 s}}")
    plant, held, there = prepared(text, points)
    expected, found = follow_alone(plain, records[0], begin, 0), follow_alone(plant, held[0], there, 0)
    use = held[0].use
    assert 20 < use[:, 0].sum() < 120
    np.testing.assert_allclose(found[use], expected[use], rtol=1e-7)
    assert np.isnan(found[~use]).all()
    assert np.abs(expected[use]).max() > 1.0


def test_the_height_alone_is_that_with_slopes() -> None:
    """A search that asks for it first takes the same way; a plant that runs away has none."""
    plant, records, begin = prepared(RC, recording())
    assert likelihood_value(plant, records, begin) == evaluate_likelihood(plant, records, begin).value
    away = replace(begin, values=np.full_like(begin.values, np.nan))
    assert likelihood_value(plant, records, away) == -np.inf


def test_where_nothing_is_sought_there_is_the_value_alone() -> None:
    """A plant of which all is known, also where it starts, has the same likelihood, and nothing to climb along."""
    plant, records, begin = prepared(RC, recording())
    known = all_known(plant, plant.unknowns.fill(plant.base, begin.values)[0])
    found = evaluate_likelihood(known, records, replace(begin, values=np.zeros(0)))
    assert found.value == evaluate_likelihood(plant, records, begin).value
    assert found.score.shape == (0,)


def test_scores_of_samples_add_up() -> None:
    """The score is the sum of those of the samples, the value that of the parts of the recording."""
    plant, records, begin = prepared(RC, recording())
    found, parts = evaluate_likelihood(plant, records, begin), score_recordings(plant, records[:1], begin)[0]
    assert parts.scores.sum(axis=0) == pytest.approx(found.score)
    assert np.isnan(parts.innovations[7, 1])
    assert np.isnan(parts.innovations[20, 0])
    assert np.isfinite(parts.innovations).sum() == 2 * 60 - 2


def test_a_plant_without_a_course_says_so_of_all_samples() -> None:
    """Where values give it none there is no likelihood, and of no sample an innovation."""
    plant, records, begin = prepared(RC, recording())
    lost = score_recordings(plant, records[:1], replace(begin, values=np.full_like(begin.values, np.nan)))[0]
    assert lost.value == -np.inf
    assert lost.innovations.shape == lost.variances.shape == records[0].y.shape
    assert lost.scores.shape == (len(records[0].time), lost.information.shape[0])
    assert not np.isfinite(lost.innovations).any()


def test_a_reading_that_feels_an_absent_input_is_not_used() -> None:
    """While the voltage is missing the current, which feels it at once, does not count; that of the capacitor does."""
    points = [replace(item, u=np.full(1, np.nan)) if 30 <= k < 34 else item for k, item in enumerate(recording())]
    _, (record,), _ = prepared(RC, points)
    assert record.u[29:34, 0].tolist() == [points[29].u[0]] * 5
    assert np.flatnonzero(~record.use[:, 0]).tolist() == [20]
    assert np.flatnonzero(~record.use[:, 1]).tolist() == [7, 30, 31, 32, 33]


def test_white_noise_is_white_and_a_walk_is_not() -> None:
    """The test keeps white noise with gaps, and refuses what is correlated."""
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(400)
    noise[::7] = np.nan
    white = whiteness_of("y", [noise[:200], noise[200:]])
    assert white.white
    smooth = np.convolve(rng.standard_normal(401), [1.0, 1.0], mode="valid")
    coloured = whiteness_of("y", [smooth])
    assert not coloured.white
    assert coloured.correlation[0] == pytest.approx(0.5, abs=0.1)
    assert "slow" in coloured.words


def test_too_little_is_not_judged() -> None:
    """Three readings say nothing about whiteness."""
    found = whiteness_of("y", [np.array([1.0, -1.0, 2.0])])
    assert np.isnan(found.p)
    assert "too few" in found.words


def test_a_sensor_without_values_is_refused() -> None:
    """A recording without a value of a sensor names the sensor."""
    points = [replace(item, y=np.array([1.0, np.nan])) for item in recording()]
    with pytest.raises(RecordingError, match="no row has a value of the sensor i"):
        prepared(RC, points)


@pytest.mark.parametrize(
    ("fixed", "free", "match"),
    [(("X",), None, "no parameter `X`"), (("R",), ("R",), "both fixed and free"), ((), ("r",), "did you mean `R`")],
)
def test_names_that_make_no_sense(fixed: tuple[str, ...], free: tuple[str, ...] | None, match: str) -> None:
    """Names of parameters are checked."""
    with pytest.raises(ModelError, match=match):
        free_parameters(parse_model(RC), fixed, free)


def test_many_ways_to_declare_are_told_in_order() -> None:
    """However many there are, each has the likelihood of a filter that follows it alone."""
    plant, records, begin = prepared(RC, recording())
    _, more, _ = prepared(RC, recording(90, seed=2))
    records, starts = (*records, *more), np.concatenate([begin.starts, begin.starts])
    declared = np.tile(plant.base, (150, 1))
    declared[:, 0] *= np.linspace(0.5, 2.0, len(declared))
    declared[:, plant.layout.first_noise] += np.linspace(1.0, -1.0, len(declared))
    found = likelihoods(plant, records, starts, declared)
    point = FitPoint(values=np.zeros(0), starts=starts, sizes=np.ones_like(starts))
    alone = [evidence_of(score_recordings(all_known(plant, q), records, point)) for q in declared]
    assert found == pytest.approx(alone, rel=1e-9)
    assert len(set(found)) == len(declared)


def test_each_recording_has_its_own_start() -> None:
    """What several recordings say is the sum of what each says from where it begins."""
    text = RC.replace(", start: {q: 0.1 C, sd: 0.02 C}", "")
    plant, first, begin = prepared(text, recording())
    _, second, other = prepared(text, recording(90, seed=2))
    both = replace(
        begin, starts=np.concatenate([begin.starts, other.starts + 0.02]), sizes=np.tile(begin.sizes, (2, 1))
    )
    alone = replace(begin, starts=both.starts[1:])
    records = (*first, *second)
    parts = [evaluate_likelihood(plant, first, begin), evaluate_likelihood(plant, second, alone)]
    assert evaluate_likelihood(plant, records, both).value == pytest.approx(sum(item.value for item in parts))
    assert likelihood_value(plant, records, both) == pytest.approx(sum(item.value for item in parts))
    scored = score_recordings(plant, records, both)
    assert [item.value for item in scored] == pytest.approx([item.value for item in parts])
    assert parts[1].value != pytest.approx(evaluate_likelihood(plant, second, begin).value)


def test_few_readings_that_lie_far_off_do_not_decide() -> None:
    """Up to five sd a square counts as it is; beyond, smoothly, as its logarithm grows, never less than a nearer."""
    near = np.linspace(0.0, 25.0, 50)
    assert tempered(near).tolist() == near.tolist()
    far = np.geomspace(25.0, 1e12, 400)
    assert (np.diff(tempered(far)) > 0.0).all()
    assert float(np.diff(tempered(np.array([25.0, 25.001])))[0]) == pytest.approx(0.001, rel=1e-3)
    assert float(tempered(np.array([1e6]))[0]) == pytest.approx(25.0 * (1.0 + np.log(4e4)))


def test_evidence_is_the_likelihood_where_nothing_lies_far_off() -> None:
    """And none where the plant has no course."""
    plant, records, begin = prepared(RC, recording())
    q = plant.base.copy()
    q[plant.layout.first_noise : plant.layout.first_noise + 2] += np.log(20.0)
    found = score_recordings(all_known(plant, q), records, replace(begin, values=np.zeros(0)))
    assert max(float(np.nanmax(np.abs(item.standardised))) for item in found) < 5.0
    assert evidence_of(found) == pytest.approx(sum(item.value for item in found), rel=1e-12)
    assert evidence_of([replace(found[0], value=-np.inf)]) == -np.inf
