"""Networks of logic: all smallest sets of gates that explain what was seen.

In: gates and observations, as a model file or as the diagnosis competition's circuits (`dxc`). Out: minimal diagnoses.
Read `circuit`, `regions`, `answers`, `diagnoses`, `hypotheses`.
"""
