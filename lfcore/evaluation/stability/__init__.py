"""Stiff and extreme cases: sweeps of a stiffness parameter, against float64 oracles."""
