"""What a plant's faults can be told by, before a sample is recorded or along a recording.

In: a plant's step and a run of it. Out: which sets are testable, which look alike, how small a fault is found, and
which sensor or move would tell more. Read `sensitivity`, `experiment`, `ranks`, `testable`, `groups`, `smallest`.
"""
