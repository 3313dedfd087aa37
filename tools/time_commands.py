"""The processor time that a command needs to answer ``--help``, beside that of ``rift --version``.

    python tools/time_commands.py

Prints the median over several processes of user and system time, in seconds. How many modules a
help loads is pinned by a test; the time depends on the machine and is only shown.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys

from rift_cl.commands.cli import COMMANDS

_RUNS = 7


def processor_time(*arguments: str) -> float:
    """Median user and system time of ``rift`` with these arguments, in seconds."""
    times = []
    for _ in range(_RUNS):
        before = os.times()
        subprocess.run(
            [sys.executable, "-m", "rift_cl", *arguments], stdout=subprocess.DEVNULL, check=True
        )
        after = os.times()
        times.append(
            after.children_user
            - before.children_user
            + after.children_system
            - before.children_system
        )
    return statistics.median(times)


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    version = processor_time("--version")
    print(f"{'rift --version':<26} {version:6.3f} s")
    for arguments in (["--help"], *([*name.split(), "--help"] for name in COMMANDS)):
        spent = processor_time(*arguments)
        print(f"{' '.join(['rift', *arguments]):<26} {spent:6.3f} s  {spent - version:+.3f}")


if __name__ == "__main__":
    main()
