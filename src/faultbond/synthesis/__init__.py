"""What a model adds to the core in C, and its compilation.

In: a bond graph. Out: an `EngineSpec` and an `Engine`. Read `specify`, `model_text`, `emit`, `compile`, `engine`. The
core itself, which is the same for all models, is C: `faultbond/core/core.c`.
"""
