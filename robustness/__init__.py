"""The fuzzer and the fault injector.

``python -m robustness.fuzz`` feeds damaged and hostile inputs to the library in forked children;
``python -m robustness.faults`` kills runs, fills disks and removes folders.  See
docs/robustness.md.
"""
