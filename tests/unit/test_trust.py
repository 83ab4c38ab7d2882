"""The table of trust in the benchmarks: its plants, how their rows arrive, how long one looks, its lines."""

import json
from dataclasses import asdict, replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.page import Row
from benchmarks.shared.plants import graph_of
from benchmarks.shared.play import engine_of
from benchmarks.trust import arrival as trust_arrival
from benchmarks.trust import rows as trust_rows
from benchmarks.trust import table as trust
from benchmarks.trust.calibration import claims_of, expected_claims, write_plot
from benchmarks.trust.cases import CASES, Case
from benchmarks.trust.evidence import evidence
from benchmarks.trust.plants import (
    SWING,
    Played,
    disobeyed,
    drawn,
    healthy,
    healthy_moving,
    misread,
    stepped,
)
from benchmarks.trust.play import Claim, Run, _Patience, play

from faultbond.contract.lanes import starts_of
from faultbond.contract.samples import Sample
from faultbond.runtime.monitor import Monitor
from faultbond.types import FaultKind, Method

SEED = 31
WINDING = partial(stepped, "dc_motor", (("R", 2.0),))
MOTOR = partial(healthy, "dc_motor", 60.0)


def claim(rank: int, after: float = 600.0) -> Claim:
    """Give a claim in which the true set has a rank."""
    return Claim(after=after, best=0.9, right=rank == 1, rank=rank, group=True, size=1, error=0.01, kind="step")


def run(key: str, seed: int, rank: int = 1, delay: float | None = 40.0) -> Run:
    """Give a run that says the same at each look."""
    looks = (claim(rank),) * 4 if delay is not None else ()
    return Run(
        key=key,
        folder="tank",
        seed=seed,
        delay=delay,
        early=False,
        cusum=10.0,
        unexplained=0,
        looks=looks,
        claims=looks[:1],
    )


def line(found: dict[str, list[Run]], words: str) -> Row:
    """Give the one line of a table whose figure has these words."""
    (row,) = [row for row in trust_rows.rows(found) if words in row.figure]
    return row


def test_both_valves_move_and_the_level_swings() -> None:
    """Where both valves move, the outlet steps at least every four minutes and the level passes its bounds often."""
    found = healthy_moving(SEED)
    steps = np.flatnonzero(np.diff(found.inputs[:, 1])) + 1
    assert np.diff([0, *steps, found.time.size]).max() <= 240
    side = np.where(found.outputs[:, 1] > SWING[1], 1, np.where(found.outputs[:, 1] < SWING[0], -1, 0))
    turns = np.count_nonzero(np.diff(side[side != 0]))
    assert turns >= 2 * found.time[-1] / 700.0


def test_recording_ends_where_it_is_asked_to() -> None:
    """A shorter recording of a fault is the beginning of the longer one."""
    short, long = (stepped("tank", (("K6", 8.37),), SEED, after=after) for after in (100.0, 400.0))
    assert short.time[-1] == pytest.approx(short.onset + 100.0, abs=1.0)
    assert long.outputs[: short.time.size] == pytest.approx(short.outputs, rel=1e-6)


@pytest.mark.parametrize(("kind", "gain", "offset"), [(FaultKind.GAIN, 1.15, 0.0), (FaultKind.BIAS, 1.0, -5.0 * 0.06)])
def test_sensor_reads_wrong_from_the_onset_on(kind: FaultKind, gain: float, offset: float) -> None:
    """A wrong gain scales and a bias moves what the sensor shows, from the onset on and not before."""
    right, wrong = MOTOR(SEED), misread(MOTOR, "omega", kind, SEED)
    after = right.time >= wrong.onset
    assert np.array_equal(wrong.outputs[~after], right.outputs[~after])
    assert wrong.outputs[after] == pytest.approx(gain * right.outputs[after] + offset)
    assert wrong.suspects == {"omega"}


def test_noise_grows_threefold() -> None:
    """A noisy sensor scatters by three times what the model declares."""
    wrong, right = misread(MOTOR, "omega", FaultKind.NOISE, SEED), MOTOR(SEED)
    added = (wrong.outputs - right.outputs)[right.time >= wrong.onset, 0]
    declared = graph_of("dc_motor").sensors[0].noise
    assert np.sqrt(added.var() + declared**2) == pytest.approx(3.0 * declared, rel=0.05)


def test_stuck_sensor_keeps_its_last_value() -> None:
    """A stuck sensor shows what it showed in the last row before the onset."""
    wrong = misread(MOTOR, "omega", FaultKind.STUCK, SEED)
    after = wrong.time >= wrong.onset
    assert set(wrong.outputs[after, 0]) == {wrong.outputs[~after, 0][-1]}


def test_late_rows_arrive_once_and_soon() -> None:
    """Of a hundred rows about five arrive late, none by more than five samples, and each arrives once."""
    order = np.array(trust_arrival.with_late(WINDING, 0.05, SEED).order)
    assert np.array_equal(np.sort(order), np.arange(order.size))
    behind = np.maximum.accumulate(order) - order
    assert behind.max() == trust_arrival.MOST_LATE
    assert np.count_nonzero(behind) / order.size == pytest.approx(0.05, abs=0.01)


def test_late_rows_are_awaited_live() -> None:
    """Live, rows that come late are used, but for the first seconds and where more than one is late."""
    made = trust_arrival.with_late(WINDING, 0.05, SEED)
    monitor = Monitor(engine_of("dc_motor")[1])
    samples = [sample for sample, _, _ in trust_arrival.watched(monitor, made)]
    assert [sample.time for sample in samples] == pytest.approx(made.time)
    order = np.array(made.order)
    late = {int(k) for k in order[np.maximum.accumulate(order) > order]}
    empty = {k for k, sample in enumerate(samples) if np.isnan(sample.y).all()}
    assert empty < late
    assert len(empty) < 0.25 * len(late)


def test_an_interruption_changes_nothing() -> None:
    """A run that is kept in a file before the onset and after it says what an uninterrupted one says."""
    looks = (2.0, 5.0)
    plain = play(Case(key="plain", make=WINDING, looks=looks), SEED)
    make = partial(trust_arrival.interrupted, WINDING)
    stops = make(SEED).stops
    assert stops[0] < make(SEED).onset < stops[1]
    assert plain.claims
    assert replace(play(Case(key="kept", make=make, looks=looks), SEED), key="plain") == plain


def test_each_session_begins_after_an_interruption() -> None:
    """Interruptions cut the rows where they are, and lose none."""
    made = Played(
        folder="dc_motor",
        time=np.arange(9.0),
        inputs=np.zeros((9, 1)),
        outputs=np.ones((9, 1)),
        values={},
        stops=(2, 5.5),
    )
    sessions = [[row.time for row in rows] for rows in trust_arrival._sessions(made)]
    assert [len(times) for times in sessions] == [2, 4, 3]
    assert list(chain(*sessions)) == list(made.time)


@pytest.mark.parametrize(("moves", "last"), [(70.0, 90), (20.0, 79)])
def test_last_look_waits_for_the_valves(moves: float, last: int) -> None:
    """The last look comes after the inlet was open for long enough and the outlet has settled after a step."""
    patience = _Patience(Case(key="any", make=MOTOR, looks=(10.0,), opened=30.0, settled=20.0))

    def ends(time: float) -> bool:
        u = np.array([80.0 if time >= 50.0 else 20.0, 40.0 if time < moves else 60.0])
        return patience.ends(Sample(time=time, dt=1.0, u=u, y=np.zeros(2)), 5.0)

    assert next(time for time in range(6, 200) if ends(float(time))) == last


def test_look_comes_when_it_is_due() -> None:
    """Where a case waits for nothing, the last sample is that of the last look."""
    patience = _Patience(Case(key="any", make=MOTOR, looks=(2.0, 10.0)))
    ends = [patience.ends(Sample(time=time, dt=1.0, u=np.zeros(2), y=np.zeros(2)), 5.0) for time in (14.0, 15.0)]
    assert ends == [False, True]


def test_runs_outlive_a_program_that_is_stopped(tmp_path: Path) -> None:
    """Each run is in the file as soon as it ends; a line that is cut off is left out."""
    path, kept = tmp_path / "runs", []
    runs = [run("tank.K6", 2), run("tank.K6", 1, delay=None)]
    for found in trust.keep(iter(runs), path):
        kept.append(found)
        assert len(path.read_text(encoding="utf-8").splitlines()) == len(kept)
    with path.open("a", encoding="utf-8") as stream:
        stream.write(json.dumps(asdict(runs[0]))[:-5])
    assert trust.by_case(trust.read([path])) == {"tank.K6": [runs[1], runs[0]]}


def test_each_run_is_played_once() -> None:
    """All runs of a seed are played together, and the first seeds, which have most of them, first."""
    todo = trust.jobs(["tank.healthy", "tank.K6", "tank.rough"], 4, 10, [Method.BANK])
    played = list(chain(*todo))
    assert len(played) == len(set(played)) == 12 + 4 + 2
    assert [{seed for _, seed, _ in together} for together in todo[:2]] == [{10}, {11}]
    assert len(todo) == 12


def test_methods_stand_side_by_side() -> None:
    """`classic` plays what it can find, the steps of parameters, and stands beside `bank` in the same line."""
    todo = list(chain(*trust.jobs(["tank.K6", "bias.flow"], 2, 10, list(Method))))
    assert sorted(key for key, _, method in todo if method is Method.CLASSIC) == ["tank.K6", "tank.K6"]
    bank, classic = {"tank.K6": [run("tank.K6", 1)]}, {"tank.K6": [run("tank.K6", 1, rank=3)]}
    words = "of these K6"
    (cells,) = [cells for cells in trust_rows.cells(bank, classic) if words in cells[0]]
    assert cells[2:] == ("1 of 1 (100 %)", "", "0 of 1 (0 %)")
    assert all(not cells[-1] for cells in trust_rows.cells(bank, {}))


def test_classic_watches_the_same_recording() -> None:
    """A run by the thesis' method has its own delay and estimates, of the same fault."""
    case = Case(key="plain", make=WINDING, looks=(5.0,))
    found, other = play(case, SEED, Method.CLASSIC), play(case, SEED)
    assert (found.method, other.method) == ("classic", "bank")
    assert found.delay is not None
    assert other.delay is not None
    assert found.delay > other.delay
    assert found.looks[0].error != other.looks[0].error


@pytest.mark.parametrize("seeds", [1, 7])
def test_page_tells_how_many_seeds_were_asked_for(seeds: int) -> None:
    """The command above the table is told from the runs, whichever cases were played."""
    for keys in (["tank.healthy", "tank.K6", "tank.rough"], ["tank.healthy"]):
        todo = chain(*trust.jobs(keys, seeds, 10, [Method.BANK]))
        found = trust.by_case(run(key, seed) for key, seed, _ in todo)
        assert trust.seeds_of(found) == seeds


@pytest.mark.parametrize(("wrong", "met"), [(0, True), (1, True), (2, False)])
def test_disturbed_runs_may_be_worse_by_less_than_two_points(wrong: int, met: bool) -> None:
    """Of a hundred runs one more may be wrong than without the disturbance."""
    found = {
        "tank.K6": [run("tank.K6", seed, rank=2 if seed == 99 else 1) for seed in range(100)],
        "late.K6": [run("late.K6", seed, rank=2 if seed >= 99 - wrong else 1) for seed in range(100)],
    }
    row = line(found, "late: true set first")
    assert (row.met, row.got) == (met, f"{99 - wrong} of 100 ({99 - wrong} %), {-wrong:+.1f} points")


def test_disturbed_runs_are_compared_with_those_of_their_seeds() -> None:
    """A plain run without a disturbed one of its seed does not count."""
    found = {
        "tank.K6": [run("tank.K6", 1), run("tank.K6", 2, delay=90.0)],
        "missing.K6": [run("missing.K6", 2, delay=95.0), run("missing.K6", 3)],
    }
    assert line(found, "missing: detected within 50 s").got == "0 of 1 (0 %), +0.0 points"
    assert line(found, "missing: detected in 95 %").got == "95 s (median 95 s); undisturbed 90 s (median 90 s)"


def test_run_without_an_alarm_is_not_right() -> None:
    """A fault that is not detected counts among all runs, as not first."""
    found = {"stuck.flow": [run("stuck.flow", 1), run("stuck.flow", 2, delay=None)]}
    row = line(found, "stuck")
    assert row.got == "1 of 2 (50 %), in the group 1 of 2 (50 %); detected in 1 of 2 (50 %), never (median 40 s)"
    assert (row.asked, row.met) == ("", None)


def test_an_input_that_is_not_obeyed_is_recorded_as_told() -> None:
    """The recording shows the command; the plant follows another one, from the onset on. (Later the recipe reacts.)"""
    found, plain = disobeyed("tank", "u_in", 1900.0, 3), healthy("tank", 1900.0, 3)
    before, soon = found.time < found.onset, np.abs(found.time - found.onset - 20.0) < 10.0
    assert np.array_equal(found.outputs[before], plain.outputs[before])
    assert np.array_equal(found.inputs[before | soon], plain.inputs[before | soon])
    assert np.abs(found.outputs[soon, 0] - plain.outputs[soon, 0]).mean() > 1e-5
    assert found.suspects == frozenset({"u_in"})


def test_what_the_data_say_of_a_step() -> None:
    """A filter that is told the fault is far likelier; told one that is not there, less likely, and never by much."""
    made = CASES["small.K7.up"].make(1)
    plain = replace(healthy("tank", 4920.0, 1), onset=made.onset, suspects=made.suspects, values=made.values)
    assert evidence(made, kept=False) > 30.0
    assert evidence(plain, kept=False) < 3.0


def test_recipe_and_moving_valves_have_lines_of_their_own() -> None:
    """A fault with the valves moving is no run of the recipe."""
    found = {"tank.K4": [run("tank.K4", 1, rank=2)], "moved.K4": [run("moved.K4", 1)]}
    assert line(found, "tank, recipe, nine sets of faults, 10 min after the alarm: true").got == "0 of 1 (0 %)"
    assert line(found, "tank, valves moving, nine sets of faults, 10 min after the alarm: true").got == "1 of 1 (100 %)"


def test_disturbed_runs_are_not_counted_twice() -> None:
    """The calibration is of the plain runs: the disturbed ones have the same faults, plants and noise."""
    found = {key: [run(key, 1)] for key in ("tank.K6", "late.K6", "missing.K6", "restored.K6")}
    assert len(claims_of(found, late=True)) == 1


def test_expected_faults_have_a_calibration_of_their_own() -> None:
    """Steps drawn from the priors are another question than the usual sets, so neither is counted with the other."""
    found = {"tank.K6": [run("tank.K6", 1)], "expected.tank": [run("expected.tank", 1)] * 2}
    assert len(claims_of(found, late=True)) == 1
    assert len(expected_claims(found)) == 2


def test_the_plot_has_a_mark_for_each_tenth_with_claims(tmp_path: Path) -> None:
    """All claims here are of 90 %, so each series has one mark, beside that of its name."""
    found = {"tank.K6": [run("tank.K6", 1)], "expected.tank": [run("expected.tank", 1)]}
    write_plot(found, tmp_path / "plot.svg")
    text = (tmp_path / "plot.svg").read_text()
    assert text.count("<circle") == 3 + 2  # no early claims
    assert all(word in text for word in ("late claims", "early claims", "late, expected faults"))


def test_expected_faults_are_drawn_from_the_priors() -> None:
    """Each parameter as often as the others, and its factor as far from 1 as the starts of its lanes are."""
    spec, _ = engine_of("dc_motor")
    generator = np.random.default_rng(SEED)
    found = [drawn(spec, generator) for _ in range(2000)]
    names = [name for name, _ in found]
    assert all(0.15 < names.count(name) / len(names) < 0.25 for name in ("R", "L", "K", "J", "C"))
    starts = starts_of(spec.parameters[0], 1)
    factors = [factor for _, factor in found]
    assert np.mean(factors) == pytest.approx(np.mean([start.value for start in starts]), rel=0.05)
    assert min(factors) > spec.parameters[0].lower


def test_every_case_is_in_the_table() -> None:
    """No case is played for nothing: without it a line is gone or has other numbers."""
    found = {key: [run(key, 1)] for key in CASES}
    whole = trust_rows.rows(found)
    assert len({row.figure for row in whole}) == len(whole)
    for key in CASES:
        assert trust_rows.rows({other: runs for other, runs in found.items() if other != key}) != whole, key
