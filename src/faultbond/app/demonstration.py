"""`demo`: the main job on the built-in water tank."""

import shutil
import sys
from pathlib import Path

from faultbond.app.any_run import run
from faultbond.app.engine import engine_title
from faultbond.app.wishes import DEMO, Wanted
from faultbond.io.examples import example
from faultbond.io.out import Out
from faultbond.synthesis.compile import required_compiler

DEMO_RECORDING = "fault_pipe.csv"
DEMO_TRUTH = "What was made: at 1500 s the resistance K1 of the pipe rose to 1.85 times its value."


def demo(*, report: Path, out: Out) -> None:
    """Find a fault in the built-in water tank and write the report."""
    required_compiler()  # else it is told before anything else
    folder = example(DEMO)
    model, recording = (_near(folder / name) for name in ("model.yaml", DEMO_RECORDING))
    out.say(f"The built-in water tank: {recording}, 82 minutes, in which a fault was made at 1500 s.")
    out.say(f"Engine: {engine_title()}.")
    out.say()
    if out.text is not None:
        out.text.flush()
    run(model, str(recording), wanted=Wanted(report=report), out=out)
    out.say(f"\n{DEMO_TRUTH}")
    out.say(f"Open {report} in a browser. Then try:")
    program, healthy = _program(), _near(folder / "healthy.csv")
    out.say(f"  {program} check {model}")
    out.say(f"  {program} run {model} {healthy}")
    out.say(f"  {program} simulate {model} --inputs {healthy} --fault K6=x8@2460 --seed 1 -o leak.csv")
    out.say(f"  {program} run {model} leak.csv --report leak.html")


def _program() -> str:
    """Give how this program is called from here."""
    if shutil.which("faultbond"):
        return "faultbond"
    called = Path(sys.argv[0])
    if called.name == "__main__.py":
        return "python -m faultbond"
    return str(_near(called)) if called.name.startswith("faultbond") else "faultbond"


def _near(path: Path) -> Path:
    """Give a path as short as it can be written from here."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path
