"""Scenes in pbrt's file format: lexer, parser, interpreter, and what they make of it."""

from lfcore.scene.pbrt.build import build_pbrt_scene

__all__ = ["build_pbrt_scene"]
