"""The fuzzer and the fault injector of the project: no input and no accident may do harm.

``python -m robustness.fuzz`` feeds damaged and hostile inputs to the library in forked children;
``python -m robustness.faults`` kills runs, fills disks and takes folders away.  See
docs/robustness.md.
"""
