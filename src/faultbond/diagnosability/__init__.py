"""What the structure of a model says of its faults, on plain integers.

In: which equation contains which unknown (`structural`). Out: which faults are detectable and isolable, tests, sensors.
Read `structural`, `classes`, `isolability`, `overdetermined`, `placement`.
"""
