"""Tracing of pictures, depth and light fields from a scene."""
