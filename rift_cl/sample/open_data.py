"""Open data sets that tutorials, figures and tests of this package use, by name.

None of them comes with the package. A checksum is that of the copy which our figures were made of;
sets without an address of one file are downloaded by a person, from the page that is named.
"""

from __future__ import annotations

from typing import NamedTuple


class OpenData(NamedTuple):
    """A data set of other people.

    Args:
        about: what it is.
        file: the name of its file.
        size: bytes of the file.
        sha256: checksum of the file, in hexadecimal digits.
        licence: under which it may be used, as its source says.
        page: where it is described.
        url: address of the file; None where it has no address of its own.
        example: a command that reads it where ``rift samples NAME`` has put it.
    """

    about: str
    file: str
    size: int
    sha256: str
    licence: str
    page: str
    url: str | None
    example: str


OPEN_DATA = {
    "tooth": OpenData(
        about="X-ray projections of a tooth: parallel beam, 181 angles, 2 rows, flats and darks",
        file="tooth.h5",
        size=1_043_312,
        sha256="ab1d9bd073b7fb1beae4defa991c2a2626605c5cf1f4be0d0203656bc47b6489",
        licence="BSD-3-style (UChicago Argonne)",
        page="https://github.com/tomopy/tomopy",
        url="https://raw.githubusercontent.com/tomopy/tomopy/"
        "9e5f8617e614732d3dd3d22eb4c8fbca7b9dd40b/tomopy/data/tooth.h5",
        example="rift reconstruct tooth/tooth.h5 --out slices",
    ),
    "dendrites": OpenData(
        about="synchrotron sinogram of a magnesium alloy, with strong stripes: 360 angles, one row",
        file="RealDataDend.mat",
        size=1_555_994,
        sha256="915e342afd19a596e78976a372b12cf026b3d952e832219b5fabbf9ab1eb743a",
        licence="Apache-2.0 and GPL-3 (the repository's)",
        page="https://github.com/dkazanc/ToMoBAR",
        url="https://raw.githubusercontent.com/dkazanc/ToMoBAR/"
        "885afb46d7ce0490c38d0d5bfa9d39a7f1f81958/data/RealDataDend.mat",
        example="rift reconstruct dendrites/RealDataDend.mat --background 100 --center 629.5 "
        "--out slices",
    ),
    "disc": OpenData(
        about="fan-beam sinogram of an acrylic disc with holes over 30 degrees (Helsinki "
        "Tomography Challenge 2022)",
        file="tb_category7.mat",
        size=129_216,
        sha256="478650e0a1b2136a8185ff0fdb4d0133ef2801e86edc06cc3805708b32afb46f",
        licence="Apache-2.0 (the repository's); the challenge's own terms were not checked",
        page="https://github.com/robert-abc/HTC2022-Sparse-DIP",
        url="https://raw.githubusercontent.com/robert-abc/HTC2022-Sparse-DIP/"
        "1fbd3472659d0d7bfa7bdfe8e361162fbcd772e1/example/input/tb_category7.mat",
        example="rift reconstruct disc/tb_category7.mat --out slices",
    ),
    "walnut": OpenData(
        about="line integrals of a walnut, cone beam, 241 views of 256 x 256 bins, binned and "
        "cropped (Meaney 2022); packed as walnut_cone.npz in the source distribution of diffct "
        "1.3.1, with a NOTICE that goes with every copy",
        file="walnut_cone.npz",
        size=25_382_144,
        sha256="37879158555f5536f71a1a5ad7d0424499dc69fa2e6df9b829273cb5117c024e",
        licence="CC-BY 4.0",
        page="https://pypi.org/project/diffct/1.3.1/",
        url=None,
        example="rift reconstruct walnut/walnut_cone.npz --out volume",
    ),
}
