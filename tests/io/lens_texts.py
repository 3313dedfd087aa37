"""Lens files to read and to damage: the Cooke triplet as Zemax writes it, the singlet changed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rift_cl.optics.lens_prescription import LensPrescription
from rift_cl.sample.stock_lenses import stock_lens

# The Cooke triplet as Zemax writes it, with lines that say nothing about rays.
TRIPLET = """VERS 140124 258 36214
MODE SEQ
NAME Cooke triplet, 50 mm f/5
PFIL 0 0 0
LANG 0
UNIT MM X W X CM MR CPMM
ENPD 1.0E+1
ENVD 2.0E+1 1 0
GCAT HIKARI SCHOTT
FTYP 0 0 3 3 0 0 0
XFLN 0.0E+0 0.0E+0 0.0E+0
YFLN 0.0E+0 1.4E+1 2.0E+1
WAVM 1 4.8E-1 1
WAVM 2 5.5E-1 1
WAVM 3 6.5E-1 1
WAVM 4 5.5E-1 1
PWAV 2
SURF 0
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ INFINITY
  DIAM 0 0 0 0 1 ""
"""
IMAGE = """SURF {}
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ 0
  DIAM 1.8E+1 0 0 0 1 ""
TOL TOFF   0   0              0              0   0 0 0
"""


def zemax(lens: LensPrescription) -> str:
    text = TRIPLET
    for index, surface in enumerate(lens.surfaces):
        text += f'SURF {index + 1}\n  TYPE STANDARD\n  CURV {surface.curvature!r} 0 0 0 0 ""\n'
        text += f"  HIDE 0 0 0\n  MIRR 2 0\n  DISZ {surface.thickness!r}\n"
        if index == lens.stop:
            text += "  STOP\n"
        if surface.glass:
            text += f"  GLAS {surface.glass.name} 0 0 1.5 4.0E+1 0 0 0 0 0 0\n"
        text += f'  DIAM {surface.semi_diameter!r} 0 0 0 1 ""\n'
    return text + IMAGE.format(len(lens.surfaces) + 1)


def changed(save: Callable[..., Path], **changes: Any) -> Path:
    """The singlet's file with fields changed; None removes one."""
    fields = {**json.loads(stock_lens("singlet").read_text("utf-8")), **changes}
    kept = {name: value for name, value in fields.items() if value is not None}
    return save(json.dumps(kept), "lens.json")
