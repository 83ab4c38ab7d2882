"""The Python interface: what the verbs do, with the same words, on models and recordings in memory.

In: a model, a recording or a frame, and the options of a verb as keywords. Out: frozen results, in the units of the
model file and in SI. Read `plant_model`, `verbs`, `result`, `ranked`, `frame`, `plot`; then `live`,
`told`, `service` and `installation`.
"""
