"""States that only follow, as a start is searched, are those of the filter while nothing is measured."""

import ctypes

import numpy as np
import pytest

from bare_core import Bare, at, bare

TEXT = """
name: rig
sample_time: 0.5 s
max_faults: 1
constants: {C1: 0.1 F, one: 1 V, off: 0.5}
inputs: {V: {unit: V HOLD}, W: {unit: A, noise: 5 mA}, on: {}}
components:
  source: {type: Se, law: e = V}
  more: {type: Sf, law: f = W}
  series: {type: R, LAW}
  cell: {type: C, law: e = q/C1}
  leak: {type: R, law: f = G*e, parameters: {G: {nominal: 0.02 S, range: [0.01 S, 0.021 S]}}}
junctions: {first: 1, node: 0}
bonds: [source -> first, first -> series, first -> node, node -> cell, node -> leak, more -> node]
sensors:
  i: {reads: first.f, unit: A, noise: 5 mA, lag: 2 s, valid_when: on > off}
  v: {reads: node.e, unit: V, noise: 10 mV}
slow_error: {first.f: 1 % over 20 s, v: 5 mV over 6 s}
"""
CURVED = "law: 'f = e*abs(e)/(R1*one)', parameters: {R1: 10 ohm}"
LOOP = "law: 'e = R1*f + one*tanh(f/W0)', parameters: {R1: 10 ohm, W0: 1 A}"
STRAIGHT = "parameters: {R1: 10 ohm}"
CALLS = """
static Filters filters;
static lanes two[2][PLAIN_NUMBERS];
int64_t t_run(int64_t follows, const double *sample, const double *begin, double *z, double *told)
{
    lanes *lane = two[follows];
    if (begin) {
        prepare_filters(&filters);
        for (int i = 0; i < PLAIN_NUMBERS; i++) lane[i] = broadcast(begin[i]);
    }
    if (follows) filter_follow_plain(lane, sample, filters.plain.innovations, &filters.plain);
    else filter_step_plain(lane, sample, filters.plain.innovations, &filters.plain);
    for (int i = 0; i < PLAIN_JOINT; i++) z[i] = first_of(lane[i]);
    for (int k = 0; k < N_IMPLICIT; k++) z[PLAIN_JOINT + k] = first_of(lane[PLAIN_IMPLICIT + k]);
    for (int j = 0; j < N_OUTPUTS; j++) told[j] = first_of(filters.plain.innovations[j]);
    return N_IMPLICIT;
}
"""


def run(core: Bare, follows: int, samples: np.ndarray, lane: np.ndarray) -> np.ndarray:
    """Give z, implicit signals and innovations after each sample, (n_samples, n)."""
    n_told, n_z = len(core.spec.outputs), core.spec.n_joint + 8
    found = np.zeros((len(samples), n_z + n_told))
    for k, sample in enumerate(samples):
        begin = lane if k == 0 else None
        core.library.t_run(ctypes.c_int64(follows), at(sample), at(begin), at(found[k, :n_z]), at(found[k, n_z:]))
    return found


@pytest.mark.parametrize("law", [CURVED, LOOP, STRAIGHT])
@pytest.mark.parametrize("hold", ["", ", hold: linear"])
def test_following_is_filtering_without_readings(law: str, hold: str) -> None:
    """States, slow errors, input noise, lags that are held, parameters at their ends, and what is expected."""
    core = bare(CALLS, TEXT.replace("LAW", law).replace(" HOLD", hold))
    spec, draw = core.spec, np.random.default_rng(4)
    places, samples = spec.sample_fields, np.zeros((12, spec.n_sample))
    for name, values in (("dt", 0.5), ("scale", 1.0), ("bound", 0.0)):
        samples[:, places[name]] = values
    samples[5:, places["dt"]] = 0.25
    samples[:, places["u"]] = draw.uniform(0.5, 2.0, (12, 3))
    samples[1:, places["u_before"]], samples[0, places["u_before"]] = samples[:-1, places["u"]], samples[0, places["u"]]
    samples[:, places["y"]] = draw.normal(size=(12, 2))
    samples[:, places["fade"]] = 0.8
    samples[3:6, places["held"]] = 1.0
    samples[8, places["still"]] = 1.0
    lane = np.zeros(spec.n_numbers)
    lane[: spec.n_joint] = draw.uniform(0.1, 0.4, spec.n_joint)
    lane[spec.parameter_slice] = [item.healthy for item in spec.parameters]
    lane[spec.parameter_slice.start + [item.name for item in spec.parameters].index("G")] *= 1.2  # beyond its range
    one, other = (run(core, k, samples, lane) for k in (0, 1))
    assert np.isfinite(one).all()
    assert np.abs(np.diff(one, axis=0)).max(axis=0)[: len(spec.states)].min() > 1e-3  # all states move
    np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-14)
