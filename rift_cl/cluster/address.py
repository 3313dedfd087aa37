"""What ``--cluster`` says: workers of this machine, or where a scheduler answers."""

from __future__ import annotations

import re
from typing import NamedTuple

from rift_cl.errors import InputError

_LOCAL = re.compile(r"local:([0-9]{1,4})")
_ADDRESS = re.compile(
    r"(?!local:)((tcp|tls|ucx|ws|wss)://)?[^\s/:]+:[0-9]{1,5}|(tcp|tls)://\[[0-9a-fA-F:]+\]:[0-9]{1,5}"
)


class ClusterAddress(NamedTuple):
    """Where work goes.

    Args:
        text: as it was given.
        workers: processes to start on this machine; 0 where a scheduler is there already.
    """

    text: str
    workers: int

    @classmethod
    def of(cls, text: str) -> ClusterAddress:
        """Read ``local:N``, or the address of a scheduler.

        Raises:
            InputError: it is neither.
        """
        local = _LOCAL.fullmatch(text)
        if local is not None and int(local[1]) > 0:
            return cls(text, int(local[1]))
        if local is None and _ADDRESS.fullmatch(text):
            return cls(text, 0)
        raise InputError(
            f"--cluster is {text!r}, wanted local:N for N worker processes on this machine, or the "
            "address of a Dask scheduler, such as tcp://10.0.0.1:8786"
        )
