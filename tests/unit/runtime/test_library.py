"""The compiled engine with several threads."""

import numpy as np
import pytest

from faultbond.runtime import library
from faultbond.runtime.library import LANES, CompiledEngine
from faultbond.runtime.monitor import step
from faultbond.runtime.state import init
from made import plant, recorded

GRAPH, SPEC, ENGINE = plant("dc_motor")


@pytest.mark.skipif(not isinstance(ENGINE, CompiledEngine), reason="no C compiler on this machine")
@pytest.mark.parametrize("n_lanes", [1, LANES, 2 * LANES + 1, 5 * LANES - 1])
@pytest.mark.parametrize("processors", [2, 3, 16])
def test_threads_give_the_same_numbers(n_lanes: int, processors: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However the lanes are shared out, every bit is as from one thread; no thread is without a lane."""
    state = init(SPEC)
    for sample in recorded("dc_motor", 60):
        state, _ = step(SPEC, ENGINE, state, sample)
    lanes = np.repeat(state.healthy.lane, n_lanes, axis=1)
    lanes[SPEC.parameter_slice] *= np.linspace(0.5, 2.0, n_lanes)
    lanes[0, n_lanes // 2] = np.nan
    rows = state.past.samples[state.past.place(20) :][:20]
    following, innovations = ENGINE.advance(lanes, rows)
    parts: list[int] = []
    alone = CompiledEngine._advance

    def counted(self: CompiledEngine, *given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts.append(given[1].shape[1])
        return alone(self, *given)

    monkeypatch.setattr(library, "WORTH", 1)
    monkeypatch.setattr(library, "_processors", lambda: processors)
    monkeypatch.setattr(CompiledEngine, "_advance", counted)
    threaded = ENGINE.advance(lanes, rows)
    assert len(parts) == min(processors, -(-n_lanes // LANES))
    assert min(parts) >= 1
    assert np.array_equal(threaded[0], following, equal_nan=True)
    assert np.array_equal(threaded[1], innovations, equal_nan=True)
