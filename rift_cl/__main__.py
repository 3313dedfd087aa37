"""``python -m rift_cl`` is the command ``rift``."""

import sys

from rift_cl.commands.cli import main

if __name__ == "__main__":
    sys.exit(main())
