"""Parameters far outside what was declared: what is told of them, and what may be missing in their place."""

import json
from collections.abc import Generator
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app import quiet_fit
from faultbond.app.deadline import Deadline
from faultbond.app.engine import build_watcher
from faultbond.app.identification import read_points
from faultbond.app.likelihood import begun_likelihood, likelihood_engine
from faultbond.app.quiet_fit import _next
from faultbond.cli import DONE, main
from faultbond.fit import cure, ground, identification
from faultbond.fit.ascent import TURNS, Finish, Summit, ascend, spread_noise
from faultbond.fit.cure import Cure, cured, strayed
from faultbond.fit.evidence import CLOSE_ENOUGH
from faultbond.fit.foothold import Added, Footing
from faultbond.fit.identification import Fit, Prior, fit_plant
from faultbond.fit.imperfections import Imperfection, Kind, with_imperfections
from faultbond.fit.objective import FitPoint, FittedPlant
from faultbond.fit.outcome import estimates_of
from faultbond.fit.quiet_search import FEWEST, WORTH, Search
from faultbond.fit.session import build_fit, free_parameters
from faultbond.fit.stray import Stray, strayed_by, strays_of
from faultbond.fit.unknowns import INSIDE
from faultbond.io.recording import write_recording
from faultbond.model.text import load_model, parse_model
from faultbond.report.fit_result import Fitted
from faultbond.report.quiet_result import Quieted
from faultbond.simulate import Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_model

MODEL = """# a winding
name: winding
sample_time: 0.02 s
accuracy: 3 %
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: RESISTANCE}}
  cable: {type: R, parameters: {R_c: 1 ohm}}
  L: {type: I, parameters: {L: {nominal: 2.5 H, accuracy: 5 %}}, start: {p: 0 V*s, sd: 0.001 V*s}}
junctions: {armature: 1}
bonds: [source -> armature -> R, armature -> cable, armature -> L]
sensors: {i: {reads: armature.f, unit: A, noise: 20 mA}}
"""
TOTAL, INDUCTANCE, NOISE = 4.0, 2.5, 0.02


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Write a recording of a winding with its cable under a voltage that jumps."""
    rng, step, rows = np.random.default_rng(4), 0.02, 400
    voltage = np.where(np.arange(rows) // 50 % 2 == 0, 6.0, -2.0)
    current, values = 0.0, []
    for k in range(rows):
        values.append(current + NOISE * rng.standard_normal())
        decay = np.exp(-TOTAL / INDUCTANCE * step)
        current = decay * current + (1.0 - decay) * voltage[k] / TOTAL
    path = tmp_path / "a.csv"
    time = np.asarray(step * np.arange(rows), dtype=np.float64)
    write_recording(path, {"time": time, "V": voltage, "i": np.array(values)})
    return path


def fitted(recording: Path, resistance: str, *words: str) -> tuple[dict[str, Any], Path]:
    """Fit a model to a recording; give the record and the new file."""
    model, new, target = (recording.with_name(name) for name in ("model.yaml", "new.yaml", "fit.jsonl"))
    model.write_text(MODEL.replace("RESISTANCE", resistance), encoding="utf-8")
    options = ("-o", str(new), "--starts", "1", "--json", str(target), *words)
    assert main(["fit", str(model), str(recording), *options]) == DONE
    return dict(json.loads(target.read_text(encoding="utf-8"))), new


def test_what_strayed_with_another_is_doubtful(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a resistance and its cable only the sum shows; it is off by far: both are named, and no fault is sure of one.

    The record, the text, the comment of the file and `check` say so.
    """
    found, new = fitted(recording, "2 ohm")
    told = {item["parameter"]: item for item in found["strayed"]}
    assert set(told) == {"R", "R_c"}
    assert told["R"]["accuracies"] > INSIDE
    assert (told["R"]["goes_with"], told["R_c"]["goes_with"]) == (["R_c"], ["R"])
    assert told["R"]["look_at"] == ["R"]
    graph = load_model(new)
    for name in told:
        moved = abs(graph.parameter(name).nominal - {"R": 2.0, "R_c": 1.0}[name])
        assert graph.parameter(name).healthy_change >= 0.99 * moved
    first = new.read_text(encoding="utf-8").splitlines()[0]
    assert "DOUBTFUL, far outside what was declared: R (+" in first
    assert first.endswith("look at R and cable.")
    said = " ".join(capsys.readouterr().out.split())
    assert "accuracies above what was declared, together with R_c" in said
    assert "R and R_c are far outside what was declared: mend the model at R and cable" in said


@pytest.mark.parametrize("way", [(), ("--until-quiet",)])
def test_what_an_earlier_fit_found_doubtful_stays_so(
    way: tuple[str, ...], recording: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit of what a fit wrote finds nothing far away: that is declared by now, and as doubtful as before.

    Until the user, who has mended the law, deletes the line that says so.
    """
    monkeypatch.setattr(quiet_fit, "smallest_of_each", lambda *_: [(), ()])
    _, new = fitted(recording, "2 ohm")
    once, again = load_model(new), recording.with_name("again.yaml")
    capsys.readouterr()
    assert main(["fit", str(new), str(recording), "-o", str(again), "--starts", "1", *way]) == DONE
    first = again.read_text(encoding="utf-8").splitlines()[0]
    assert "DOUBTFUL, far outside what was declared before an earlier fit: R (+" in first
    assert "look at R and cable." in first
    assert "doubtful far outside what was declared before an earlier fit" in " ".join(capsys.readouterr().out.split())
    for name in ("R", "R_c"):
        assert load_model(again).parameter(name).healthy_change >= 0.99 * once.parameter(name).healthy_change > 0.0
    new.write_text(new.read_text(encoding="utf-8").partition("\n")[2], encoding="utf-8")
    assert main(["fit", str(new), str(recording), "-o", str(again), "--starts", "1", *way]) == DONE
    assert "DOUBTFUL" not in again.read_text(encoding="utf-8")


def test_check_names_what_seems_to_move_far(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A parameter that seems to move by more than its accuracy is a place where the model lacks something."""
    model = recording.with_name("model.yaml")
    moves = "{nominal: 2 ohm, healthy_change: 10 %}"
    model.write_text(MODEL.replace("RESISTANCE", moves), encoding="utf-8")
    assert main(["check", str(model)]) == DONE
    assert "R seems to move by 3.3 accuracies (sd) while healthy: the law of R" in " ".join(
        capsys.readouterr().out.split()
    )
    model.write_text(MODEL.replace("RESISTANCE", moves.replace("10 %", "2 %")), encoding="utf-8")
    assert main(["check", str(model)]) == DONE
    assert "seems to move" not in capsys.readouterr().out


def test_what_stays_inside_is_not_doubtful(recording: Path) -> None:
    """A right model says nothing of straying, nor one whose accuracies were not to count; its file has no doubts."""
    found, new = fitted(recording, "3 ohm")
    assert found["strayed"] == []
    assert "DOUBTFUL" not in new.read_text(encoding="utf-8")
    assert fitted(recording, "2 ohm", "--prior", "none")[0]["strayed"] == []


@pytest.mark.parametrize("shaken", [True, False])
def test_places_around_are_left_alone_where_a_search_has_climbed(
    shaken: bool, recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a fold each of them costs as many steps as the climb itself."""
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    read = [("a", read_points(graph, str(recording)))]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, read, free_parameters(graph))
    climb, turns = ascend, list[object]()

    def climbed(*words: Any, **options: Any) -> Summit:
        turns.append(options["turns"])
        return climb(*words, **options)

    monkeypatch.setattr(identification, "ascend", climbed)
    fit_plant(plant, records, begin, starts=1, shaken=shaken)
    assert (None in turns) is shaken


def test_an_accuracy_that_is_believed_is_not_widened(recording: Path) -> None:
    """Of a sum that is off by far what is believed stays, and the other one takes it all."""
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    read = [("a", read_points(graph, str(recording)))]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, read, free_parameters(graph))
    found = fit_plant(plant, records, begin, believed=frozenset({"R"}), starts=1)
    values = {item.parameter.name: item.value for item in estimates_of(found)}
    assert dict(zip(("R", "R_c", "L"), found.widths, strict=True))["R"] == 1.0
    assert (
        abs(strayed_by(graph.parameter("R"), values["R"]))
        < 1.0
        < INSIDE
        < strayed_by(graph.parameter("R_c"), values["R_c"])
    )
    assert values["R"] + values["R_c"] == pytest.approx(TOTAL, rel=0.01)


@pytest.mark.parametrize(
    ("declared", "suspect", "told"), [("9 %", "yes", 1.0), ("9 %", "no", 3.0), ("2 %", "no", 2.0), ("0.5 %", "no", 0.5)]
)
def test_what_is_no_suspect_is_known_less_well_than_a_fit_says(
    declared: str, suspect: str, told: float, recording: Path
) -> None:
    """Three times, up to what was declared: few recordings do not show how far it is otherwise in others."""
    inductance = f"{{nominal: 2.5 H, accuracy: {declared}, suspect: {suspect}}}"
    text = MODEL.replace("RESISTANCE", "3 ohm").replace("{nominal: 2.5 H, accuracy: 5 %}", inductance)
    graph = parse_model(text, file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    read = [("a", read_points(graph, str(recording)))]
    found = fit_plant(*build_fit(model, likelihood_engine(model), core, read, free_parameters(graph)), starts=1)
    (known,) = (item for item in estimates_of(found) if item.parameter.name == "L")
    assert known.sd < 0.009 * known.value  # so it is 1 % that a plant stays the same to
    assert known.accuracy == pytest.approx(0.01 * told * known.value, rel=0.02)


@pytest.mark.parametrize(
    ("ends", "suspect", "held"),
    [("[0 A, inf]", "yes", True), ("any", "yes", False), ("[0 A, inf]", "no", False)],
)
def test_what_is_absent_while_healthy_stays_inside_its_accuracy(
    ends: str, suspect: str, held: bool, recording: Path
) -> None:
    """A leak of a model that lacks something, here an offset of the meter; it is told that it would be larger."""
    leak = f"{{nominal: 0 A, accuracy: 5 mA, change: 1 A, range: {ends}, suspect: {suspect}}}"
    text = MODEL.replace("RESISTANCE", "3 ohm").replace("{R_c: 1 ohm}", "{R_c: {nominal: 1 ohm, suspect: no}}")
    text = text.replace("parameters: {L:", "law: f = p/L, parameters: {lost: " + leak + ", L:").replace(
        "{reads: armature.f,", "{reads: armature.f + lost,"
    )
    graph = parse_model(text, file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    shifted = recording.with_name("b.csv")
    head, *rows = recording.read_text(encoding="utf-8").splitlines()
    parts = [row.split(",") for row in rows]
    i = head.split(",").index("i")
    moved = (",".join([*part[:i], str(float(part[i]) + 0.025), *part[i + 1 :]]) for part in parts)
    shifted.write_text("\n".join([head, *moved]) + "\n", encoding="utf-8")
    read = [("b", read_points(graph, str(shifted)))]
    found = fit_plant(*build_fit(model, likelihood_engine(model), core, read, free_parameters(graph)), starts=1)
    estimates = estimates_of(found)
    (known,) = (item for item in estimates if item.parameter.name == "lost")
    assert known.value == pytest.approx(INSIDE * 0.005 if held else 0.025, rel=0.15)
    assert "lost" in [item.parameter.name for item in strays_of(graph, found, estimates)]


def test_distances_are_those_of_the_prior() -> None:
    """A positive parameter is off by the logarithm of its factor, another by its difference, an exact one by none."""
    item = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml").parameter("R")
    assert strayed_by(item, 2.0 * np.exp(0.06)) == pytest.approx(2.0)
    assert strayed_by(item, 2.0 * np.exp(-0.06)) == pytest.approx(-2.0)
    assert strayed_by(replace(item, lower=-np.inf), 2.12) == pytest.approx(2.0)
    assert strayed_by(replace(item, accuracy=0.0), 9.0) == 0.0


class Cured(SimpleNamespace):
    """A search in which something explains `gain` nats with a resistance inside, and `free` more with it let go."""

    def ground(self, graph: object) -> SimpleNamespace:
        return SimpleNamespace(climbed=self.climbed)

    def climbed(self, stand: Footing, *, is_far: bool = False, least: float = CLOSE_ENOUGH) -> Footing:
        assert is_far is bool(self.inside)
        # A thousandth of what was gained is neither here nor there where it is asked whether it stays.
        assert least == (CLOSE_ENOUGH if is_far else pytest.approx(max(CLOSE_ENOUGH, 1e-3 * stand.trained)))
        if self.inside:
            course, ahead = (0.0 if known else -np.inf for known in (self.course, self.ahead))
            return replace(stand, held=ahead - 500.0, trained=course, values={**stand.values, "R": 2.1})
        if "R" in self.believed:
            return replace(stand, held=self.gain, values={**stand.values, "R": self.ends})
        return replace(stand, held=self.gain + self.free, values={**stand.values, "R": 3.0})


@pytest.mark.parametrize(
    ("case", "is_cured"),
    [
        ({}, True),
        ({"trained": 20_000.0}, True),
        ({"found": False}, False),
        ({"course": False}, False),
        ({"ahead": False}, False),
        ({"gain": 0.5 * WORTH}, False),
        ({"free": FEWEST + 1.0}, False),
        ({"ends": 3.0}, False),
    ],
)
def test_what_is_missing_is_kept_where_it_explains_as_much(
    case: dict[str, float], is_cured: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is kept where it foretells better, lets the parameter stay, and letting it go would gain hardly more.

    The plant must have a course with the parameter inside, also in what is held back. Then the declared accuracy counts
    from there on; else all is as it was.
    """
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    parameters = tuple(enumerate(graph.parameters))
    known = {item.name: item.nominal for item in graph.parameters}
    stand = Footing(graph=graph, values=known | {"R": 3.0}, starts={}, held=0.0)
    options = {"found": True, "gain": 50.0, "free": 1.0, "ends": 2.1, "course": True, "ahead": True, "trained": 60.0}
    options |= case
    fake = Cured(
        parameters=parameters, own=(), tell=lambda _: None, inside=frozenset(), believed=frozenset(), refused={}
    )
    fake.asked_together, fake.by_then = frozenset({(Kind.LAG, "before")}), None
    fake.__dict__.update(options)
    search = cast(Search, fake)
    explained = replace(stand, held=fake.gain, trained=fake.trained) if fake.found else None

    def better(search: Search, _: Footing) -> Footing | None:
        search.asked_together |= {(Kind.LAG, "with it inside")}
        return explained

    monkeypatch.setattr(cure, "better", better)
    assert strayed(search, stand) == {"R"}
    found, let_go = cured(search, stand)
    assert search.asked_together == {(Kind.LAG, "before")}
    assert (found is not None) == is_cured
    assert (let_go is not None) == bool(case.keys() & {"free", "ends"})
    assert search.believed == ({"R"} if is_cured else frozenset())
    assert search.inside == frozenset()
    if found is not None:
        assert found.values["R"] == 2.1
    if let_go is not None:
        assert (let_go.values["R"], let_go.held) == (3.0, fake.gain + fake.free)
    if not is_cured:  # who has to end now has this
        assert search.by_then is let_go


def test_what_is_absent_while_healthy_is_asked_no_cure_for() -> None:
    """It is held inside its accuracy all along, and stands at the end of that to the last digit but one."""
    leak = "{R_c: 1 ohm, lost: {nominal: 0 V, accuracy: 5 mV, change: 1 V, range: RANGE}}"
    text = (
        MODEL.replace("RESISTANCE", "3 ohm")
        .replace("{R_c: 1 ohm}", leak)
        .replace("type: R, parameters: {R_c", "type: R, law: e = R_c*f + lost, parameters: {R_c")
    )
    for ends, found in (("[0 V, inf]", frozenset[str]()), ("any", frozenset({"lost"}))):
        graph = parse_model(text.replace("RANGE", ends), file="m.yaml")
        search = SimpleNamespace(parameters=tuple(enumerate(graph.parameters)), own=())
        values = {item.name: item.nominal for item in graph.parameters} | {"lost": INSIDE * 0.005 * (1.0 + 1e-15)}
        assert strayed(cast(Search, search), Footing(graph=graph, values=values, starts={})) == found


def test_what_a_cure_leads_to_is_known_before_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the parameter let go, while it is asked still whether it stays by itself."""

    class Stopped(Cured):
        def climbed(self, stand: Footing, *, is_far: bool = False, least: float = CLOSE_ENOUGH) -> Footing:
            if "R" in self.believed:
                raise InterruptedError
            return super().climbed(stand, is_far=is_far, least=least)

    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    stand = Footing(graph=graph, values={item.name: item.nominal for item in graph.parameters} | {"R": 3.0}, starts={})
    sets = dict.fromkeys(("inside", "believed", "asked_together"), frozenset[str]())
    fake = Stopped(parameters=tuple(enumerate(graph.parameters)), own=(), tell=lambda _: None, refused={}, **sets)
    fake.__dict__.update({"by_then": None, "gain": 50.0, "free": 1.0, "ends": 2.1, "course": True, "ahead": True})
    monkeypatch.setattr(cure, "better", lambda *_: replace(stand, held=50.0))
    with pytest.raises(InterruptedError):
        cured(cast(Search, fake), stand)
    assert fake.by_then.values["R"] == 3.0


def test_each_is_asked_first_and_once_more_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """What strays whatever is added is not asked again round by round; what rows hold, and a law's offset, is, first.

    Where nothing else gains it is asked once more, if something was added since: that may have hidden what is missing.
    """
    asked: dict[str, float] = {}
    calls: list[str] = []
    monkeypatch.setattr("faultbond.app.quiet_fit.strayed", lambda *_: frozenset({"R"}))
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    answers: dict[str, object] = {"held_until": None, "cured": Cure(), "centred": None, "better": None}

    def answer(name: str, *_: object) -> object:
        calls.append(name)
        return answers[name]

    for name in answers:
        monkeypatch.setattr(f"faultbond.app.quiet_fit.{name}", partial(answer, name))
    lag = Added(what=Imperfection(kind=Kind.LAG, place="u"), trained=1.0, held=1.0)
    for added in ((), (), (lag,), (lag,)):
        stand = Footing(graph=graph, values={}, starts={}, added=added)
        assert _next(cast(Search, None), stand, asked) is None
    usual = ("centred", "better")
    assert calls == [
        *("held_until", "cured", *usual),
        *("held_until", *usual),
        *("held_until", *usual, "cured"),
        *("held_until", *usual),
    ]
    calls.clear()
    kept, let_go, centred = (Footing(graph=graph, values={}, starts={}) for _ in range(3))
    answers |= {"cured": Cure(let_go=let_go)}  # what would be found again is not asked for again
    assert _next(cast(Search, None), stand, {}) is let_go
    answers |= {"centred": centred}
    assert _next(cast(Search, None), stand, {}) is centred
    answers |= {"cured": Cure(kept=kept)}
    assert _next(cast(Search, None), stand, {}) is kept
    rows = Footing(graph=graph, values={}, starts={})
    answers |= {"held_until": rows}
    assert _next(cast(Search, None), stand, {}) is rows
    assert calls == [*("held_until", "cured", "centred") * 2, "held_until", "cured", "held_until"]


BLOCKS = """
name: two blocks
sample_time: 10 s
accuracy: 3 %
inputs: {P: {unit: W}, T: {unit: degC}}
components:
  heater: {type: Sf, law: f = a*P, parameters: {a: 1}}
  one: {type: C, law: q = C1*e, parameters: {C1: 5 kJ/K}}
  gap: {type: R, law: f = K1*e, parameters: {K1: GAP W/K}}
  two: {type: C, law: q = C2*e, parameters: {C2: 8 kJ/K}}
  skin: {type: R, law: f = K2*e, parameters: {K2: 6 W/K}}
  ambient: {type: Se, law: e = T}
junctions: {first: 0, through: 1, second: 0, out: 1}
bonds: [heater -> first -> one, first -> through -> gap, through -> second -> two, second -> out -> skin,
  out -> ambient]
sensors: {T1: {reads: first.e, unit: degC, noise: 0.05 K}, T2: {reads: second.e, unit: degC, noise: 0.05 K}}
"""


def test_a_scale_that_all_others_have_in_common_takes_no_part(tmp_path: Path) -> None:
    """Temperatures show no watts: all five could be larger together. One that is off leaves the others as they are.

    But for the heater, of which what flows through the gap is hardly told apart.
    """
    model, healthy, new, target = (tmp_path / name for name in ("model.yaml", "h.csv", "new.yaml", "fit.jsonl"))
    plant, n = parse_model(BLOCKS.replace("GAP", "7")), 1500
    time = np.linspace(0.0, 10.0 * (n - 1), n)
    power = random_steps(time, np.random.default_rng(3), low=0, high=300, shortest=200.0, longest=1500.0)
    inputs = Inputs(time=time, values=np.column_stack([power, 290.0 + np.sin(time / 4000.0)]))
    made = simulate(plant, inputs, seed=2, start={"one.q": 1450e3, "two.q": 2320e3})
    columns = {"time": time, "P": power, "T": inputs.values[:, 1] - 273.15}
    write_recording(healthy, columns | {f"T{k + 1}": made.outputs[:, k] - 273.15 for k in range(2)})
    model.write_text(BLOCKS.replace("GAP", "10"), encoding="utf-8")
    assert main(["fit", str(model), str(healthy), "-o", str(new), "--starts", "1", "--json", str(target)]) == DONE
    told = json.loads(target.read_text(encoding="utf-8"))
    assert [item["parameter"] for item in told["strayed"]] == ["K1"]
    assert told["strayed"][0]["goes_with"] == ["a"]
    graph = load_model(new)
    a, gap = (graph.parameter(name).nominal for name in ("a", "K1"))
    assert gap / a == pytest.approx(7.0, rel=0.03)
    for name in ("C1", "C2", "K2"):
        assert graph.parameter(name).healthy_change < 0.02 * graph.parameter(name).nominal


def test_what_strayed_with_another_may_be_off_as_far_as_it_moved() -> None:
    """The larger counts of that and of what it seems to change by while healthy."""
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    stray = Stray(parameter=graph.parameter("R"), accuracies=7.0, moves=(("R", 1.0), ("R_c", 0.4)))
    fake = SimpleNamespace(healthy_changes={"R": 0.1, "R_c": 0.5, "V": 0.2}, strays=(stray,))
    moves = cast(property, Fitted.moves).fget
    assert moves is not None
    assert moves(fake) == {"R": 1.0, "R_c": 0.5, "V": 0.2}


@pytest.mark.parametrize(
    ("doubt", "fitted", "size"),
    [
        ("", "R R_c", "10 %"),
        (" R (+7 accuracies)", "R R_c", "10 %"),
        (" R_c (+7 accuracies) and R (+7 accuracies)", "R R_c", "10 %"),
        (" R_c (+7 accuracies, with R) and R (+7 accuracies, with R_c)", "R R_c", "40 %"),
        (" R_c (+7 accuracies, with R) and R (+7 accuracies, with R_c)", "R", "10 %"),
        (" R_c (+7 accuracies, with R) and R (+7 accuracies, with R_c)", "R_c", "1.5 %"),
        (" R (+7 accuracies, with R_c and C)", "R R_c", "10 %"),
    ],
)
def test_how_far_a_doubtful_value_may_be_off_does_not_become_less(doubt: str, fitted: str, size: str) -> None:
    """A fit of what was found finds that it stays; without a doubt, or with a partner that is known, that counts."""
    graph = parse_model(MODEL.replace("RESISTANCE", "{nominal: 2 ohm, healthy_change: 40 %}"), file="m.yaml")
    accuracy = graph.parameter("R").accuracy
    both = [SimpleNamespace(parameter=graph.parameter(x), accuracy=accuracy, value=2.0) for x in ("R", "R_c")]
    fake = SimpleNamespace(
        graph=graph,
        estimates=[item for item in both if item.parameter.name in fitted.split()],
        healthy_changes={"R": 0.2} if "R" in fitted.split() else {},
        moves={"R": 0.2} if "R" in fitted.split() else {},
        doubt=doubt,
        known=frozenset(),
    )
    changes = cast(property, Fitted.declared_changes).fget
    assert changes is not None
    assert dict(changes(fake))["R"] == size
    fake.known = frozenset({"R"})
    assert "R" not in dict(changes(fake))  # nor of what is declared as known


def test_what_a_search_added_was_declared_by_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """So it is no doubtful number, however far the last fit moves it from where the search had it."""
    stated = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    lag = Imperfection(kind=Kind.LAG, place="V", size=0.1)
    graph = with_imperfections(stated, (lag,))
    strays = [Stray(parameter=graph.parameter(name), accuracies=7.0, moves=((name, 1.0),)) for name in ("R", "V_lag")]
    fitted = Fitted(
        graph=graph, found=cast(Fit, None), version="1", estimates=(), noises=(), silences=(), strays=tuple(strays)
    )
    monkeypatch.setattr(quiet_fit, "fitted_model", lambda *_: fitted)
    now = SimpleNamespace(fitted=SimpleNamespace(version="1", doubt=""))
    found = quiet_fit._fitted(graph, stated, cast(Fit, None), cast(Any, now))
    assert [item.parameter.name for item in found.strays] == ["R"]
    assert found.added == {"V_lag"}


def test_a_quiet_model_is_asked_once_more_before_it_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """What strays may be quiet, too; what is found then is added, and the model with it put on trial."""
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    lag = Added(what=Imperfection(kind=Kind.LAG, place="V", size=0.1), trained=9.0, held=9.0)
    stand = Footing(graph=graph, values={}, starts={})
    more = replace(stand, held=9.0, trained=stand.trained + 30.0, added=(lag,))
    cures, on_trial = [more, None], list[Footing]()

    def attempt(stand: Footing, now: object, *_: object) -> Generator[object, None, tuple[object, object]]:
        on_trial.append(stand)
        yield now
        return SimpleNamespace(quiet=True), now

    monkeypatch.setattr(quiet_fit, "_seems_quiet", lambda *_: True)
    monkeypatch.setattr(quiet_fit, "_cured", lambda *_, again: Cure(kept=cures.pop(0)) if again else Cure())
    monkeypatch.setattr(quiet_fit, "_attempt", attempt)
    monkeypatch.setattr(quiet_fit, "of_an_input", lambda _, stand: stand)
    rested = list[Footing]()

    def at_rest(stand: Footing, gained: float) -> Footing:
        assert gained == 30.0
        rested.append(stand)
        return stand

    search = SimpleNamespace(
        lasting=lambda stand: stand, coarsened=lambda stand: stand, at_rest=at_rest, believed=frozenset()
    )
    now = Quieted(fitted=cast(Any, None), text="", held=(), stated=True, promise=1.0)
    wishes = SimpleNamespace(prior="declared")
    bound = Deadline(lambda _: None, inf)
    for _ in quiet_fit._searched(cast(Any, search), stand, now, "", graph, (), cast(Any, wishes), bound):
        pass
    assert on_trial == rested == [more]


@pytest.mark.parametrize(
    ("second", "near", "tried"),
    [
        (999.0, 0.0, 2),  # nats, of 1000: the same to any
        (995.0, 0.0, 4),
        (995.0, 0.01, 2),  # the same for a search, which has thousands to gain
        (985.0, 0.01, 4),
        (1005.0, 0.01, 2),  # whichever was first
        (1015.0, 0.01, 4),
    ],
)
def test_starts_that_end_close_by_found_the_same(
    second: float, near: float, tried: int, recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No further one is tried then. Close is in parts of what both have gained, not of what a bad start gains."""
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    read = [("a", read_points(graph, str(recording)))]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, read, free_parameters(graph))
    there = ascend(plant, records, begin, plant.unknowns.widened(1.0), turns=0)
    climbs = iter([(0.0, 999.5), (-1e6, second), (-1e6, 0.0), (-1e6, 0.0)])  # where each begins and ends

    def climbed(*_: object, **__: object) -> Summit:
        begun, ended = next(climbs)
        return replace(there, posterior=ended, course=(begun, ended))

    monkeypatch.setattr(identification, "ascend", climbed)
    *_, reached = identification._climbs(plant, records, begin, 4, 2, near, Finish(), 0, lambda _: None)
    assert len(list(climbs)) == 4 - tried
    assert reached.best.posterior == max(999.5, second)


def test_no_further_start_begins_without_time(recording: Path) -> None:
    """The first has led somewhere; what follows it is as far as that."""
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    read = [("a", read_points(graph, str(recording)))]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, read, free_parameters(graph))
    told = list[str]()
    finish = Finish(in_time=lambda: not any(text.startswith("start 1 of 3") and "step 3" in text for text in told))
    found = fit_plant(plant, records, begin, starts=3, finish=finish, tell=told.append)
    assert found.starts == 1
    assert not [text for text in told if text.startswith("start 2")]
    assert not found.summit.settled


def test_only_the_best_start_goes_on_from_places_around(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where all are stuck another one may lead higher by far, so none of them is worth what places around cost."""
    graph = parse_model(MODEL.replace("RESISTANCE", "2 ohm"), file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    read = [("a", read_points(graph, str(recording)))]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, read, free_parameters(graph))
    climb, climbs, asked = ascend, list[Summit](), list[dict[str, Any]]()

    def stuck(*words: Any, **options: Any) -> Summit:
        found = replace(climb(*words, **options), settled=False)
        climbs.append(found)
        asked.append(options)
        return found

    monkeypatch.setattr(identification, "ascend", stuck)
    fit_plant(plant, records, begin, starts=3, prior=Prior.DECLARED, finish=Finish(1e-4, 1e-3))
    assert [item.get("turns") for item in asked[:4]] == [TURNS, TURNS, TURNS, None]
    heights = [item.posterior for item in climbs]
    assert heights[3] >= max(heights[:3])
    rivals = [item.get("rival") for item in asked[:3]]  # each start is measured by the best before it
    assert rivals == [None, climbs[0], climbs[0] if heights[0] >= heights[1] else climbs[1]]
    best = max(climbs[:3], key=lambda item: item.posterior)
    assert best.gained > 1.0
    assert {item["finish"].nats for item in asked[3:]} == {1e-3 * best.gained}  # what follows is no finer than that


def test_where_a_part_stays_zero_the_others_are_as_they_are_then(recording: Path) -> None:
    """A cable of which data cannot tell that it resists at all is written as none, and the winding has all of it."""
    text = MODEL.replace("RESISTANCE", "3.8 ohm").replace(
        "R_c: 1 ohm", "R_c: {nominal: 0 ohm, accuracy: 0.1 ohm, change: 1 ohm}"
    )
    graph = parse_model(text, file="m.yaml")
    core, model = build_watcher(graph), build_model(graph)
    read = [("a", read_points(graph, str(recording)))]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, read, free_parameters(graph))
    found = fit_plant(plant, records, begin, starts=1)
    parameters = {item.parameter.name: item for item in estimates_of(found)}
    cable = parameters["R_c"]
    assert cable.stays_zero
    assert 0.05 < cable.value < 0.2
    assert parameters["R"].value == pytest.approx(TOTAL, rel=0.005)
    summit = dict(zip(parameters, found.summit.point.values, strict=False))
    assert 3.8 * float(np.exp(summit["R"])) < 0.99 * TOTAL  # beside the cable that was found


def test_a_climb_from_afar_begins_with_the_noise_that_is_left_there(
    recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the noise as it stands it would begin on a cliff; here, where there is none, both lead back."""
    graph = parse_model(MODEL.replace("RESISTANCE", "3 ohm"), file="m.yaml")
    core, model, parameters = build_watcher(graph), build_model(graph), free_parameters(graph)
    read = [("a", read_points(graph, str(recording)))]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, read, parameters)
    found = fit_plant(plant, records, begin, starts=1)
    search = Search(graph, begun_likelihood, 1, lambda _: None, parameters, (), (records, records), (begin, begin))
    stand, spread = search.first(found), list[FitPoint]()

    def noted(plant: FittedPlant, records: Any, point: FitPoint) -> FitPoint:
        spread.append(spread_noise(plant, records, point))
        return spread[-1]

    monkeypatch.setattr(ground, "spread_noise", noted)
    away = replace(stand, values={**stand.values, "R": 6.0})
    near = search.ground(graph).climbed(away)
    assert not spread
    far = search.ground(graph).climbed(away, is_far=True)
    noise = plant.unknowns.n_theta
    assert spread[0].values[noise] > found.summit.point.values[noise] + np.log(3.0)
    assert far.trained == pytest.approx(near.trained, abs=1.0)
    assert far.trained == pytest.approx(stand.trained, abs=1.0)
