"""What every command of ``lfcore`` begins with."""

from __future__ import annotations

import argparse


def add_command(
    commands, name: str, summary: str, description: str, epilog: str = ""
) -> argparse.ArgumentParser:
    """Add a command to the subparsers ``commands``; its texts keep their lines."""
    return commands.add_parser(
        name,
        help=summary,
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
