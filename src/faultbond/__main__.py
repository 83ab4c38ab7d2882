"""`python -m faultbond` is the command line."""

import sys

from faultbond.cli import main

if __name__ == "__main__":
    sys.exit(main())
