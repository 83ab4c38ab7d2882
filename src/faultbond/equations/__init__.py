"""From a bond graph to equations that can be solved in order, and to one step of the plant in time.

In: a `BondGraph`. Out: causal strokes, constraint and component network, f and h with their slopes as CasADi graphs.
Read `causality`, `constraint_network`, `matching`, `sequence`, `plant`, `step`; `component_network` is what the
constraint analysis goes on from.
"""
