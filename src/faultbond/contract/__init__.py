"""What the off-line and the on-line part, and whoever reads a run, agree on: frozen data, and no plant in it.

In: a checked model, in array order. Out: `EngineSpec`, the lanes of the bank, what a run finds, and its records.
Read `spec` (what the on-line part must know), `lanes` and `slots` (how hypotheses are laid out), `findings`,
`json_records`.
"""
