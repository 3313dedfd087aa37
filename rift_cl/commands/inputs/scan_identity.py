"""What tells one scan from another, and from itself before a change, while it is read too.

Rows are read from the files for as long as a run takes, which may be hours: whoever measures,
copies or mends a scan meanwhile would have slices of two scans in one volume.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from rift_cl.errors import InputError
from rift_cl.io.file_content import Content, file_states
from rift_cl.io.scans.scan_file import ScanFile


class WatchedScan:
    """A scan whose files are to stay as they are.

    Args:
        scan: just opened.

    Raises:
        InputError: a file cannot be read.
    """

    def __init__(self, scan: ScanFile) -> None:
        self._scan, self._files = scan, scan.files
        self._states = file_states(self._files)
        self.content = Content.of(self._files, scan.path)

    def identity(self) -> dict[str, Any]:
        """What decides the slices of a scan besides the settings: its content and its angles."""
        angles = np.ascontiguousarray(self._scan.angles).tobytes()
        digest = hashlib.sha256(angles).hexdigest()[:16]
        return {
            "scan": self.content.record(),
            "angles": f"{self._scan.angles.size} with the hash {digest}",
        }

    def check(self) -> None:
        """Make sure that it is still what was opened; a look at each file's record, mostly.

        Raises:
            InputError: it is not.
        """
        states = file_states(self._files)
        if states == self._states:
            return
        # One that was touched, or copied over itself, holds what it held.
        if all(states) and self.content.is_same(Content.of(self._files, self._scan.path)):
            self._states = states
            return
        raise InputError(
            f"{self._scan.path}: was changed while it was read, so that what is made of it would "
            "be a mixture: begin anew with --overwrite once nothing writes to it any more"
        )
