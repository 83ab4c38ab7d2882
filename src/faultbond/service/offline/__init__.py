"""Analyses of recordings that people bring, each in a process of its own with limits, beside what is watched.

In: files and orders from the page. Out: what the command line would have said and written.
Read `desk`, `job`, `shelf`, `child`, `confined`, `outcome`, `limits`.
"""
