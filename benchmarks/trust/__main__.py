"""Measure the table of trust: `python -m benchmarks.trust`."""

from benchmarks.trust.table import main

if __name__ == "__main__":
    main()
