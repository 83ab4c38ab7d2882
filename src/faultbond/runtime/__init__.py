"""The on-line part: what runs beside the plant, on numbers alone; it needs numpy and nothing that knows a model.

In: a specification, an engine and samples. Out: a report for each, with a detection and diagnoses.
Read `state`, `packing`, `wild`, `start`, `monitor`, `alarm`, `bank`, `stepped`, `slotted`, `ranking`, `accepting`.
"""
