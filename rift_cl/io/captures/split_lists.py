"""nerfstudio's lists of photographs: 'train_filenames', 'val_filenames', 'test_filenames'.

A photograph of the last two is held out. One that no list names is trained on where nothing is
said of training, held out where nothing else is said, and left alone where both are. A list may
leave out the folders of a photograph, where no other has its name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from rift_cl.io.captures.view import Split, View
from rift_cl.io.json_fields import Fields

_TRAINED, _SCORED = "train_filenames", ("val_filenames", "test_filenames")


def split_by_lists(top: Fields, views: Sequence[View]) -> tuple[tuple[View, ...], list[str]]:
    """Views with what the lists want of them, and what is wrong with the lists, in sentences.

    Args:
        top: the file's own fields.
        views: its frames.

    Raises:
        FileFormatError: a list is none, or holds something else than names.
    """
    lists = {name: top.texts(name) for name in (_TRAINED, *_SCORED) if name in top}
    if not any(lists.values()):
        return tuple(views), []
    whole = _by_last_name(views)
    trained = {whole(name) for name in lists.get(_TRAINED, ())}
    scored = {whole(name) for list_ in _SCORED for name in lists.get(list_, ())}
    named: dict[str, Split] = dict.fromkeys(trained, "train")
    named |= dict.fromkeys(scored, "test")
    other: Split = "train" if not trained else "none" if scored else "test"
    found = tuple(replace(view, split=_split(view.name, named, other)) for view in views)
    return found, _notes(top, found, trained & scored, named)


def _by_last_name(views: Sequence[View]) -> Callable[[str], str]:
    """What brings a name of a list into the form of those of the views, with their folders."""
    counts = Counter(PurePosixPath(_plain(view.name)).name for view in views)
    only = {PurePosixPath(name).name: name for name in (_plain(view.name) for view in views)}
    known = {form(view.name) for view in views for form in (_plain, _bare)}

    def whole(name: str) -> str:
        plain = _plain(name)
        return only[plain] if plain not in known and counts[plain] == 1 else plain

    return whole


def _split(name: str, named: dict[str, Split], other: Split) -> Split:
    """That of the photograph's name, whose suffix a list may leave out."""
    return named.get(_plain(name)) or named.get(_bare(name)) or other


def _plain(name: str) -> str:
    """A path as all that lead to the same place are written."""
    return PurePosixPath(name.replace("\\", "/")).as_posix()


def _bare(name: str) -> str:
    return Path(_plain(name)).with_suffix("").as_posix()


def _notes(
    top: Fields, views: Sequence[View], both: set[str], named: dict[str, Split]
) -> list[str]:
    notes = []
    if both:
        notes.append(
            f"{top.where}: {len(both)} photographs, such as {min(both)}, are listed to be trained "
            "on and to be scored: they are scored"
        )
    known = {form(view.name) for view in views for form in (_plain, _bare)}
    if strange := sorted(named.keys() - known):
        notes.append(
            f"{top.where}: {len(strange)} names in the lists of photographs, such as {strange[0]}, "
            "belong to no frame"
        )
    if alone := sum(view.split == "none" for view in views):
        notes.append(
            f"{top.where}: {alone} of {len(views)} photographs are in no list, neither to be "
            "trained on nor to be scored"
        )
    return notes
