"""The words by which a scan's values and angles are named, in files, in Python and in options."""

from typing import Literal

Kind = Literal["counts", "transmission", "attenuation"]
AngleUnit = Literal["degrees", "radians"]
