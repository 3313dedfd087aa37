"""What the studies are computed with: small and a few minutes, or the sizes of the protocol."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

Size = Literal["tiny", "quick", "full"]


@dataclass(frozen=True)
class Plan:
    """How the studies are computed.

    Args:
        size: ``full`` is the protocol's, ``quick`` a few minutes, ``tiny`` seconds, for tests.
        out: folder of the results.
        seeds: of targets, starts and noise; what is compared has the same ones.
        device: its name as the user gave it, for what opens it again.
    """

    size: Size
    out: Path
    seeds: tuple[int, ...]
    device: str | None = None

    def of(self, *, tiny: Any, quick: Any, full: Any) -> Any:
        """What belongs to the size."""
        return {"tiny": tiny, "quick": quick, "full": full}[self.size]

    def settings(self) -> dict[str, Any]:
        """What decides every study's result; JSON."""
        return {"size": self.size, "seeds": list(self.seeds)}
