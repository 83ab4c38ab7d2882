"""Measure the table of strangers' plants: `python -m benchmarks.trust.strangers`."""

from benchmarks.trust.strangers.table import main

if __name__ == "__main__":
    main()
