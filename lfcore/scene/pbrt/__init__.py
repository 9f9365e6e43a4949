"""Scenes in pbrt's file format: lexer, parser, interpreter, and what they make of it."""

from lfcore.scene.pbrt.build import PbrtScene, build_pbrt_scene
from lfcore.scene.pbrt.motion import Motion, scene_at
from lfcore.scene.pbrt.notes import Note, summary

__all__ = ["Motion", "Note", "PbrtScene", "build_pbrt_scene", "scene_at", "summary"]
