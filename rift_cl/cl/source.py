"""Kernel sources: found beside the package, their includes put in line.

Folders are rooms for readers: a kernel is asked for by its name, whichever room it stands in.

OpenCL's ``-I`` breaks on folders with spaces in their names (PoCL 3.0), so ``#include "..."`` is
expanded here; ``#line`` directives keep the compiler's messages pointing at our own files. The
expanded text is the whole truth about a kernel, which makes any cache keyed by it right.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from rift_cl.errors import KernelBuildError

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')


@cache
def kernel_folder() -> Path:
    """The folder of kernels: inside an installed package, or beside an editable one."""
    package = Path(__file__).parents[1]
    inside, beside = package / "kernels", package.parent / "kernels"
    return inside if inside.is_dir() else beside


def kernel_names() -> list[str]:
    """Every kernel that is shipped; a kernel, its file and its entry point share one name."""
    return sorted(path.stem for path in kernel_folder().rglob("*.cl"))


@cache
def kernel_source(name: str) -> str:
    """The source of one kernel with its includes in line."""
    folder = kernel_folder()
    found = sorted(folder.rglob(f"{name}.cl"))
    file = found[0].relative_to(folder).as_posix() if found else f"{name}.cl"
    return "\n".join(_expand(file, set()))


def _expand(name: str, seen: set[str]) -> list[str]:
    seen.add(name)
    path = kernel_folder() / name
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise KernelBuildError(
            f"kernel source {name} is missing from {kernel_folder()}: reinstall rift-cl"
        ) from error
    lines, moved = [f'#line 1 "{name}"'], False
    for number, line in enumerate(text.splitlines(), start=1):
        match, onward = _INCLUDE.match(line), f'#line {number + 1} "{name}"'
        if match is None:
            lines.append(line)
            # Where a condition left an include out, it left out the directive behind it as well.
            if moved and line.startswith("#endif"):
                lines.append(onward)
                moved = False
        elif match[1] not in seen:
            lines += [*_expand(match[1], seen), onward]
            moved = True
        else:
            lines.append("")
    return lines
