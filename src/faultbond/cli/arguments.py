"""The arguments of all verbs, and how each verb is called with them."""

import argparse
import os
from collections.abc import Callable
from math import nan
from pathlib import Path
from typing import Never, TypeAlias

from faultbond import app
from faultbond.app import FitWishes, Imperfections, Wanted, Wishes
from faultbond.cli.completion import SHELLS, script
from faultbond.cli.history import add_period, show_history
from faultbond.errors import FaultbondError
from faultbond.io.faults import parse_fault
from faultbond.io.out import Out
from faultbond.types import SURE, TARGETS, Method, Verdict

DONE, FAULT_DETECTED, NO_VERDICT = 0, 1, 4
CODES = {Verdict.HEALTHY: DONE, Verdict.FAULT: FAULT_DETECTED, Verdict.NONE: NO_VERDICT}
ENGINE = "FAULTBOND_ENGINE"
ENGINES = ("", "auto", "c")  # names that were of use; all mean the compiled one
LOWEST_LEVEL = 0.5  # a diagnosis that is less likely than its opposite is accepted by no rule
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
        raise FaultbondError(f"{self.prog}: {message}. See: {self.prog} --help")


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
        else:
            app.check(arguments.model, out=out)
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
    add(
        "--promise",
        metavar="TIME",
        type=_time,
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
    add("--within", metavar="TIME", type=_time, help="find the smallest faults within '60 s' (default: 300 samples)")
    add(
        "--separate",
        metavar="SET",
        nargs="+",
        type=_names,
        default=[],
        help="find the input that best separates these sets, such as K4 K6,K1 "
        "(default: those alike at rest, or in the recording)",
    )
    add(
        "--closed",
        metavar="N",
        type=_number("--closed", 0, MAX_CLOSED),
        default=1,
        help="solve sets of up to N parameters in closed form (default: %(default)s; 0 none)",
    )
    add(
        "--patience",
        metavar="TIME",
        type=_time,
        default=4.0,
        help="time for all closed forms together; one may take a quarter of it (default: 4 s)",
    )
    add(
        "--budget",
        metavar="N",
        type=_number("--budget", 1, MAX_BUDGET),
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
    add("--trace", metavar="NAMES", type=_names, help="print the thesis' search for the parameters R,L, step by step")


def _add_fit(verbs: Subparsers) -> None:
    """Add `fit`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        wishes = FitWishes(
            fixed=arguments.fixed,
            free=arguments.free,
            prior=arguments.prior,
            starts=arguments.starts,
            seed=arguments.seed,
            own=arguments.per_recording,
            until_quiet=arguments.until_quiet,
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
    add("--fixed", metavar="NAMES", type=_names, default=(), help="parameters that are known: G,K_meter")
    add("--free", metavar="NAMES", type=_names, help="the only parameters to find (default: all)")
    add(
        "--per-recording",
        metavar="NAMES",
        type=_names,
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
        type=_number("--starts", 1, MOST_STARTS),
        default=4,
        help="begin the search at N places (default: %(default)s)",
    )
    add("--seed", metavar="N", type=_seed, default=0, help="choose the other places (default: %(default)s)")
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
    add("--seed", metavar="N", type=_seed, help="make the noise repeatable")
    add("--no-noise", action="store_true", help="sensors and inputs show what is, without the noise of the model")
    add(
        "--start",
        metavar="STATE=VALUE",
        action="append",
        default=[],
        type=_start,
        help="start of a state, such as 'tank.q=0.05 m^3', SI without a unit; may be repeated (default: that of the "
        "model, else solved from the sensors in REC, else 0)",
    )
    for option, metavar, read, meaning in (
        ("--spread", "PART", _part, "true parameters are off by up to '3 %%'"),
        ("--lag", "TIME", _time, "inputs that settle lag behind by '3 s'"),
        ("--curve", "PART", _part, "inputs in percent act wrongly by up to '3 %%'"),
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
    summary = "watch a recording, detect a fault and diagnose it; exit code 1: there is one, 4: no verdict"
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
        type=_level,
        help=f"accept a diagnosis once it has been at least as sure as this, such as 0.99, for a while; auto: {SURE:g}",
    )
    _add_engine(parser)


def _add_decisions(verbs: Subparsers) -> None:
    """Add `accept` and `reject`."""

    def call(arguments: argparse.Namespace, out: Out) -> int:
        names = tuple(name for word in arguments.names for name in word.split(",") if name)  # commas as elsewhere
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
        type=_number("--fmu", 2, 3),
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
        type=_number("--lanes-at-most", 1, MOST_LANES),
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
        from faultbond.service.log_lines import LogForm  # noqa: PLC0415 - not all need it
        from faultbond.service.program import hash_password, serve  # noqa: PLC0415
        from faultbond.service.site import read_site, site_of  # noqa: PLC0415

        if arguments.hash:
            hash_password(out)
            return DONE
        source, store, port = arguments.source, arguments.store, arguments.port
        if arguments.site is not None and (arguments.models or source or store or arguments.accept):
            raise FaultbondError("--site: models, --source, --store and --accept stand in the site file then.")
        site = (
            read_site(arguments.site, port=port)
            if arguments.site is not None
            else site_of(arguments.models, source=source, store=store, port=port, accept=arguments.accept)
        )
        form = None if arguments.log is None else LogForm(arguments.log)
        serve(site, check=arguments.check, log=form, out=out)
        return DONE

    summary = "watch live sources, keep what happens, and show it to operators on a page"
    parser = _add_verb(verbs, "serve", call, summary, "faultbond serve model.yaml --source file:live.csv", model=False)
    add = parser.add_argument
    add("models", metavar="MODEL", type=Path, nargs="*", help="model file, YAML; none: the built-in water tank")
    add("--site", metavar="FILE", type=Path, help="YAML file that names assets, models, sources and users instead")
    add("--source", metavar="ADDRESS", help="where values come from, such as file:live.csv or - (default: sim:)")
    add("--store", metavar="STORE", help="file or postgresql:// address where all is kept (default: faultbond.sqlite)")
    add("--port", metavar="N", type=_number("--port", 0, 65535), help="port of the page (default: 8350); 0: any")
    add("--accept", metavar="LEVEL", type=_level, help="as of `run`")
    forms = "how standard error is written: plain, journal or json (default: as it suits that)"
    add("--log", metavar="FORM", choices=["plain", "journal", "json"], help=forms)
    add("--check", action="store_true", help="only say what would be watched, and whether it can be")
    add("--hash", action="store_true", help="ask for a password, and print its hash for the site file")


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


def _names(text: str) -> tuple[str, ...]:
    """Read names with commas between."""
    names = tuple(part.strip() for part in text.split(","))
    if not all(names):
        raise FaultbondError(f"{text!r}: expected names with commas between, such as R,L")
    if len(set(names)) < len(names):
        raise FaultbondError(f"{text!r}: a name stands there twice; give each once")
    return names


def _number(option: str, least: int, most: int) -> Callable[[str], int]:
    """Give the function that reads a whole number between two others."""

    def read(text: str) -> int:
        if not (text.isascii() and text.isdigit() and least <= int(text) <= most):
            raise FaultbondError(f"{option} {text}: expected a whole number from {least} to {most}")
        return int(text)

    return read


def _seed(text: str) -> int:
    """Read a whole number that is not negative."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise FaultbondError(f"--seed {text}: expected a whole number from 0, such as 1")
    return value


def _time(text: str) -> float:
    """Read a duration, s."""
    from faultbond.model.quantities import duration  # noqa: PLC0415 - loads what reads units; `run` needs none

    return duration(text)


def _start(text: str) -> tuple[str, float]:
    """Read the start of a state; SI."""
    from faultbond.model.quantities import quantity  # noqa: PLC0415

    name, equals, value = text.partition("=")
    if not equals:
        raise FaultbondError(f"--start {text!r}: expected STATE=VALUE, such as 'tank.q=0.05 m^3'.")
    return name.strip(), quantity(value, f"--start {text!r}: ").value


def _part(text: str) -> float:
    """Read a percentage as a part of 1."""
    from faultbond.model.quantities import spread  # noqa: PLC0415

    found = spread(text)
    if not found.is_relative:
        raise FaultbondError(f"{text!r} is no percentage. Write it as in --spread '3 %'.")
    return found.ratio


def _level(text: str) -> float:
    """Read a probability from which a diagnosis is accepted."""
    if text == "auto":
        return SURE
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not LOWEST_LEVEL <= value <= 1.0:
        raise FaultbondError(
            f"--accept {text}: expected auto, or a probability from {LOWEST_LEVEL:g} to 1, such as 0.99"
        )
    return value
