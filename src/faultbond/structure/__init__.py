"""Causality and constraints: from a bond graph to an ordered list of solvable steps."""
