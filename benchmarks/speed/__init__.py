"""How long does it take, beside other programs for the same work? For docs/speed.md and docs/figures.md."""
