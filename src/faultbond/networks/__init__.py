"""Networks without time: what explains their observations, row by row.

In: a static network and its rows. Out: a detection at the first row that contradicts it, then the minimal diagnoses.
Read `static_network`, `relations`, `detection`, `hypothesis` (without noise), `noise_hypotheses` (with it);
gates: `logic`.
"""
