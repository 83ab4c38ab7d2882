"""Parameters and noise of a plant from healthy recordings, and what the model gets wrong there.

In: a model and its recordings (`session`). Out: estimates with standard errors, and a verdict on the healthy model.
Read `session`, `samples`, `likelihood`, `objective`, `ascent`, `identification`, `certainty`; then `trial`.
"""
