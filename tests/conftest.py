"""What holds for all tests."""

import os

# Cores of tests run for moments, and are compiled in half the time; tests/unit/synthesis/test_compile.py compares them
# with those of users.
os.environ["FAULTBOND_HASTY"] = "1"
