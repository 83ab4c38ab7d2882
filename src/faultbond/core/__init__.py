"""The on-line core in C: what is the same for every model."""
