"""Arguments, streams and exit codes of the command line."""

import json
import os
import subprocess
import sys
import unicodedata
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import pytest

from faultbond import app
from faultbond.app import FitWishes, Imperfections, Wanted, Wishes
from faultbond.cli import main
from faultbond.errors import CONTROLS, ModelError, NoVerdictError
from faultbond.io.faults import FaultRequest
from faultbond.io.out import Out
from faultbond.types import Verdict

PROGRAM = [sys.executable, "-m", "faultbond"]


class Spy:
    """Verbs that note how they were called, then do what a test wants."""

    def __init__(self, do: Callable[[Out], bool | None] = lambda out: None) -> None:
        self.do = do
        self.seen: dict[str, object] = {}

    def check(self, model: Path, *, out: Out, settings: bool) -> None:
        """Note a call of `check`."""
        self.seen = {"model": model, "settings": settings}
        self.do(out)

    def check_data(self, model: Path, recordings: tuple[str, ...], *, promise: float | None, out: Out) -> None:
        """Note a call of `check --data`."""
        self.seen = {"model": model, "recordings": recordings, "promise": promise}
        self.do(out)

    def fit(
        self,
        model: Path,
        recordings: tuple[str, ...],
        *,
        wishes: FitWishes,
        output: Path | None,
        report: Path | None,
        out: Out,
    ) -> None:
        """Note a call of `fit`."""
        self.seen = {"model": model, "recordings": recordings, "wishes": wishes, "output": output, "report": report}
        self.do(out)

    def simulate(
        self,
        model: Path,
        *,
        inputs: str,
        faults: tuple[FaultRequest, ...],
        seed: int | None,
        noise: bool,
        imperfections: Imperfections,
        start: Mapping[str, float],
        output: Path,
        out: Out,
    ) -> None:
        """Note a call of `simulate`."""
        self.seen = {"model": model, "inputs": inputs, "faults": faults, "seed": seed, "output": output}
        self.seen |= {"imperfections": imperfections, "start": start, "noise": noise}
        self.do(out)

    def run(self, model: Path, recording: str, *, wanted: Wanted, out: Out) -> Verdict:
        """Note a call of `run`."""
        self.seen = {"model": model, "recording": recording, "wanted": wanted}
        found = self.do(out)
        return Verdict.NONE if found is None else Verdict.FAULT if found else Verdict.HEALTHY

    def accept(self, model: Path, state: Path, names: tuple[str, ...], *, repaired: bool, out: Out) -> None:
        """Note a call of `accept`."""
        self.seen = {"verb": "accept", "model": model, "state": state, "names": names}
        self.repaired = repaired
        self.do(out)

    def reject(self, model: Path, state: Path, names: tuple[str, ...], *, out: Out) -> None:
        """Note a call of `reject`."""
        self.seen = {"verb": "reject", "model": model, "state": state, "names": names}
        self.do(out)

    def analyse(self, model: Path, *, wishes: Wishes, out: Out) -> bool:
        """Note a call of `analyse`."""
        self.seen = {"model": model, "wishes": wishes}
        return self.do(out) is not False

    def print_code(self, model: Path, form: str, *, wishes: Wishes, out: Out) -> None:
        """Note a call of `print_code`."""
        self.seen = {"model": model, "form": form, "wishes": wishes}
        self.do(out)

    def trace(self, model: Path, names: tuple[str, ...], *, out: Out) -> None:
        """Note a call of `trace`."""
        self.seen = {"model": model, "names": names}
        self.do(out)

    def demo(self, *, report: Path, out: Out) -> None:
        """Note a call of `demo`."""
        self.seen = {"report": report}
        self.do(out)


def called(arguments: list[str], spy: Spy) -> int:
    """Run the command line with these verbs in the place of the application's."""
    with pytest.MonkeyPatch.context() as patch:
        for name in (name for name in vars(Spy) if not name.startswith("_")):
            patch.setattr(app, name, getattr(spy, name))
        return main(arguments)


@pytest.mark.parametrize(
    ("arguments", "seen"),
    [
        ([], {"wishes": Wishes()}),
        (["--data", "r.csv", "--within", "1 min"], {"wishes": Wishes(data="r.csv", within=60.0)}),
        (["--separate", "K1", "K4,K6"], {"wishes": Wishes(separate=(("K1",), ("K4", "K6")))}),
        (["--closed", "2", "--fewest"], {"wishes": Wishes(closed=2, preference="fewest components")}),
        (["--least-noise", "--code", "c"], {"wishes": Wishes(preference="least noise"), "form": "c"}),
        (["--trace", "R, L"], {"names": ("R", "L")}),
    ],
)
def test_arguments_of_analyse(arguments: list[str], seen: dict[str, object]) -> None:
    """What is asked for reaches `analyse`; code and trace are verbs of their own to the application."""
    spy = Spy()
    assert called(["analyse", "m.yaml", *arguments], spy) == 0
    assert spy.seen == {"model": Path("m.yaml")} | seen


@pytest.mark.parametrize(
    ("arguments", "verb", "names"),
    [
        (["accept", "m.yaml", "x.state"], "accept", ()),
        (["accept", "m.yaml", "x.state", "K1", "K6"], "accept", ("K1", "K6")),
        (["accept", "m.yaml", "x.state", "K1,K6"], "accept", ("K1", "K6")),
        (["reject", "m.yaml", "x.state", "flow"], "reject", ("flow",)),
    ],
)
def test_arguments_of_decisions(arguments: list[str], verb: str, names: tuple[str, ...]) -> None:
    """What was decided of which candidate of which kept run reaches its verb."""
    spy = Spy()
    assert called(arguments, spy) == 0
    assert spy.seen == {"verb": verb, "model": Path("m.yaml"), "state": Path("x.state"), "names": names}


@pytest.mark.parametrize("level", ["0.3", "1.5", "nan", "sure", ""])
def test_levels_that_no_rule_takes(level: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A rule accepts from a probability between a half and 1; anything else is a mistake of the user."""
    assert called(["run", "m.yaml", "r.csv", "--accept", level], Spy()) == 2
    assert "expected auto, or a probability from 0.5 to 1" in capsys.readouterr().err


def failing(error: BaseException) -> Callable[[Out], bool | None]:
    """Give an action that raises."""

    def do(_: Out) -> bool | None:
        raise error

    return do


def speak(out: Out) -> bool:
    """Write a line for people and a record, and report a fault."""
    out.say("for people")
    out.record({"record": "end"})
    return True


@pytest.mark.parametrize(
    ("arguments", "seen"),
    [
        (["check", "m.yaml"], {"model": Path("m.yaml"), "settings": False}),
        (["check", "m.yaml", "--settings"], {"model": Path("m.yaml"), "settings": True}),
        (
            ["run", "m.yaml", "r.csv"],
            {"model": Path("m.yaml"), "recording": "r.csv", "wanted": Wanted()},
        ),
        (
            ["run", "m.yaml", "-", "--method", "bank", "--report", "x.html", "--accept", "0.9"],
            {
                "model": Path("m.yaml"),
                "recording": "-",
                "wanted": Wanted(report=Path("x.html"), accept=0.9),
            },
        ),
        (
            ["run", "m.yaml", "r.csv", "--state", "x.state", "--accept", "auto"],
            {"model": Path("m.yaml"), "recording": "r.csv", "wanted": Wanted(state=Path("x.state"), accept=0.95)},
        ),
        (["demo"], {"report": Path("report.html")}),
    ],
)
def test_arguments_reach_the_verb(
    arguments: list[str], seen: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each verb gets its arguments, typed, with the defaults that the help names."""
    monkeypatch.delenv("FAULTBOND_ENGINE", raising=False)
    spy = Spy()
    assert called(arguments, spy) == (4 if arguments[0] == "run" else 0)  # the spy has no verdict
    assert spy.seen == seen


@pytest.mark.parametrize("verb", ["check m.yaml", "fit m.yaml r.csv", "run m.yaml r.csv", "demo"])
def test_the_engine_of_old_scripts(
    verb: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """There is one engine: what asks for it, or for any, is taken; what asks for another is refused in one line."""
    monkeypatch.delenv("FAULTBOND_ENGINE", raising=False)
    command = verb.split()
    plain = called(command, Spy())
    for name in ("auto", "c"):
        assert called([*command, "--engine", name], Spy()) == plain
        monkeypatch.setenv("FAULTBOND_ENGINE", name)
        assert called(command, Spy()) == plain
    for name, said in (("vm", "There is no engine `vm` any more"), ("steam", "steam: no such engine")):
        monkeypatch.setenv("FAULTBOND_ENGINE", "auto")
        assert called([*command, "--engine", name], Spy()) == 2
        monkeypatch.setenv("FAULTBOND_ENGINE", name)
        assert called(command, Spy()) == 2
        shown = capsys.readouterr().err.splitlines()
        assert len(shown) == 2
        assert shown[0] == shown[1]
        assert shown[0].startswith(said)


def test_faults_reach_simulate() -> None:
    """Faults are repeatable and arrive parsed."""
    spy = Spy()
    faults = ["--fault", "K1=x2@10", "--fault", "K6=3e-5@20..30"]
    assert called(["simulate", "m.yaml", "--inputs", "i.csv", "--seed", "7", "-o", "o.csv", *faults], spy) == 0
    assert spy.seen == {
        "model": Path("m.yaml"),
        "inputs": "i.csv",
        "faults": (
            FaultRequest(parameter="K1", value=None, factor=2.0, start=10.0, end=10.0),
            FaultRequest(parameter="K6", value=3e-5, factor=None, start=20.0, end=30.0),
        ),
        "seed": 7,
        "noise": True,
        "imperfections": Imperfections(),
        "start": {},
        "output": Path("o.csv"),
    }


def test_the_plant_of_simulate() -> None:
    """Imperfections arrive as parts of 1 and seconds, starts in SI."""
    spy = Spy()
    options = ["--spread", "3 %", "--lag", "0.5 min", "--curve", "2%", "--start", "tank.q=50 l", "--start", "L.p=1e-3"]
    assert called(["simulate", "m.yaml", "--inputs", "i.csv", "-o", "o.csv", *options], spy) == 0
    assert spy.seen["imperfections"] == Imperfections(spread=0.03, lag=30.0, curve=0.02)
    assert spy.seen["start"] == pytest.approx({"tank.q": 0.05, "L.p": 1e-3})


def test_a_recording_without_noise() -> None:
    """The option arrives."""
    spy = Spy()
    assert called(["simulate", "m.yaml", "--inputs", "i.csv", "-o", "o.csv", "--no-noise"], spy) == 0
    assert spy.seen["noise"] is False


def test_a_fault_found_is_exit_code_1_of_run_alone() -> None:
    """`run` gives 1 for a fault, 0 for none, 4 where it cannot tell; `demo`, which finds one too, gives 0."""
    assert called(["run", "m.yaml", "r.csv"], Spy(speak)) == 1
    assert called(["run", "m.yaml", "r.csv"], Spy(lambda out: False)) == 0
    assert called(["run", "m.yaml", "r.csv"], Spy()) == 4
    assert called(["demo"], Spy(speak)) == 0


@pytest.mark.parametrize(
    ("arguments", "shown"),
    [
        (["run", "m", "r.csv"], "for people\n"),
        (["run", "m", "r.csv", "--json", "-"], '{"record": "end"}\n'),
        (["run", "m", "-"], '{"record": "end"}\n'),
        (["check", "m", "--json", "-"], '{"record": "end"}\n'),
    ],
)
def test_what_stands_on_standard_output(arguments: list[str], shown: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Text or records, never both; a run on standard input gives records unless told otherwise."""
    called(arguments, Spy(speak))
    assert capsys.readouterr() == (shown, "")


def test_records_go_to_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With `--json FILE` people keep their text, also on standard input."""
    target = tmp_path / "out.json"
    called(["run", "m", "-", "--json", str(target)], Spy(speak))
    assert json.loads(target.read_text(encoding="utf-8")) == {"record": "end"}
    assert capsys.readouterr().out == "for people\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fly"], "invalid choice: 'fly'"),
        (["run", "m.yaml"], "required: REC. See: faultbond run --help"),
        (["run", "m", "r", "--method", "magic"], "invalid choice: 'magic'"),
        (["check", "--data", "r", "m"], "required: MODEL; it stands before --data, which takes all names behind it"),
        (["check", "m", "--jso", "x"], "unrecognized arguments: --jso x"),
        (["check", "m", "h.csv"], "unrecognized arguments: h.csv; a recording stands behind --data: --data h.csv"),
        (["simulate", "m", "--inputs", "i", "-o", "o", "--seed", "x"], "--seed x: expected a whole number"),
        (["simulate", "m", "--inputs", "i", "-o", "o", "--fault", "K1"], "fault 'K1': expected NAME=VALUE@TIME"),
        (["simulate", "m", "--inputs", "i", "-o", "o", "--spread", "3"], "'3' is no percentage"),
        (["simulate", "m", "--inputs", "i", "-o", "o", "--lag", "3"], "`3` needs a time unit"),
        (["analyse", "m", "--within", "3"], "argument --within: `3` needs a time unit"),
        (["check", "m", "--promise", "3 h"], "--promise says how quiet recordings are to be: give healthy ones with"),
        (["simulate", "m", "--inputs", "i", "-o", "o", "--start", "x"], "--start 'x': expected STATE=VALUE"),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong command line says what is wrong, on one line of standard error."""
    assert called(arguments, Spy()) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert (shown.out, shown.err.count("\n")) == ("", 1)


def test_an_analysis_that_tells_nothing_is_exit_code_4() -> None:
    """`analyse` without a part that could be told, and a recording from which nothing follows, have no verdict."""
    assert called(["analyse", "m.yaml"], Spy(lambda out: False)) == 4
    assert called(["fit", "m.yaml", "r.csv"], Spy(failing(NoVerdictError("r.csv: too short")))) == 4


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ModelError("m.yaml:3: two\nlines"), "m.yaml:3: two lines\n"),
        (FileNotFoundError(2, "No such file or directory", "m.yaml"), "m.yaml: No such file or directory.\n"),
        (OSError("no space"), "no space.\n"),
    ],
)
def test_mistakes_of_the_user(error: Exception, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Our own errors and those of the operating system are exit code 2 and one line."""
    assert called(["check", "m"], Spy(failing(error))) == 2
    assert capsys.readouterr() == ("", message)


def test_a_json_file_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that is not there is named."""
    assert called(["check", "m", "--json", str(tmp_path / "no" / "x.json")], Spy()) == 2
    path = tmp_path / "no" / "x.json"
    assert capsys.readouterr().err == f"{path}: there is no folder {path.parent}. Create it, or name another file.\n"


def test_an_internal_error(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A defect is exit code 3 and one line with the way to the traceback, which the variable shows."""
    monkeypatch.delenv("FAULTBOND_TRACEBACK", raising=False)
    assert called(["check", "m"], Spy(failing(ZeroDivisionError("oh")))) == 3
    shown = capsys.readouterr().err
    assert shown.startswith("faultbond: internal error: ZeroDivisionError: oh. ")
    assert "FAULTBOND_TRACEBACK=1" in shown
    assert shown.count("\n") == 1
    monkeypatch.setenv("FAULTBOND_TRACEBACK", "1")
    assert called(["check", "m"], Spy(failing(ZeroDivisionError("oh")))) == 3
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_control_c() -> None:
    """An interrupt from the keyboard is exit code 130."""
    assert called(["check", "m"], Spy(failing(KeyboardInterrupt()))) == 130


@pytest.mark.parametrize(
    ("options", "action"),
    [
        (["--json", "-"], "out.record({'x': 1})"),
        ([], "out.say('for people')"),
        ([], "Console(file=out.text).print('a table')"),
    ],
)
def test_a_closed_pipe_is_quiet(options: list[str], action: str) -> None:
    """When the reader of the output goes away, the program ends without a word."""
    code = f"""
import sys
from rich.console import Console
from faultbond import app
from faultbond.cli import main
def check(model, *, out, settings):
    for _ in range(100000): {action}
app.check = check
sys.exit(main(["check", "m", *{options}]))
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


@pytest.mark.parametrize("arguments", [["--help"], []])
def test_help(arguments: list[str]) -> None:
    """Help, which also answers an empty command line, names all verbs."""
    done = subprocess.run([*PROGRAM, *arguments], capture_output=True, text=True, check=True)
    assert all(f"\n    {verb} " in done.stdout for verb in ("check", "simulate", "run", "demo"))


def test_version() -> None:
    """`--version` gives the name and a version."""
    done = subprocess.run([*PROGRAM, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("faultbond 0.")


def test_umlauts_without_a_locale() -> None:
    """Text is UTF-8 on a machine whose locale is ASCII."""
    code = """
import sys
from faultbond import app
from faultbond.cli import main
def check(model, *, out, settings): out.say("Behälter")
app.check = check
sys.exit(main(["check", "m"]))
"""
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment, check=True)
    assert done.stdout.decode("utf-8").strip() == "Behälter"


def test_the_command_line_starts_fast() -> None:
    """Importing the command line loads none of the large libraries."""
    heavy = ["casadi", "sympy", "pint", "rich", "jinja2", "pyarrow"]
    code = f"import sys, faultbond.cli; sys.exit([name for name in {heavy} if name in sys.modules] or 0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""


def test_no_name_steers_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Controls in headers, paths and model texts, and marks that turn a text around, are shown as `?`, or refused."""
    evil = "\x1b[31m\x9b2J\x07\u202e\r\x00".replace("\x00", "")
    folder = tmp_path / f"a{evil}b\nc"
    folder.mkdir()
    example = Path(__file__).parents[2] / "examples" / "rc"
    model = folder / "model.yaml"
    model.write_text((example / "model.yaml").read_text())
    (folder / "r.csv").write_text(f"time,V{evil},V_C\n0,1,1\n")
    output = str(folder / "o.csv")
    commands = (
        ["check", str(model)],
        ["run", str(model), str(folder / "r.csv")],
        ["run", str(model), str(folder / "none.csv")],
        ["run", str(model), str(example / "healthy.csv"), "--report", str(folder / "r.html")],
        ["simulate", str(model), "--inputs", str(example / "healthy.csv"), "-o", output],
        ["nosuch" + evil],
    )
    for command in commands:
        with suppress(SystemExit):
            main(command)
        shown = capsys.readouterr()
        written = (shown.out + shown.err).replace("\n", "")
        assert all(unicodedata.category(letter) not in CONTROLS for letter in written), command
        assert shown.err.count("\n") <= 1
    model.write_text((example / "model.yaml").read_text().replace("name: ", 'name: "\\e[31m"  # '))
    assert main(["check", str(model)]) == 2
    assert "character U+001B cannot stand in a model" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["fit", "m.yaml", "a.csv", "--until-quite"],
            "faultbond fit: unrecognized arguments: --until-quite; perhaps --until-quiet is",
        ),
        (["run", "m.yaml", "a.csv", "--reprot=x"], "perhaps --report is meant. See: faultbond run --help"),
        (["chek", "m.yaml"], "perhaps check is meant. See: faultbond --help"),
        (
            ["run", "m.yaml", "a.csv", "--xyzzy"],
            "run: unrecognized arguments: --xyzzy. See: faultbond run --help",
        ),
    ],
)
def test_a_mistyped_word_is_told_with_what_it_looks_like(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """An option that a verb does not know names that verb's help, and the word that was meant if one looks like it."""
    assert main(words) == 2
    assert told in capsys.readouterr().err
