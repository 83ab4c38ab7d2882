"""The arguments of all verbs, and how each verb is called with them."""

import argparse
import os
import re
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Never, TypeAlias

from faultbond import app
from faultbond.app import FitWishes, Imperfections, Wanted, Wishes
from faultbond.app.wishes import WITHIN
from faultbond.cli.completion import SHELLS, script
from faultbond.cli.history import add_period, show_history
from faultbond.cli.serve import add_site, start_service
from faultbond.cli.values import level, name_list, part, seed, start, time_span, whole_number
from faultbond.errors import FaultbondError
from faultbond.io.faults import parse_fault
from faultbond.io.out import Out
from faultbond.types import SURE, TARGETS, Method, Verdict

DONE, FAULT_DETECTED, NO_VERDICT = 0, 1, 4
CODES = {Verdict.HEALTHY: DONE, Verdict.FAULT: FAULT_DETECTED, Verdict.NONE: NO_VERDICT}
ENGINE = "FAULTBOND_ENGINE"
ENGINES = ("", "auto", "c")  # names that were of use; all mean the compiled one
MAX_CLOSED = 5
MAX_BUDGET = 1000
MOST_STARTS = 100
MOST_LANES = 1_000_000
REPORT = "write a report to open in a browser"

VerbCall = Callable[[argparse.Namespace, Out], int]


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line."""

    def error(self, message: str) -> Never:
        """Refuse the arguments.

        Raises
        ------
        FaultbondError
            Always.
        """
        wrong = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if wrong is not None:
            known = re.findall(r"[^', ]+", wrong[2])
            message = f"{message}{_meant(wrong[1], known)}"
        greedy = [item.option_strings[0] for item in self._actions if item.option_strings and item.nargs == "+"]
        if greedy and message.endswith("required: MODEL"):
            message = f"{message}; it stands before {greedy[0]}, which takes all names behind it"
        raise FaultbondError(f"{self.prog}: {message}. See: {self.prog} --help")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse what a verb does not know itself, so that its own help is named."""
        found, left = super().parse_known_args(args, namespace)
        if left:
            options = [name for item in self._actions for name in item.option_strings]
            meant = _meant(left[0].partition("=")[0], options)
            if "--data" in options and not left[0].startswith("-"):
                meant = f"; a recording stands behind --data: --data {left[0]}"
            self.error(f"unrecognized arguments: {' '.join(left)}{meant}")
        return found, left


def _meant(word: str, known: Sequence[str]) -> str:
    """Say which known word looks like this one; empty where none does."""
    near = get_close_matches(word, known, 1)
    return f"; perhaps {near[0]} is meant" if near else ""


Subparsers: TypeAlias = "argparse._SubParsersAction[Parser]"


def add_verbs(verbs: Subparsers) -> None:
    """Add all verbs, in the order in which the help shows them."""
    for add in (_add_check, _add_analyse, _add_fit, _add_simulate, _add_run, _add_decisions, _add_generate, _add_demo):
        add(verbs)
    _add_serve(verbs)
    _add_history(verbs)
    _add_doctor(verbs)
    _add_completion(verbs)


def _add_check(verbs: Subparsers) -> None:
    """Add `check`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        if arguments.data:
            app.check_data(arguments.model, tuple(arguments.data), promise=arguments.promise, out=out)
        elif arguments.promise is not None:
            raise FaultbondError("--promise says how quiet recordings are to be: give healthy ones with --data.")
        else:
            app.check(arguments.model, out=out, settings=arguments.settings)
        return DONE

    example = "faultbond check examples/tank/model.yaml"
    parser = _add_verb(verbs, "check", call, "show what was understood of a model, with every default", example)
    add = parser.add_argument
    add(
        "--data",
        metavar="REC",
        nargs="+",
        help="healthy recordings: tell what the model gets wrong there, and what it must declare",
    )
    add("--settings", action="store_true", help="show the numbers of the method too, which no model states")
    add(
        "--promise",
        metavar="TIME",
        type=time_span,
        help="with --data: mean time between false alarms that is wanted (default: that of the model, else '30 day')",
    )
    _add_engine(parser)


def _add_analyse(verbs: Subparsers) -> None:
    """Add `analyse`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        if arguments.trace is not None:
            app.trace(arguments.model, arguments.trace, out=out)
            return DONE
        wishes = Wishes(
            data=arguments.data,
            within=arguments.within,
            separate=tuple(arguments.separate),
            closed=arguments.closed,
            patience=arguments.patience,
            preference=arguments.preference,
            budget=arguments.budget,
        )
        if arguments.code is not None:
            app.print_code(arguments.model, arguments.code, wishes=wishes, out=out)
            return DONE
        return DONE if app.analyse(arguments.model, wishes=wishes, out=out) else NO_VERDICT

    example = "faultbond analyse model.yaml --data healthy.csv"
    summary = "tell which faults can be found and told apart, how small, and what would help"
    parser = _add_verb(verbs, "analyse", call, summary, example)
    add = parser.add_argument
    add("--data", metavar="REC", help="healthy recording: tell also what its inputs allow to see")
    within = "find the smallest faults within '60 s' (default: 300 samples)"
    add("--within", metavar="TIME", type=time_span, help=within)
    add(
        "--separate",
        metavar="SET",
        nargs="+",
        type=name_list,
        default=[],
        help="find the input that best separates these sets, such as K4 K6,K1 "
        "(default: those alike at rest, or in the recording)",
    )
    add(
        "--closed",
        metavar="N",
        type=whole_number("--closed", 0, MAX_CLOSED),
        default=1,
        help="solve sets of up to N parameters in closed form (default: %(default)s; 0 none)",
    )
    add(
        "--patience",
        metavar="TIME",
        type=time_span,
        default=4.0,
        help="time for all closed forms together; one may take a quarter of it (default: 4 s)",
    )
    add(
        "--budget",
        metavar="N",
        type=whole_number("--budget", 1, MAX_BUDGET),
        default=1,
        help="N times the usual time for each search, and as many more unknowns for smallest faults (default: "
        "%(default)s)",
    )
    routes = parser.add_mutually_exclusive_group()
    for option, value in (("--fewest", "fewest components"), ("--least-noise", "least noise")):
        summary = f"take routes with the {value}, not with the fewest samples"
        routes.add_argument(option, dest="preference", action="store_const", const=value, help=summary)
    parser.set_defaults(preference="fewest frames")
    add("--code", choices=["python", "c", "latex"], help="print the closed forms as functions, and nothing else")
    trace = "print the thesis' search for the parameters R,L, step by step"
    add("--trace", metavar="NAMES", type=name_list, help=trace)


def _add_fit(verbs: Subparsers) -> None:
    """Add `fit`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        if arguments.within is not None and not arguments.until_quiet:
            raise FaultbondError("--within bounds the search of --until-quiet: give that too, or leave it out.")
        wishes = FitWishes(
            fixed=arguments.fixed,
            free=arguments.free,
            prior=arguments.prior,
            starts=arguments.starts,
            seed=arguments.seed,
            own=arguments.per_recording,
            until_quiet=arguments.until_quiet,
            within=WITHIN if arguments.within is None else arguments.within,
        )
        code: int = app.fit(
            arguments.model,
            tuple(arguments.recordings),
            wishes=wishes,
            output=arguments.output,
            report=arguments.report,
            out=out,
        )
        return code

    example = "faultbond fit model.yaml healthy.csv -o fitted.yaml --report fit.html"
    summary = "find parameters and noise from healthy recordings, and write them into a model file"
    parser = _add_verb(verbs, "fit", call, summary, example)
    add = parser.add_argument
    add("recordings", metavar="REC", nargs="+", help="healthy recording; several are fitted together")
    add("-o", "--output", metavar="MODEL2", type=Path, help="model file to write")
    add("--report", metavar="FILE.html", type=Path, help=REPORT)
    add(
        "--until-quiet",
        action="store_true",
        help="add what the recordings call for, slow errors, lags, noise, until they are as quiet as promised",
    )
    within = f"the time that --until-quiet may take, such as '1 h' (default: {WITHIN / 60.0:.0f} min)"
    add("--within", metavar="TIME", type=time_span, help=within)
    add("--fixed", metavar="NAMES", type=name_list, default=(), help="parameters that are known: G,K_meter")
    add("--free", metavar="NAMES", type=name_list, help="the only parameters to find (default: all)")
    add(
        "--per-recording",
        metavar="NAMES",
        type=name_list,
        default=(),
        help="parameters that each recording has for itself, such as a temperature at its start",
    )
    add(
        "--prior",
        choices=["widened", "declared", "none"],
        default="widened",
        help="what declared accuracies count for: widened where the data contradict them, as declared, or nothing "
        "(default: %(default)s)",
    )
    add(
        "--starts",
        metavar="N",
        type=whole_number("--starts", 1, MOST_STARTS),
        default=4,
        help="begin the search at N places (default: %(default)s)",
    )
    add("--seed", metavar="N", type=seed, default=0, help="choose the other places (default: %(default)s)")
    _add_engine(parser)


def _add_simulate(verbs: Subparsers) -> None:
    """Add `simulate`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        app.simulate(
            arguments.model,
            inputs=arguments.inputs,
            faults=tuple(parse_fault(text) for text in arguments.fault),
            seed=arguments.seed,
            noise=not arguments.no_noise,
            imperfections=Imperfections(
                spread=arguments.spread, lag=arguments.lag, curve=arguments.curve, wander=arguments.wander
            ),
            start=dict(arguments.start),
            output=arguments.output,
            out=out,
        )
        return DONE

    example = "faultbond simulate model.yaml --inputs healthy.csv --fault K1=x1.85@2460 --seed 1 -o faulty.csv"
    parser = _add_verb(verbs, "simulate", call, "make a recording of the plant, healthy or faulty", example)
    add = parser.add_argument
    add("--inputs", metavar="REC", required=True, help="recording with the time and input columns; - is standard input")
    add(
        "--fault",
        metavar="FAULT",
        action="append",
        default=[],
        help="of a parameter NAME=VALUE@TIME in the model's unit, or NAME=xFACTOR@TIME; of a sensor or input "
        "SIGNAL.bias, .gain, .noise or .stuck, such as flow.bias=1.4e-5@1500 or flow.stuck@1500; @TIME..TIME for a "
        "ramp, @TIME,ON/OFF for one that is there for ON and gone for OFF seconds; may be repeated",
    )
    add("--seed", metavar="N", type=seed, help="make the noise repeatable")
    add("--no-noise", action="store_true", help="sensors and inputs show what is, without the noise of the model")
    add(
        "--start",
        metavar="STATE=VALUE",
        action="append",
        default=[],
        type=start,
        help="start of a state, such as 'tank.q=0.05 m^3', SI without a unit; may be repeated (default: that of the "
        "model, else solved from the sensors in REC, else 0)",
    )
    for option, metavar, read, meaning in (
        ("--spread", "PART", part, "true parameters are off by up to '3 %%'"),
        ("--lag", "TIME", time_span, "inputs that settle lag behind by '3 s'"),
        ("--curve", "PART", part, "inputs in percent act wrongly by up to '3 %%'"),
    ):
        add(option, metavar=metavar, type=read, default=0.0, help=f"{meaning} (default: 0)")
    add("--wander", action="store_true", help="what the model lets wander does so")
    add("-o", "--output", metavar="REC", type=Path, required=True, help="CSV file to write")


def _add_run(verbs: Subparsers) -> None:
    """Add `run`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        wanted = Wanted(
            method=Method(arguments.method),
            report=arguments.report,
            accept=arguments.accept,
            state=arguments.state,
        )
        return CODES[app.run(arguments.model, arguments.recording, wanted=wanted, out=out)]

    example = "faultbond run model.yaml faulty.csv --report report.html"
    summary = "watch a recording, detect a fault and diagnose it; exit code 1: an alarm, 4: no verdict"
    parser = _add_verb(verbs, "run", call, summary, example)
    add = parser.add_argument
    add("recording", metavar="REC", help="recording, CSV or Parquet; - is CSV on standard input, live")
    add(
        "--method",
        choices=[method.value for method in Method],
        default=Method.BANK.value,
        help="how to detect and diagnose (default: %(default)s)",
    )
    add("--report", metavar="FILE.html", type=Path, help=REPORT)
    add("--state", metavar="STATE", type=Path, help="go on from the run kept in this file, if it exists, and keep this")
    add(
        "--accept",
        metavar="LEVEL",
        type=level,
        help=f"accept a diagnosis once it has been at least as sure as this, such as 0.99, for a while; auto: {SURE:g}",
    )
    _add_engine(parser)


def _add_decisions(verbs: Subparsers) -> None:
    """Add `accept` and `reject`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        stated = (name.strip() for word in arguments.names for name in word.split(","))  # commas as elsewhere
        names = tuple(filter(None, stated))
        if arguments.verb == "accept":
            app.accept(arguments.model, arguments.state, names, repaired=arguments.repaired, out=out)
        else:
            app.reject(arguments.model, arguments.state, names, out=out)
        return DONE

    meaning = "parameters or components of the candidate, or its sensor or input"
    for verb, number, summary, default in (
        ("accept", "*", "take a diagnosis of a kept run as the new normal", " (default: the best)"),
        ("reject", "+", "rule a diagnosis of a kept run out; the others share its probability", ""),
    ):
        add = _add_verb(verbs, verb, call, summary, f"faultbond {verb} model.yaml plant.state K1").add_argument
        add("state", metavar="STATE", type=Path, help="file that `run --state` wrote")
        add("names", metavar="NAME", nargs=number, help=f"{meaning}{default}")
        if verb == "accept":
            add("--repaired", action="store_true", help="it was the fault and is mended: nominal again")


def _add_generate(verbs: Subparsers) -> None:
    """Add `generate`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        wanted = {"lanes_at_most": arguments.lanes_at_most, "watch_only": arguments.watch_only}
        if arguments.web:
            _refuse_beside_web(arguments)
            found = app.generated_page(
                arguments.model, output=arguments.folder, recording=arguments.recording, **wanted
            )
        elif arguments.recording is not None:
            raise FaultbondError("--recording: only a page, --web, has a recording inside")
        elif arguments.fmu is None:
            target = arguments.target or TARGETS[0]
            found = app.generated(arguments.model, output=arguments.folder, target=target, **wanted)
        elif arguments.target is not None:
            raise FaultbondError("--target: the library in an FMU is for this machine; others compile its sources")
        else:
            found = app.generated_fmu(arguments.model, fmi=arguments.fmu, output=arguments.folder, **wanted)
        found.tell(out)
        return DONE

    example = "faultbond generate model.yaml -o plant && make -C plant && plant/watch < recording.csv"
    summary = "write a program and a library in C, an FMU, or a page of a browser, that watch the plant"
    add = _add_verb(verbs, "generate", call, summary, example).add_argument
    add(
        "-o",
        "--output",
        dest="folder",
        metavar="DIR",
        type=Path,
        required=True,
        help="folder to write, FILE.fmu or FILE.html",
    )
    add(
        "--target",
        metavar="NAME",
        type=_target,
        help=f"what its Makefile builds for if it is not told: {', '.join(TARGETS)} (default: {TARGETS[0]})",
    )
    add(
        "--fmu",
        metavar="VERSION",
        type=whole_number("--fmu", 2, 3),
        help="write FILE.fmu: an FMU for co-simulation, by version 2 or 3 of the standard",
    )
    add("--web", action="store_true", help="write FILE.html: a page that plays recordings, without a server or network")
    add(
        "--recording",
        metavar="REC",
        type=Path,
        help="CSV that the page has inside (default: the first fault_*.csv beside the model, if there is one)",
    )
    add(
        "--lanes-at-most",
        metavar="N",
        type=whole_number("--lanes-at-most", 1, MOST_LANES),
        help="test no more hypotheses than fit in N filters, those of the lowest cost first (default: all)",
    )
    add("--watch-only", action="store_true", help="raise alarms, and name no fault: less memory and code")


def _refuse_beside_web(arguments: argparse.Namespace) -> None:
    """Refuse options that say what else to write than a page."""
    for option, value in (("--fmu", arguments.fmu), ("--target", arguments.target)):
        if value is not None:
            raise FaultbondError(f"{option}: --web writes a page; give one of them")


def _target(name: str) -> str:
    """Refuse a target that is not known."""
    if name not in TARGETS:
        raise FaultbondError(f"--target {name}: no such target; one of {', '.join(TARGETS)}")
    return name


def _add_demo(verbs: Subparsers) -> None:
    """Add `demo`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        app.demo(report=arguments.report, out=out)
        return DONE

    parser = _add_verb(verbs, "demo", call, "find a fault in the built-in water tank", "faultbond demo", model=False)
    add = parser.add_argument
    add(
        "--report",
        metavar="FILE.html",
        type=Path,
        default=Path("report.html"),
        help="where to write the report (default: %(default)s)",
    )
    _add_engine(parser)


def _add_serve(verbs: Subparsers) -> None:
    """Add `serve`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        start_service(arguments, out)
        return DONE

    summary = "watch live sources, keep what happens, and show it to operators on a page"
    example = "faultbond serve model.yaml --source file:live.csv"
    add_site(_add_verb(verbs, "serve", call, summary, example, model=False))


def _add_history(verbs: Subparsers) -> None:
    """Add `history`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        show_history(arguments, out)
        return DONE

    summary = "list what a service found and people did, or write a period as a recording or a report"
    example = "faultbond history faultbond.sqlite"
    add_period(_add_verb(verbs, "history", call, summary, example, model=False))


def _add_doctor(verbs: Subparsers) -> None:
    """Add `doctor`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        return DONE if app.doctor(out=out) else NO_VERDICT

    summary = "tell what this installation has and what works; exit code 4: something does not"
    _add_verb(verbs, "doctor", call, summary, "faultbond doctor", model=False)


def _add_completion(verbs: Subparsers) -> None:
    """Add `completion`, which looks at the parser that it is part of once that is whole."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        text = script(arguments.shell, arguments.program)
        out.say(text.rstrip("\n"))
        out.record({"record": "completion", "shell": arguments.shell, "text": text})
        return DONE

    summary = "print what lets a shell complete verbs, options and files"
    example = 'eval "$(faultbond completion bash)"'
    parser = _add_verb(verbs, "completion", call, summary, example, model=False)
    parser.add_argument("shell", metavar="SHELL", choices=sorted(SHELLS), help=" or ".join(sorted(SHELLS)))


def _add_verb(
    verbs: Subparsers, name: str, call: VerbCall, summary: str, example: str, *, model: bool = True
) -> argparse.ArgumentParser:
    """Add a verb with what all verbs share."""
    parser = verbs.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=f"Example: {example}",
        allow_abbrev=False,
    )
    parser.add_argument("--json", metavar="FILE", help="write the result as JSON lines; - is standard output")
    if model:
        parser.add_argument("model", metavar="MODEL", type=Path, help="model file, YAML")
    parser.set_defaults(call=call)
    return parser


def _add_engine(parser: argparse.ArgumentParser) -> None:
    """Take the option of old scripts that chose the engine: there is one, and it needs a C compiler."""
    parser.add_argument("--engine", type=_engine, default=os.environ.get(ENGINE), help=argparse.SUPPRESS)


def _engine(name: str) -> str:
    """Refuse an engine that is not there."""
    if name == "vm":
        raise FaultbondError(f"There is no engine `vm` any more: leave out --engine and {ENGINE}. Models are compiled.")
    if name not in ENGINES:
        raise FaultbondError(f"{name}: no such engine; leave out --engine and {ENGINE}: there is one engine.")
    return name
