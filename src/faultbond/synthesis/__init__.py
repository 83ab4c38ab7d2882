"""What a model adds to the core in C, its compilation, and the same filter as a graph where there is no compiler.

In: a bond graph. Out: an `EngineSpec` and an `Engine`. Read `specify`, `model_text`, `emit`, `compile`, `engine`; then
`filter` and `machine`. The core itself, which is the same for all models, is C: `faultbond/core/core.c`.
"""
