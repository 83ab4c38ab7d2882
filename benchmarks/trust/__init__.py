"""How often is it right, and does it keep what it promises? Simulated plants, for docs/trust.md and docs/figures.md."""
