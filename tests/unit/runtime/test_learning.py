"""What the healthy filter and the bank learn from a sample: the engine is asked differently for each."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime import monitor
from faultbond.runtime.bank import Bank
from faultbond.runtime.state import State
from faultbond.runtime.trail import Trail
from faultbond.simulate import Fault
from made import plant, recorded, run

FAULT = Fault(parameter="R", factor=2.0, start=2.4)


@dataclass(frozen=True)
class Recorder:
    """An engine that keeps what it was asked: (number of lanes, samples), apart for lanes with a slot."""

    inner: Engine
    calls: list[tuple[int, FloatArray]] = field(default_factory=list)
    slot_calls: list[tuple[int, FloatArray]] = field(default_factory=list)

    @property
    def title(self) -> str:
        """What it is."""
        return "recorder"

    @property
    def slot(self) -> "Recorder":
        """A recorder of lanes with a slot."""
        return Recorder(self.inner.slot, self.slot_calls)

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Keep and pass on."""
        self.calls.append((lanes.shape[1], samples.copy()))
        return self.inner.advance(lanes, samples)


def asked(rows: int) -> tuple[EngineSpec, State, Recorder]:
    """Run a motor with a fault; give what the engine was asked."""
    _, spec, engine = plant("dc_motor")
    recorder = Recorder(engine)
    state, _ = run(spec, recorder, recorded("dc_motor", rows, FAULT))
    assert state.clock.alarm >= 0
    return spec, state, recorder


def test_bank_linearises_twice_with_a_wide_bound() -> None:
    """Every sample that lanes of the bank see asks for a second update and bounds only innovations nothing explains."""
    spec, _, recorder = asked(300)
    place = spec.sample_fields
    steps = [samples for lanes, samples in recorder.calls if lanes == plan_lanes(spec).n_lanes]
    slots = [samples for _, samples in recorder.slot_calls]
    for bank in (steps, slots):
        assert len(bank) > 100
        assert all(np.all(samples[:, place["again"]] == 1.0) for samples in bank)
        assert all(np.all(samples[:, place["bound"]] == spec.thresholds.bank_bound) for samples in bank)
    assert spec.thresholds.bank_bound > 3.0 * spec.thresholds.learning_bound


def test_healthy_lane_linearises_once_and_is_bounded_when_warm() -> None:
    """The monitor's own lane never updates twice; its innovations are bounded once the warm-up is over."""
    spec, state, _ = asked(300)
    place = spec.sample_fields
    warm = state.clock.begun + spec.thresholds.warm_up_samples
    for index in range(state.clock.begun, state.clock.index):
        packed = state.past.samples[state.past.place(index)]
        assert packed[place["again"]] == 0.0
        assert packed[place["bound"]] == (spec.thresholds.learning_bound if index >= warm else 0.0)


def test_bank_is_renewed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bank begins again exactly at the samples that are set for it, counted from the alarm."""
    renewed, final = [], []

    def renew(
        spec: EngineSpec,
        engine: Engine,
        trail: Trail,
        bank: Bank,
        index: int,
        peak: FloatArray,
        *,
        last: bool,
    ) -> Bank:
        del spec, engine, trail, peak
        renewed.append(index)
        final.append(last)
        return bank

    monkeypatch.setattr(monitor, "renew_bank", renew)
    _, spec, engine = plant("dc_motor")
    state, _ = run(spec, engine, recorded("dc_motor", 400, FAULT))
    assert renewed == [
        state.clock.alarm + wait for wait in monitor.RENEWALS if state.clock.alarm + wait < state.clock.index
    ]
    assert final == [False, False, True]
