"""Write the page of the thesis: `python -m benchmarks.thesis`."""

from benchmarks.thesis.chapters import main

if __name__ == "__main__":
    main()
