"""Kernel sources: found beside the package, their includes put in line.

Folders are rooms for readers: a kernel is asked for by its name, whichever room it stands in.

OpenCL's ``-I`` breaks on folders with spaces in their names (PoCL 3.0), so ``#include "..."`` is
expanded here; ``#line`` directives keep the compiler's messages pointing at our own files. The
expanded text is the whole truth about a kernel, which makes any cache keyed by it right.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from rift_cl.errors import KernelBuildError

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
_LINE = re.compile(r'#line (\d+) "(.+)"')
_OWN_PLACE = re.compile(r"([\w./-]+\.(?:cl|h)):(\d+)")
_COUNTED_PLACE = re.compile(
    r"^[^:\n]*:(\d+):(?:\d+:)? *(?:fatal )?error", re.MULTILINE | re.IGNORECASE
)


@cache
def kernel_folder() -> Path:
    """The folder of kernels: inside an installed package, or beside an editable one."""
    package = Path(__file__).parents[2]
    inside, beside = package / "kernels", package.parent / "kernels"
    return inside if inside.is_dir() else beside


def kernel_names() -> list[str]:
    """Every kernel that is shipped; a kernel, its file and its entry point share one name."""
    return sorted(path.stem for path in kernel_folder().rglob("*.cl"))


@cache
def kernel_room(name: str) -> str:
    """The folder that a kernel stands in, its subject; empty where there is no such kernel."""
    found = sorted(kernel_folder().rglob(f"{name}.cl"))
    return found[0].parent.name if found else ""


@cache
def kernel_source(name: str) -> str:
    """The source of one kernel with its includes in line."""
    folder = kernel_folder()
    found = [path.relative_to(folder).as_posix() for path in sorted(folder.rglob(f"{name}.cl"))]
    if len(found) > 1:
        raise KernelBuildError(
            f"two kernels are called {name}, in {' and '.join(found)}: give one another name"
        )
    if not found and (near := get_close_matches(name, kernel_names(), 1)):
        raise KernelBuildError(f"no kernel is called {name}; did you mean {near[0]}?")
    return "\n".join(_expand(found[0] if found else f"{name}.cl", set()))


def fault_place(name: str, log: str) -> str:
    """Where a compiler found fault with a kernel: its file and line, or the file alone.

    A compiler that heeds ``#line`` says it. Others (NVIDIA's) count the lines of the whole text
    and call it by a name of their own, as in ``<kernel>:31:5: error``.
    """
    place = _OWN_PLACE.search(log)
    if place:
        return f"{place[1]}:{place[2]}"
    counted = _COUNTED_PLACE.search(log)
    lines = kernel_source(name).splitlines()[: int(counted[1])] if counted else []
    file, number = f"{name}.cl", 0
    for line in lines:
        directive = _LINE.fullmatch(line)
        if directive:
            file, number = directive[2], int(directive[1]) - 1
        else:
            number += 1
    return f"{file}:{number}" if number else file


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
