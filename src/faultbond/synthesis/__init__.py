"""The filter of a plant as a graph, its C text, its compilation, and the virtual machine without a compiler.

In: a bond graph. Out: an `EngineSpec` and an `Engine`. Read `specify`, `filter`, `emit`, `compile`, `engine`.
"""
