"""What makes the manual's site of docs/: pages that are run, options, docstrings, figures."""
