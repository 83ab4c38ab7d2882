"""A first model made quiet with what the product offers: `fit --until-quiet` on five healthy recordings.

No number is set by hand; where data show ratios only, the parameter that gives the scale is named.
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.trust.strangers.rig import Rig, record

HERE = Path(__file__).parent
FIT_SEEDS, TRIAL_SEEDS = (900, 901, 902), (903, 904)  # the first model is put on trial on the latter, and made quiet
FIXED = {"two_mass_drive": ("Kt",)}  # current and speeds show ratios only: the scale is that of the data sheet


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
    model = HERE / f"{rig.name}.yaml"
    alarmed = tuple(
        any(line["record"] == "detection" for line in records_of(model, paths[seed])) for seed in TRIAL_SEEDS
    )
    options = [word for name in FIXED.get(rig.name, ()) for word in ("--fixed", name)]
    longer = ("--until-quiet", "--within", "1 h")  # a slow machine is to find the same models
    words = ("fit", str(model), *map(str, paths.values()), *longer, "-o", str(ready), *options, "--json", "-")
    records = {item["record"]: item for item in map(json.loads, faultbond(*words).splitlines())}
    told = told_of(records["quiet"])
    kept.write_text(json.dumps({"told": told, "first": alarmed}), encoding="utf-8")
    return Ready(model=ready, told=told, first=alarmed)


def told_of(found: Mapping[str, Any]) -> str:
    """Say what was done to a model, from the record of the fit."""
    added = [f"{item['kind']} of {item['of']}" for item in found["added"]]
    sizes = [f"{item['what']} times {item['times']:.2g}" for item in (*found["raised"], *found["lowered"])]
    state = "quiet" if found["quiet"] else "not quiet on all of them"
    return "; ".join(["fitted", *added, *sizes, state])
