"""The samples of the self-test as a table in C, for machines that read no files, and what `run` says of them."""

import json

from faultbond.arrays import FloatArray
from faultbond.synthesis.emit import literal

_HEAD = """/* The recorded samples of the self-test as the library takes them: time and the step before it, s, inputs,
   readings, SI; and what `run` says of them: the time of the alarm, -1: none, and the first suspect of the likeliest
   candidate at the end. */
#ifndef CHECK_SAMPLES_H
#define CHECK_SAMPLES_H

#include <math.h>
"""


def samples_text(samples: FloatArray, records: str) -> str:
    """Give `check/samples.h`.

    Parameters
    ----------
    samples : (n_samples, 2 + n_inputs + n_sensors): time, step (s), inputs, readings, SI, nan where missing
    records : the JSON lines that `run` writes of them
    """
    told = [json.loads(line) for line in records.splitlines()]
    alarm = next((record["time"] for record in told if record["record"] == "detection"), -1.0)
    diagnoses = [record["candidates"] for record in told if record["record"] == "diagnosis"]
    best = diagnoses[-1][0] if diagnoses and diagnoses[-1] else None
    name = next(iter(best["parameters"])).split(".")[0] if best else ""
    rows = ",\n".join(f"    {{{', '.join(literal(float(value)) for value in row)}}}" for row in samples)
    return "\n".join(
        [
            _HEAD,
            f"#define N_SAMPLES {len(samples)}",
            f"#define EXPECTED_ALARM {literal(float(alarm))}",
            f'#define EXPECTED_BEST "{name}"',
            f"#define EXPECTED_PROBABILITY {literal(float(best['probability'] if best else 0.0))}",
            "",
            f"static const double SAMPLES[N_SAMPLES][{samples.shape[1]}] = {{",
            rows,
            "};",
            "",
            "#endif",
            "",
        ]
    )
