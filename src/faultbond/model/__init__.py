"""The plant as the user states it: bond graph, laws, units, text file, Python builder."""
