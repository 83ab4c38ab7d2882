"""Method `classic`: the off-line part, which makes its functions from the routes of the analysis.

In: a bond graph. Out: a `ClassicPlan`. Read `functions`, `sides`, `tape_writer`, `torn`, `build`.
"""
