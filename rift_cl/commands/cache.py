"""``rift cache``: the compiled kernels that drivers keep."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.cl.budget import format_bytes
from rift_cl.cl.kernel_cache import cache_folder, cache_size, clear_cache


@dataclass(frozen=True)
class CacheSettings:
    """Show where compiled kernels are kept and how much room they take, or remove them.

    Example: rift cache --clear
    """

    clear: bool = False
    """Remove every compiled kernel; the next run compiles again."""


def run_cache(settings: CacheSettings) -> str:
    """Do it, and say what was done."""
    if settings.clear:
        return f"{format_bytes(clear_cache())} removed from {cache_folder()}"
    return f"{format_bytes(cache_size())} in {cache_folder()}"
