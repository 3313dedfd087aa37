"""``rift cache``: show or remove the compiled kernels that are kept."""

from __future__ import annotations

from rift_cl.cl.budget import format_bytes
from rift_cl.cl.build.kernel_cache import cache_folder, cache_size, clear_cache
from rift_cl.commands.cache.settings import CacheSettings


def run_cache(settings: CacheSettings) -> str:
    """Carry out the command and return the sentence to print."""
    if settings.clear:
        return f"{format_bytes(clear_cache())} removed from {cache_folder()}"
    return f"{format_bytes(cache_size())} in {cache_folder()}"
