"""Networks of logic: all smallest diagnoses."""
