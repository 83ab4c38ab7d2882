"""Filters as graphs, their C text, its compilation, and the virtual machine without a compiler."""
