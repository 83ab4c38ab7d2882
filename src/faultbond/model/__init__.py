"""The plant as the user states it, a bond graph or a block network, checked and in SI.

In: a model file, or the calls of `ModelBuilder` in `builder`. Out: the `BondGraph` of `graph`, and its text again.
Read `document`, `source`, `yaml_nodes`, `keys`, `spot`, `resolve` with what it calls in turn (`head`, `wiring`,
`values`, `laws` or `blocks`, `measured`, `dimensions`), then `dump`; `expression`, `parser`, `units` and `quantities`
are what texts mean.
"""
