"""An asset: what it remembers follows from its log, wherever that was cut, and whatever a person did in between."""

import io
import json
import sys
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from faultbond.app.plant import find_plant
from faultbond.app.wishes import Wanted
from faultbond.cli import main
from faultbond.contract.samples import Status
from faultbond.errors import FaultbondError, StoreError
from faultbond.io.row_block import RowBlock
from faultbond.runtime.names import candidate_names, find_hypothesis
from faultbond.service.alarm import AlarmState
from faultbond.service.asset import MOST_UNDOS, Asset
from faultbond.service.asset_status import asset_status
from faultbond.service.contract.messages import Action, NamedRecord
from faultbond.service.shown import summary_of
from faultbond.service.web.shapes import SummaryShape
from loop_asset import FOUND, MODEL, RECORDING, deed, plant, rows


def passed(asset: Asset, block: RowBlock, cuts: Iterable[int] = ()) -> list[NamedRecord]:
    """Pass rows in portions; gives the records."""
    portions = [block.part(slice(a, b)) for a, b in pairwise([0, *cuts, len(block)])]
    return [told for portion in portions for told in asset.take(portion).records]


def test_it_says_what_run_says(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Alarm and diagnoses are those of `faultbond run -`, with names that each come once."""
    told = passed(Asset("loop", plant()), rows(), cuts=range(7, 3000, 97))
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(RECORDING.read_bytes())))
    main(["run", str(MODEL), "-"])
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    ours = [item.content for item in told]
    theirs = [line for line in lines if line["record"] in {"detection", "diagnosis"}]
    assert ours[0]["record"] == "detection"
    assert ours == theirs[: len(ours)]
    assert len(theirs) - len(ours) <= 1  # the last one, before the end
    assert len({item.id for item in told}) == len(told)


@pytest.mark.parametrize("seed", range(3))
def test_a_checkpoint_and_the_rows_behind_it_give_the_same(seed: int) -> None:
    """Cut anywhere, restored from the checkpoint there, it tells the same records, by the same names."""
    block, rng = rows(), np.random.default_rng(seed)
    whole = passed(Asset("loop", plant()), block)
    found = next(item.sample for item in whole if item.kind == "detection")
    cut = int(rng.integers(found - 30, found + 120))
    first = Asset("loop", plant())
    before = passed(first, block.part(slice(cut)))
    kept = first.checkpoint()
    assert kept is not None
    second = Asset("loop", plant(), kept)
    assert (second.alarm, second.detection) == (first.alarm, first.detection)
    behind = passed(second, block.part(slice(cut, None)))
    assert [(item.id, item.content) for item in before + behind] == [(item.id, item.content) for item in whole]


def test_rows_that_begin_once_more_are_watched_from_a_checkpoint_too() -> None:
    """A file that was written anew, with the very first row of before: none is lost, whatever the service did since."""
    block = rows().part(slice(400))
    whole, first = Asset("loop", plant()), Asset("loop", plant())
    for asset in (whole, first):
        asset.take(block)
    kept = first.checkpoint()
    assert kept is not None
    second = Asset("loop", plant(), kept)
    for asset in (whole, second):
        asset.take(block)
    assert (second.counts, second.time) == (whole.counts, whole.time)
    assert (second.counts.samples, second.counts.duplicate, second.counts.clock_jumps) == (800, 0, 1)


def test_a_decision_is_kept_and_can_be_taken_back_until_the_next_alarm() -> None:
    """Accepting ends the alarm; what it was before is kept with every checkpoint since, and is what it was."""
    asset = Asset("loop", plant())
    found = next(item.sample for item in passed(asset, rows().part(slice(FOUND))) if item.kind == "detection")
    assert found < FOUND
    state = asset.checkpoint()
    assert asset.diagnosis is not None
    best = asset.diagnosis.candidates[0].parameters
    done = asset.do(deed(Action.ACCEPT, *best, rows=FOUND), 3)
    assert [item.kind for item in done.records] == ["accepted"]
    assert asset.alarm.state(0.0) is AlarmState.RETURNED
    kept = asset.checkpoint()
    assert kept is not None
    (undo,) = Asset("loop", plant(), kept).undos
    assert (undo.checkpoint, undo.rows, undo.deeds) == (state, FOUND, 3)
    again = Asset("loop", plant(), undo.checkpoint)
    assert (again.alarm.active, again.undos) == (True, ())
    assert (again.status, again.time) == (Status.DIAGNOSING, rows().time[FOUND - 1])
    assert again.diagnosis is not None
    assert again.diagnosis.candidates[0].parameters == best


def test_the_latest_decisions_are_kept_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each with the state from before it, which has no other inside; of more than that the earliest goes."""
    assert MOST_UNDOS > 1
    monkeypatch.setattr("faultbond.service.asset.MOST_UNDOS", 2)
    asset = Asset("loop", plant())
    passed(asset, rows().part(slice(FOUND)))
    before, sizes = asset.checkpoint(), []
    for number, action in enumerate((Action.REJECT, Action.REJECT, Action.ACCEPT)):
        assert asset.diagnosis is not None
        asset.do(deed(action, *asset.diagnosis.candidates[0].parameters, rows=FOUND), number)
        sizes.append(len(asset.checkpoint() or b""))
    assert before is not None
    undos = Asset("loop", plant(), asset.checkpoint()).undos
    assert [undo.deeds for undo in undos] == [1, 2]
    assert all(Asset("loop", plant(), undo.checkpoint).undos == () for undo in undos)
    assert sizes[2] < 3.1 * len(before)


def test_every_candidate_can_be_decided_of() -> None:
    """What the page sends back of a candidate is that candidate, of sensors and inputs, too; so are its suspects."""
    asset = Asset("loop", plant())
    passed(asset, rows().part(slice(FOUND)))
    assert asset.diagnosis is not None
    candidates = asset.diagnosis.candidates
    assert {"V_R.noise", "V_I.gain"} <= {name for item in candidates for name in item.parameters}
    for names in ([sorted(candidate_names(item)) for item in candidates], [item.parameters for item in candidates]):
        assert [find_hypothesis(asset.spec, name) for name in names] == [item.hypothesis for item in candidates]


def test_what_is_rejected_leaves_the_others_and_says_so_at_once() -> None:
    """After a rejection the next diagnosis may be far, so that of what is left is told with it."""
    asset = Asset("loop", plant())
    passed(asset, rows().part(slice(FOUND)))
    assert asset.diagnosis is not None
    best = asset.diagnosis.candidates[0].parameters
    told = asset.do(deed(Action.REJECT, *best), 0).records
    assert [item.kind for item in told] == ["rejected", "diagnosis"]
    assert asset.diagnosis is not None
    assert asset.diagnosis.candidates[0].parameters != best
    assert asset.alarm.active


def test_what_was_put_aside_before_any_alarm_has_no_time() -> None:
    """What is shown of it is of the shape that is described, without an alarm that was never raised."""
    asset = Asset("loop", plant())
    passed(asset, rows().part(slice(50)))
    asset.do(deed(Action.OUT_OF_SERVICE, rows=50), 1)
    shown = summary_of(asset, asset_status(asset, silence=0.0), since=0.0, now=0.0)
    told = SummaryShape.model_validate(shown).alarm
    assert told is not None
    assert (told.since, told.time) == (None, None)


def test_what_cannot_be_done_is_said_in_a_line() -> None:
    """Nothing to accept, nobody named, no such candidate: the asset stays as it was."""
    asset = Asset("loop", plant())
    with pytest.raises(FaultbondError, match=r"loop: There is no alarm to explain"):
        asset.do(deed(Action.ACCEPT, "C"), 0)
    passed(asset, rows().part(slice(FOUND)))
    before = asset.checkpoint()
    with pytest.raises(FaultbondError, match=r"loop: name the suspects of the candidate to repaired|to accept"):
        asset.do(deed(Action.ACCEPT), 0)
    with pytest.raises(FaultbondError, match="Q"):
        asset.do(deed(Action.ACCEPT, "Q"), 0)
    assert asset.checkpoint() == before


@pytest.mark.parametrize("spoil", [lambda kept: kept[:3], lambda kept: kept[:200], lambda kept: b"\0" * len(kept)])
def test_a_damaged_checkpoint_is_refused(spoil: object) -> None:
    """Cut short or overwritten, none of it is believed."""
    asset = Asset("loop", plant())
    passed(asset, rows().part(slice(300)))
    kept = asset.checkpoint()
    assert kept is not None
    with pytest.raises(FaultbondError, match="loop"):
        Asset("loop", plant(), spoil(kept))  # type: ignore[operator]


def test_a_checkpoint_of_another_model_is_refused(tmp_path: Path) -> None:
    """One of a model with other numbers is not gone on from."""
    other = tmp_path / "model.yaml"
    other.write_text(MODEL.read_text().replace("20 ohm", "21 ohm"))
    asset = Asset("loop", plant())
    passed(asset, rows().part(slice(300)))
    with pytest.raises(FaultbondError, match="an earlier form of this model"):
        Asset("loop", find_plant(other, Wanted()), asset.checkpoint())


def test_store_error_is_ours() -> None:
    """A damaged header is told as a fault of the store."""
    with pytest.raises(StoreError, match="loop: its checkpoint is damaged"):
        Asset("loop", plant(), b"\x05\0\0\0hello")
