"""Scenes in pbrt's file format: lexer, parser, interpreter, and what they make of it."""
