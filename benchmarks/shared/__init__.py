"""What several benchmarks use: plants and their runs, tables and pages, clocks, published models."""
