"""Hostile inputs: ``python -m robustness.fuzz`` damages files and feeds them to the library."""
