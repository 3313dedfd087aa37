"""The tiles that an image is cut into, or some of their rows."""

from __future__ import annotations

from dataclasses import dataclass

from rift_cl.errors import InputError, ResourceLimitError

_MOST = 2**31 - 1


@dataclass(frozen=True)
class Tiles:
    """Rows of an image's tiles; tile t is in row ``first_row + t // across``.

    Args:
        across: tiles in a row.
        rows: rows of tiles.
        first_row: the image's row of tiles that they begin with.

    Raises:
        InputError: there are no tiles.
        ResourceLimitError: there are more than can be numbered.
    """

    across: int
    rows: int
    first_row: int = 0

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.across < 1 or self.rows < 1 or self.first_row < 0:
            raise InputError(
                f"Tiles: across, rows, first_row are {self.across}, {self.rows}, "
                f"{self.first_row}, wanted at least one tile"
            )
        if self.across * (self.first_row + self.rows) >= _MOST:
            raise ResourceLimitError(
                f"Tiles: {self.across} x {self.first_row + self.rows} are too many, wanted less "
                f"than {_MOST}: use larger tiles"
            )

    @classmethod
    def of(cls, size: tuple[int, int], edge: int) -> Tiles:
        """All tiles of an image of (height, width) pixels."""
        return cls(-(-size[1] // edge), -(-size[0] // edge))

    @property
    def count(self) -> int:
        """How many tiles there are."""
        return self.across * self.rows
