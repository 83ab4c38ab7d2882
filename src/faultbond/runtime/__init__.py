"""The on-line part as Python sees it: the compiled core of a model at work. It needs numpy, and knows no model file.

In: a core and samples. Out: reports, with a detection and diagnoses, told by names.
Read `core`, `monitor`, `candidates`, `names`, `trace`, `allowed`.
"""
