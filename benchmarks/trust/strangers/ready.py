"""A first model made quiet with what the product offers: `fit`, then what `check --data` says must be declared.

No number is set by hand; where data show ratios only, the parameter that gives the scale is named. `fit` takes three
healthy recordings; `check --data` puts the fitted model on trial on two others, and where it names one kind of number
that has to be declared so many times as large, that is done, once: of several the smallest factor. Where it names none,
the fitted model stays as it is.
"""

import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from benchmarks.trust.strangers.rig import Rig, record

HERE = Path(__file__).parent
FIT_SEEDS, TRIAL_SEEDS = (900, 901, 902), (903, 904)
NUMBER = re.compile(r"[0-9.]+(?:[eE][-+]?[0-9]+)?")
FIXED = {"two_mass_drive": ("Kt",)}  # current and speeds show ratios only: the scale is that of the data sheet
WORDS = {"accuracy": "accuracies", "noise": "noise of sensors", "slow": "slow errors"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Ready:
    """A model that may watch. told : what was done to it; first : whether the first model alarmed, by recording."""

    model: Path
    told: str
    first: tuple[bool, ...]


def faultbond(*words: str) -> str:
    """Run a verb; give its standard output. An exit code above 1 is an error."""
    done = subprocess.run([sys.executable, "-m", "faultbond", *words], capture_output=True, text=True, check=False)
    if done.returncode not in {0, 1}:
        raise RuntimeError(f"faultbond {' '.join(words)}: exit code {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def records_of(model: Path, recording: Path) -> list[dict[str, Any]]:
    """Give the records of a run."""
    return [json.loads(line) for line in faultbond("run", str(model), str(recording), "--json", "-").splitlines()]


def prepare(rig: Rig, folder: Path) -> Ready:
    """Fit the first model of a plant and let it be put on trial; what is in the folder from before is taken."""
    kept, ready = folder / f"{rig.name}.ready.json", folder / f"{rig.name}.ready.yaml"
    if kept.exists():
        told = json.loads(kept.read_text(encoding="utf-8"))
        return Ready(model=ready, told=told["told"], first=tuple(told["first"]))
    paths = {seed: folder / f"{rig.name}.{seed}.csv" for seed in (*FIT_SEEDS, *TRIAL_SEEDS)}
    for seed, path in paths.items():
        record(rig, (), seed).write(path)
    model, fitted = HERE / f"{rig.name}.yaml", folder / f"{rig.name}.fitted.yaml"
    alarmed = tuple(
        any(line["record"] == "detection" for line in records_of(model, paths[seed])) for seed in TRIAL_SEEDS
    )
    if not fitted.exists():  # it takes minutes
        options = [word for name in FIXED.get(rig.name, ()) for word in ("--fixed", name)]
        faultbond("fit", str(model), *(str(paths[seed]) for seed in FIT_SEEDS), "-o", str(fitted), *options)
    trial = faultbond("check", str(fitted), "--data", *(str(paths[seed]) for seed in TRIAL_SEEDS), "--json", "-")
    words, change = asked_for(json.loads(trial))
    text = fitted.read_text(encoding="utf-8")
    ready.write_text(text if change is None else rewritten(text, *change), encoding="utf-8")
    kept.write_text(json.dumps({"told": words, "first": alarmed}), encoding="utf-8")
    return Ready(model=ready, told=words, first=alarmed)


def asked_for(trial: Mapping[str, Any]) -> tuple[str, tuple[str, float] | None]:
    """Give what a trial asks for: in words, and which kind of number times which factor; None where nothing helps."""
    if trial["kept"]:
        return "fitted; quiet on trial", None
    needed = [(factor, kind) for kind, factor in trial["needed"].items() if factor is not None]
    if not needed:
        return "fitted; nothing is named that would make it quiet", None
    factor, kind = min(needed)
    return f"fitted; {WORDS[kind]} times {factor:g}", (kind, factor)


def rewritten(text: str, kind: str, factor: float) -> str:
    """Give a model file in which all numbers of a kind are so many times as large."""
    tree = yaml.load(text, Loader=yaml.BaseLoader)  # noqa: S506  texts only, no objects
    if kind == "noise":
        _scale(tree["sensors"], ("noise",), factor)
    elif kind == "slow":
        errors = tree.get("slow_error", {})
        _scale({"": errors}, tuple(name for name, item in errors.items() if isinstance(item, str)), factor)
        _scale(errors, ("size",), factor)
    else:
        _scale({"": tree}, ("accuracy",), factor)
        for part in (tree.get("blocks") or tree["components"]).values():
            _scale(part.get("parameters", {}), ("accuracy",), factor)
    return json.dumps(tree, indent=1)  # JSON is YAML


def _scale(table: Mapping[str, Any], keys: tuple[str, ...], factor: float) -> None:
    def larger(found: re.Match[str]) -> str:
        return f"{float(found[0]) * factor:.6g}"

    for item in table.values():
        for key in keys:
            if isinstance(item, dict) and key in item:
                item[key] = NUMBER.sub(larger, item[key], count=1)
