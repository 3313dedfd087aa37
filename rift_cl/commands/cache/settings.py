"""What ``rift cache`` takes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CacheSettings:
    """Show where compiled kernels are kept and how much disk space they take, or remove them.

    What is known of drivers ('rift devices') is kept with them, and removed with them.

    Example: rift cache --clear
    """

    clear: bool = False
    """Remove all compiled kernels; the next run compiles them again."""
