"""How does it do on recordings of others and beside their methods? For docs/trust.md and docs/figures.md."""
