"""``lfcore dataset``: a data set from its description."""

import argparse
from pathlib import Path

import lfcore
from lfcore.cli import values
from lfcore.cli.command import Command, add
from lfcore.cli.progress import progress, wrote
from lfcore.timing import processors

DESCRIPTION = """\
Make a data set to learn from: draw scenes from a description, trace their pictures, and write
items, tables, a card and a page. Items that the folder has already are kept."""
EPILOG = """\
examples:
  lfcore dataset config/datasets/micro.yaml -o micro
  lfcore dataset mine.yaml -o mine --processes 1
      one process with all threads, for little memory or a GPU

A checkout's workflow does the same on a cluster. Needs pip install 'lfcore[workflow]'.
"""


def options(command: argparse.ArgumentParser) -> None:
    command.add_argument("description", type=Path, help="YAML file with the mapping 'dataset'")
    command.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER",
        help="folder of the set; an earlier set in it is extended, or replaced when this is whole",
    )  # fmt: skip
    command.add_argument(
        "--processes", type=values.count(1, 1024), metavar="N",
        help="processes side by side, with a thread each (one per processor)",
    )  # fmt: skip
    add(command, "device")


def run(arguments: argparse.Namespace) -> None:
    with progress("making items", "jobs") as report:
        lfcore.make_dataset(
            arguments.description, arguments.output, device=arguments.device, progress=report,
            processes=arguments.processes or processors(),
        )  # fmt: skip
    wrote(arguments.output)


COMMANDS = {"dataset": Command(DESCRIPTION, EPILOG, options, run)}
