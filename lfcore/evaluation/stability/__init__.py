"""Stiff and extreme cases: a sweep of a stiffness parameter each, against float64 oracles."""
