"""Unposed input of ``rift fit``: a folder of photographs, or a video.

Poses are found first, and of a video the frames; both are kept in the folder of the fit, so that a
fit that goes on has the very same.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from pathlib import Path

from rift_cl.io.captures.capture import Capture, holds_bare_photographs, open_capture
from rift_cl.io.captures.colmap_process import check_pycolmap
from rift_cl.io.captures.other_cameras import other_cameras
from rift_cl.io.captures.photograph_folder import (
    other_files,
    photograph_names,
    photographs_in,
    unread_photographs,
    with_headers,
)
from rift_cl.io.captures.photographs import check_photographs, pose_photographs
from rift_cl.io.captures.video import check_video, holds_video, sharpest_frames, video_notes
from rift_cl.progress import Report

# Names that a sentence lists.
_LISTED = 4


class BareInput:
    """Unposed photographs; nothing is read yet.

    Args:
        source: their folder, or a video.
        out: the folder of the fit.
        frames: how many frames are taken of a video.
        seed: of all that the search for poses draws by chance.

    Raises:
        InputError: there are too few photographs, or a library is missing that is wanted.
    """

    def __init__(self, source: Path, out: Path, *, frames: int, seed: int) -> None:
        self.source, self._frames, self._seed = source, frames, seed
        self._video = holds_video(source)
        self.folder = out / "frames" if self._video else source
        self._posed = out / "poses"
        # What is to be said of the input, a sentence each; more once its poses are found.
        self.notes: list[str] = []
        self.photographs = 0
        if self._video:
            check_video(source)
            if not self._posed.exists():
                check_pycolmap()
        elif not self._posed.exists():
            check_photographs(source)
        if not self._video:
            self.notes += _left_alone(source)

    @staticmethod
    def fits(source: Path) -> bool:
        """Whether a path is a video or a folder of photographs without poses."""
        return holds_video(source) or holds_bare_photographs(source)

    @property
    def words(self) -> str:
        """What it is, for people."""
        what = f"a video: {self._frames} sharp frames and" if self._video else "bare photographs:"
        return f"{self.source}, {what} their poses are found first"

    def sizes(self) -> list[tuple[int, int]]:
        """(height, width) of the photographs whose headers can be read; none of a video's frames.

        Raises:
            PathEscapeError: a photograph is a link that leads out of the folder.
        """
        if self._video:
            return []
        place = photographs_in(self.folder)
        found = with_headers(place, photograph_names(place), {})
        return [one.header.shown_size for one in found]

    def find(self) -> Generator[Report, None, Capture]:
        """Find the poses.

        Raises:
            RiftError: see ``pose_photographs`` and ``sharpest_frames``.
        """
        if self._video:
            taken, total = yield from sharpest_frames(self.source, self.folder, self._frames)
            self.notes.append(f"{taken} of the video's {total} frames are taken, the sharpest")
            self.notes += video_notes(self.source)
        found = yield from pose_photographs(self.folder, self._posed, seed=self._seed)
        self.photographs = len(found.placed) + len(found.missing)
        if found.missing:
            self.notes.append(_left_out(found.missing, self.photographs))
        capture = open_capture(found.model, images=self.folder)
        self.notes.append(_placed(capture, self.photographs))
        return capture


def _left_alone(folder: Path) -> list[str]:
    """What of a folder is not used: poses and photographs that are not read, and other files."""
    place = photographs_in(folder)
    notes = [f"poses are found anew: {note}" for note in other_cameras(place.root)]
    if unread := unread_photographs(place):
        count = f"{len(unread)} photographs are of formats that are"
        if len(unread) == 1:
            count = "a photograph is of a format that is"
        notes.append(f"{count} not read: {listed(unread)}; convert to PNG or JPEG to use them")
    if others := other_files(place):
        count = f"{len(others)} files that are no photographs are"
        if len(others) == 1:
            count = "a file that is no photograph is"
        notes.append(f"{count} left alone: {listed(others)}")
    return notes


def _placed(capture: Capture, count: int) -> str:
    """How many photographs have a pose, and how well the poses agree with them."""
    placed = f"{len(capture.views)} of {count} photographs have a pose"
    error = capture.reprojection_error
    if error is None:
        return placed
    return f"{placed}; their sparse points are seen {error:.2g} pixels off, on average"


def _left_out(missing: Mapping[str, str], count: int) -> str:
    """Which photographs have no pose, and why."""
    reasons = [f"{name} ({reason})" for name, reason in missing.items()]
    verb = "is" if len(missing) == 1 else "are"
    return f"{len(missing)} of {count} photographs {verb} left out: {listed(reasons)}"


def listed(words: Sequence[str]) -> str:
    """A few words in a row, and how many more there are."""
    more = len(words) - _LISTED
    return ", ".join(words[:_LISTED]) + (f" and {more} more" if more > 0 else "")
