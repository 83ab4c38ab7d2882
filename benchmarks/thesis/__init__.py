"""What does the thesis print, and what do its methods give today? Its tables and figures, for docs/thesis.md."""
