"""Measurements of the whole program, by question: `thesis`, `trust`, `speed`, `peers`; `make bench` runs them."""
