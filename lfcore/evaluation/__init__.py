"""Metrics, timing, convergence, tables and plots."""
