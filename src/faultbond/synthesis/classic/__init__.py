"""Method `classic`, the thesis' own: the off-line part, which makes its functions from the routes of the analysis."""
