"""Data sets to learn from: scenes drawn from a description, their pictures, their card."""
