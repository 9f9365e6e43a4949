"""A light field as one page for the browser: look around, focus, stop down."""
