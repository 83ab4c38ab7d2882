"""Measure monitor and bank: `python -m benchmarks.speed`."""

from benchmarks.speed.monitor import main

if __name__ == "__main__":
    main()
