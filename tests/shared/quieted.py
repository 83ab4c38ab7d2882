"""What `fit --until-quiet` does to a first model by recordings of the plant as it really is."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.cli import DONE, main
from faultbond.io.recording import write_recording
from faultbond.model.text import parse_model
from faultbond.simulate import Inputs, simulate


def quiet_record(
    folder: Path, first: str, truth: str, moves: Callable[[int], FloatArray], step: float
) -> dict[str, Any]:
    """Fit a first model until quiet to two recordings of the true one; give the record of what was done.

    moves : gives the course of the only input, or a column for each, by the seed, one value each `step`, s
    """
    (folder / "first.yaml").write_text(first, encoding="utf-8")
    plant = parse_model(truth)
    for seed in (1, 2):
        values = moves(seed)
        inputs = Inputs(time=step * np.arange(float(len(values))), values=values.reshape(len(values), -1))
        made = simulate(plant, inputs, seed=seed)
        names = [*(item.name for item in plant.inputs), *(item.name for item in plant.sensors)]
        columns = zip(names, np.column_stack([made.inputs, made.outputs]).T, strict=True)
        write_recording(folder / f"{seed}.csv", {"time": made.time} | dict(columns))
    words = [folder / "first.yaml", folder / "1.csv", folder / "2.csv", "-o", folder / "new.yaml"]
    target = folder / "records.jsonl"
    assert main(["fit", *map(str, words), "--until-quiet", "--starts", "1", "--json", str(target)]) == DONE
    lines = map(json.loads, target.read_text(encoding="utf-8").splitlines())
    return next(item for item in lines if item["record"] == "quiet")
