"""Solving routes: closed forms, roots, noise."""
