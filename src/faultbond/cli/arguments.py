"""The arguments of all other verbs."""

import argparse
from pathlib import Path

from faultbond.app import Imperfections, Wanted
from faultbond.app.wishes import SURE
from faultbond.cli.verbs import (
    DONE,
    FAULT_DETECTED,
    NO_VERDICT,
    Subparsers,
    Verbs,
    add_engine,
    add_model,
    add_verb,
    engine,
    level,
    part,
    time,
    whole,
)
from faultbond.errors import FaultbondError
from faultbond.io.faults import parse_fault
from faultbond.io.out import Out
from faultbond.model.quantities import quantity
from faultbond.types import Method, Verdict

CODES = {Verdict.HEALTHY: DONE, Verdict.FAULT: FAULT_DETECTED, Verdict.NONE: NO_VERDICT}


def add_check(verbs: Subparsers) -> None:
    """Add `check`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        if arguments.data:
            recordings = tuple(arguments.data)
            verbs.check_data(arguments.model, recordings, promise=arguments.promise, engine=engine(arguments), out=out)
        else:
            verbs.check(arguments.model, engine=engine(arguments), out=out)
        return DONE

    example = "faultbond check examples/tank/model.yaml"
    parser = add_verb(verbs, "check", call, "show what was understood of a model, with every default", example)
    add_model(parser)
    parser.add_argument(
        "--data",
        metavar="REC",
        nargs="+",
        help="healthy recordings: tell what the model gets wrong there, and what it must declare",
    )
    parser.add_argument(
        "--promise",
        metavar="TIME",
        type=time,
        help="with --data: mean time between false alarms that is wanted (default: that of the model, else '30 day')",
    )
    add_engine(parser)


def add_simulate(verbs: Subparsers) -> None:
    """Add `simulate`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verbs.simulate(
            arguments.model,
            inputs=arguments.inputs,
            faults=tuple(parse_fault(text) for text in arguments.fault),
            seed=arguments.seed,
            imperfections=Imperfections(spread=arguments.spread, lag=arguments.lag, curve=arguments.curve),
            start=dict(arguments.start),
            output=arguments.output,
            out=out,
        )
        return DONE

    example = "faultbond simulate model.yaml --inputs healthy.csv --fault K1=x1.85@2460 --seed 1 -o faulty.csv"
    parser = add_verb(verbs, "simulate", call, "make a recording of the plant, healthy or faulty", example)
    add_model(parser)
    parser.add_argument(
        "--inputs", metavar="REC", required=True, help="recording with the time and input columns; - is standard input"
    )
    parser.add_argument(
        "--fault",
        metavar="FAULT",
        action="append",
        default=[],
        help="of a parameter NAME=VALUE@TIME in the model's unit, or NAME=xFACTOR@TIME; of a sensor or input "
        "SIGNAL.bias, .gain, .noise or .stuck, such as flow.bias=1.4e-5@1500 or flow.stuck@1500; @TIME..TIME for a "
        "ramp, @TIME,ON/OFF for one that is there for ON and gone for OFF seconds; may be repeated",
    )
    parser.add_argument("--seed", metavar="N", type=whole, help="make the noise repeatable")
    parser.add_argument(
        "--start",
        metavar="STATE=VALUE",
        action="append",
        default=[],
        type=_start,
        help="start of a state, such as 'tank.q=0.05 m^3', SI without a unit; may be repeated (default: that of the "
        "model, else solved from the sensors in REC, else 0)",
    )
    zero = "(default: 0)"
    parser.add_argument(
        "--spread", metavar="PART", type=part, default=0.0, help=f"true parameters are off by up to '3 %%' {zero}"
    )
    parser.add_argument(
        "--lag", metavar="TIME", type=time, default=0.0, help=f"inputs that settle lag behind by '3 s' {zero}"
    )
    parser.add_argument(
        "--curve", metavar="PART", type=part, default=0.0, help=f"inputs in percent act wrongly by up to '3 %%' {zero}"
    )
    parser.add_argument("-o", "--output", metavar="REC", type=Path, required=True, help="CSV file to write")


def _start(text: str) -> tuple[str, float]:
    """Read the start of a state; SI."""
    name, equals, value = text.partition("=")
    if not equals:
        raise FaultbondError(f"--start {text!r}: expected STATE=VALUE, such as 'tank.q=0.05 m^3'.")
    return name.strip(), quantity(value, f"--start {text!r}: ").value


def add_run(verbs: Subparsers) -> None:
    """Add `run`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verdict = verbs.run(
            arguments.model,
            arguments.recording,
            wanted=Wanted(
                method=Method(arguments.method),
                engine=engine(arguments),
                report=arguments.report,
                accept=arguments.accept,
                state=arguments.state,
            ),
            out=out,
        )
        return CODES[verdict]

    example = "faultbond run model.yaml faulty.csv --report report.html"
    summary = "watch a recording, detect a fault and diagnose it; exit code 1: there is one, 4: no verdict"
    parser = add_verb(verbs, "run", call, summary, example)
    add_model(parser)
    parser.add_argument("recording", metavar="REC", help="recording, CSV or Parquet; - is CSV on standard input, live")
    parser.add_argument(
        "--method",
        choices=[method.value for method in Method],
        default=Method.BANK.value,
        help="how to detect and diagnose (default: %(default)s)",
    )
    parser.add_argument("--report", metavar="FILE.html", type=Path, help="write a report to open in a browser")
    parser.add_argument(
        "--state", metavar="STATE", type=Path, help="go on from the run kept in this file, if it exists, and keep this"
    )
    parser.add_argument(
        "--accept",
        metavar="LEVEL",
        type=level,
        help=f"accept a diagnosis once it has been at least as sure as this, such as 0.99, for a while; auto: {SURE:g}",
    )
    add_engine(parser)


def add_demo(verbs: Subparsers) -> None:
    """Add `demo`."""

    def call(arguments: argparse.Namespace, verbs: Verbs, out: Out) -> int:
        verbs.demo(report=arguments.report, engine=engine(arguments), out=out)
        return DONE

    example = "faultbond demo"
    parser = add_verb(verbs, "demo", call, "find a fault in the built-in water tank", example)
    parser.add_argument(
        "--report",
        metavar="FILE.html",
        type=Path,
        default=Path("report.html"),
        help="where to write the report (default: %(default)s)",
    )
    add_engine(parser)
