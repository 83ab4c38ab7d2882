"""Method `classic`: the on-line part; it needs numpy only.

In: a `ClassicPlan` and samples. Out: error indices, a ranking of the tested sets, the same records as method `bank`.
Read `plan`, `prefilter`, `tape`, `models`, `estimate`, `indices`, `ranking`, `watch`,
`rule`.
"""
