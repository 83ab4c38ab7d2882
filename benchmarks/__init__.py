"""Measurements of the whole program, seconds to minutes each; `make bench` runs them."""
