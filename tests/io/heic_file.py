"""A HEIC photograph of 804 bytes, made by hand round a frame of x265.

Stored are 64 x 48 pixels, blue with a pale corner (upper left) and a red one (lower right), which
the file says are shown turned by 90 degrees clockwise. EXIF has a maker, a model, the focal length
26 mm, the orientation 6, and an artist.
"""

import base64
import struct

HEIC = base64.b64decode("""
AAAAGGZ0eXBoZWljAAAAAG1pZjFoZWljAAABgW1ldGEAAAAAAAAAIWhkbHIAAAAAAAAAAHBpY3QAAAAAAAAA
AAAAAAAAAAAADnBpdG0AAAAAAAEAAAAsaWxvYwAAAABEAAACAAEAAAABAAABoQAAAQUAAgAAAAEAAAKmAAAA
fgAAADhpaW5mAAAAAAACAAAAFWluZmUCAAAAAAEAAGh2YzEAAAAAFWluZmUCAAAAAAIAAEV4aWYAAAAAGmly
ZWYAAAAAAAAADmNkc2MAAgABAAEAAADIaXBycAAAAKlpcGNvAAAAcWh2Y0MBBAgAAACfqAAAAAAe8AD8/fj4
AAAPAyAAAQAXQAEMAf//BAgAAAMAn6gAAAMAAB66AkAhAAEAJkIBAQQIAAADAJ+oAAADAAAeoCCDFlurkyub
AgAAAwACAAADAAIQIgABAAZEAcFzwIkAAAAUaXNwZQAAAAAAAABAAAAAMAAAAAlpcm90AwAAABNjb2xybmNs
eAABAA0ABoAAAAAXaXBtYQAAAAAAAAABAAEEgQKDBAAAAYttZGF0AAAAF0ABDAH//wQIAAADAJ+oAAADAAAe
ugJAAAAAJkIBAQQIAAADAJ+oAAADAAAeoCCDFlurkyubAgAAAwACAAADAAIQAAAABkQBwXPAiQAAALIoAa8E
+Nvy6+i/+/uy4PCeD+H6054SlDeHk6Ruob23XQl3/sNN0jqGFpUxqszzpGcRPguNseLHsa0MowcwFEvWAS4M
30K2rkf0DH4gRVgE9jQV823xtCEmVgVEFvONjb2xMSVKucw95rFjSeKpR6R/cOvAQgX/WNP736y5//npEkws
33tRCWUl8sqgdrX71xLQMVIm6PFpnsvFS0hcf3W9dU36p18cfaICiMA8Xbm77Ue8AAAABkV4aWYAAE1NACoA
AAAIAAUBDwACAAAABQAAAEoBEAACAAAACAAAAFABEgADAAAAAQAGAAABOwACAAAACQAAAFiHaQAEAAAAAQAA
AGIAAAAAQWNtZQAAUGhvbmUgMQBKYW5lIERvZQAAAAGkBQADAAAAAQAaAAAAAAAA
""")

# The box of its colours, and what grows with it: sizes of boxes, and where items begin.
_COLORS = HEIC[HEIC.index(b"colrnclx") - 4 :][:19]
_GROWN = (b"meta", b"iprp", b"ipco")
_PLACES = (b"\0\0\x01\xa1\0\0\x01\x05", b"\0\0\x02\xa6\0\0\0\x7e")


def heic_with_profile(profile: bytes) -> bytes:
    """The photograph with an ICC profile in place of numbers for its colours."""
    box = struct.pack(">I4s4s", 12 + len(profile), b"colr", b"prof") + profile
    more = len(box) - len(_COLORS)
    content = bytearray(HEIC)
    sizes = [HEIC.index(name) - 4 for name in _GROWN]
    for start in [*sizes, *map(HEIC.index, _PLACES)]:
        struct.pack_into(">I", content, start, struct.unpack_from(">I", HEIC, start)[0] + more)
    return bytes(content).replace(_COLORS, box)
