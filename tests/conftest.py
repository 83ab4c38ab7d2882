"""What holds for all tests."""

import os

# Cores of tests run for moments. What runs for every lane, the filters, is compiled as for users all the same; and
# tests/unit/synthesis/test_compile.py compares the one with the other.
os.environ["FAULTBOND_HASTY"] = "1"
