"""The ``lfcore`` command: light fields and pictures from the command line.

A command reads options, calls the library, shows progress on standard error and writes files, which
appear whole or not at all.
"""

import argparse
import contextlib
import io
import os
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NoReturn

from lfcore import __version__
from lfcore.cli.interrupt import ending, interruptible, leave_at_once
from lfcore.errors import LfcoreError, did_you_mean, one_line

# Before NumPy is loaded: threads of BLAS spin, here for nothing.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
COMMANDS = {
    "record": ("render", "a light field file from a scene"),
    "render": ("render", "pictures straight from a scene, without storing a light field"),
    "refocus": ("stack", "pictures at any focus and aperture from a light field file"),
    "stack": ("stack", "focal and aperture stacks: pictures, contact sheet, MP4"),
    "view": ("view", "a light field file in the browser; one view or macropixel of it"),
    "info": ("inspect", "facts about a light field file; check it"),
    "depth": ("depth", "depth, disparity and an all-in-focus picture of a scene"),
    "plenoptic": ("plenoptic", "the photograph of a plenoptic camera, from a scene"),
    "import": ("exchange", "a light field file from another program's light field"),
    "export": ("exchange", "a light field file in another program's format"),
    "dataset": ("dataset", "a data set to learn from, of many scenes"),
    "imgtool": ("imgtool", "camera arrays: synthesise pictures, convert EXR"),
    "devices": ("inspect", "OpenCL devices; check each"),
}
DESCRIPTION = "Light fields: record a scene once, choose focus, aperture and view afterwards."
EPILOG = """examples:
  lfcore record example -o bike.mkv
  lfcore view bike.mkv -o bike.html
  lfcore refocus bike.mkv --focus 3.2 --f-number 2.8 -o bike.png
  lfcore stack bike.mkv --focus 2 3 4 6 -o focal.mp4
  lfcore render table.glb -o table.png --pixels 512

'lfcore COMMAND --help' explains each command with examples.
"""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, and whose values may be ``-1.5px``."""

    def __init__(self, *args: Any, **options: Any):
        super().__init__(*args, **options)
        self.formatter_class, self.allow_abbrev = argparse.RawDescriptionHelpFormatter, False
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        known, unknown = super().parse_known_args(args, namespace)
        if unknown and " " in self.prog:  # the whole program's error would not name the command
            option = unknown[0].partition("=")[0]
            near = did_you_mean(option, self._option_string_actions)
            hint = f". {near}" if near.startswith("Did") and option.startswith("-") else ""
            self.error(f"unknown: {' '.join(unknown)}{hint}")
        return known, unknown

    def error(self, message: str) -> NoReturn:
        choice = re.fullmatch(r"argument .*: invalid choice: '(.*)' \(choose from (.*)\)", message)
        if choice:
            near = did_you_mean(choice[1], [word.strip("'") for word in choice[2].split(", ")])
            message += f". {near}" * near.startswith("Did")
        self.exit(2, f"{one_line(f'{self.prog}: {message}')}. See '{self.prog} --help'.\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return the exit status.

    Errors of the user are one line on standard error, with status 1.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None:
        for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
            # Else a file of ours takes its number, and libraries in C write messages into it.
            if getattr(sys, name) is None:
                setattr(sys, name, open(os.open(os.devnull, os.O_RDWR), mode))
    for stream in (sys.stdout, sys.stderr):
        # A terminal that lacks a letter shows its code instead of ending the command.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with interruptible():
            arguments = parser(words).parse_args(words)
            arguments.run(arguments)
            sys.stdout.flush()
    except LfcoreError as error:
        return _failed(str(error))
    except BrokenPipeError:
        _forget_output()  # the reader has seen enough
        return 1
    except OSError as error:
        if argv is None:
            _forget_output()  # it may be what is full
        place = f"{error.filename}: " if error.filename else ""
        return _failed(one_line(f"{place}{error.strerror or error}."))
    except MemoryError:
        return _failed("There is not enough memory. Give fewer pixels, or fewer views.")
    except KeyboardInterrupt as error:
        status = _failed(*ending(error))
        if argv is None:
            leave_at_once(status)
        return status
    return 0


def _forget_output() -> None:
    """Discard output that would be flushed on exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _failed(message: str, status: int = 1) -> int:
    print(message, file=sys.stderr, flush=True)
    return status


def parser(argv: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """The parser, with the options of the command in ``argv``, or by default of all commands."""
    top = Parser("lfcore", description=DESCRIPTION, epilog=EPILOG)
    top.add_argument("--version", action="version", version=f"lfcore {__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    command = next((word for word in argv or () if not word.startswith("-")), None)
    for name, (module, summary) in COMMANDS.items():
        if argv is None or name == command:
            import_module(f"lfcore.cli.{module}").COMMANDS[name].add_to(commands, name, summary)
        else:
            commands.add_parser(name, help=summary)
    return top
