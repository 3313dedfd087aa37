"""The settings of ``rift reconstruct``, and which of them apply to which method."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.commands.options import SpreadRun, check_tilt, without_place
from rift_cl.errors import InputError
from rift_cl.option_marks import Auto, AutoExpert, Expert
from rift_cl.own_parts import decisive_parts

if TYPE_CHECKING:
    from rift_cl.io.scans.scan_file import ScanFile
    from rift_cl.operators import Filter

SOLVERS = ("sirt", "cgls", "tv")
ITERATIVE = (*SOLVERS, "levels")
Switch = Literal["auto", "on", "off"]
Compensation = Literal["uniform", "voronoi", "covered", "capped-voronoi", "pipe-menon", "exact"]
# Options that apply to some methods only; with another one they are refused.
_ONLY = {
    "filter": ("fbp",),
    "cutoff": ("fbp",),
    "exponent": ("fbp",),
    "compensate": ("fbp",),
    "steps": ITERATIVE,
    "noise": SOLVERS,
    "weights": SOLVERS,
    "subsets": ("sirt",),
    "precondition": SOLVERS,
    "weight": ("tv", "levels"),
    "nonnegative": ("sirt", "tv"),
}
# Default iterations: SIRT converges slowly, CGLS amplifies noise when it runs for long.
_STEPS = {"sirt": 100, "cgls": 30, "tv": 200, "levels": 1200}
# Preconditioned CGLS is near its best after the first few iterations.
_PRECONDITIONED_CGLS = 4
# Least passes over all subsets.
_FEWEST_PASSES = 5
# What may differ between a run and the one that resumes it: it changes no bit of the result.
_FREE = (
    *("scan", "out", "device", "memory", "format", "dtype", "window"),
    *("overwrite", "resume", "dry_run", "preview", "config", "cluster"),
    "part_timeout",
)


@dataclass(frozen=True, kw_only=True)
class MethodOptions:
    """How projections become slices."""

    group: ClassVar[str] = "method"

    method: Literal["fbp", "backproject", "sirt", "cgls", "tv", "levels"] = "fbp"
    """Filtered backprojection (fbp), unfiltered backprojection, least squares by SIRT or CGLS
    (sirt, cgls), least squares with total variation (tv), or, for limited angles, one homogeneous
    disc with holes (levels)."""
    filter: Auto[str] = None
    """fbp: filter along the detector: ram-lak, shepp-logan, cosine, hamming, hann, high-pass, or
    the name of a registered one. Default: ram-lak."""
    cutoff: Auto[float] = None
    """fbp: cut-off of the filter, as a fraction of the Nyquist frequency. Default: 1."""
    exponent: AutoExpert[float] = None
    """fbp: exponent p of the high-pass filter |f|^p. Default: 1, the ramp."""
    compensate: AutoExpert[Compensation] = None
    """fbp: density compensation for irregular angles. Default: covered, half the gaps to a view's
    neighbours as voronoi, but for holes such as the missing wedge; of cones and fans voronoi."""
    footprint: AutoExpert[Literal["strip", "joseph", "linear"]] = None
    """Project in real space: a pixel is spread over the bins by shared area (strip), or by linear
    interpolation between pixels (joseph) or between bins (linear). Default: see --error."""
    error: AutoExpert[float] = None
    """Project through the Fourier transform with this relative error, such as 1e-3. Default, if
    --footprint is not given either: the cheaper of the Fourier transform with 1e-3 (slices of more
    than about 150 samples on a CPU; costs fbp less than 0.05 dB) and --footprint strip."""
    steps: Auto[int] = None
    """sirt, cgls, tv, levels: maximum number of iterations per slice. Default: sirt 100 (divided by
    --subsets, at least 5), cgls 30 (4 with --precondition), tv 200, levels 1200."""
    subsets: AutoExpert[int] = None
    """sirt: number of ordered subsets of the views; the image is updated after each, which saves
    iterations by about that factor. Default: 1."""
    noise: Auto[float] = None
    """sirt, cgls, tv: standard deviation of the noise of a line integral; iterations stop when the
    residual reaches it (discrepancy principle). Default: all --steps are taken, which of noisy data
    make slices noisier than those of fbp; of parallel and fan beams a sentence tells what noise
    the data show."""
    weight: Auto[float] = None
    """tv, levels: weight of the total variation; larger is smoother. Default: chosen from the noise
    and the number of the projections (levels: from their values), and printed; try half and twice
    of it."""
    nonnegative: bool = False
    """sirt, tv: constrain the slice to be non-negative."""
    weights: AutoExpert[Literal["counts"]] = None
    """sirt, cgls, tv: weight each ray by its photon count (penalized weighted least squares), which
    reduces streaks behind metal. Default: all rays count alike."""
    precondition: AutoExpert[Literal["ramp", "capped-voronoi"]] = None
    """sirt, cgls, tv: filter that preconditions the residual, which saves iterations. Default:
    none."""


@dataclass(frozen=True, kw_only=True)
class GeometryOptions:
    """Where the rotation axis is, and what part of the object is reconstructed."""

    group: ClassVar[str] = "geometry"

    center: Auto[float] = None
    """Detector bin of the rotation axis. Default: found automatically; if the data of a fan or a
    cone do not tell it, that of the file, or the middle of the detector."""
    tilt: Auto[float] = None
    """Tilt of the rotation axis in the detector plane in degrees, positive where its bin grows with
    the row. Default: the tilt found with the axis if it moves the axis by a quarter of a bin or
    more and the rows agree on it, otherwise 0."""
    centers: AutoExpert[Path] = None
    """File with the bin of the rotation axis in every detector row (.txt, .csv or .npy), for an
    axis that drifts; replaces --center and --tilt."""
    half_acquisition: Expert[Literal["weighted", "stitched"]] = "weighted"
    """For full turns with the axis off the middle of the detector: weight opposite views, which
    may leave a hole of 15 degrees, or stitch them into wider views over 180 degrees."""
    rows: Auto[tuple[int, int]] = None
    """First detector row and the one after the last; of cone beams, slices of the volume. Default:
    all."""
    pitch: Auto[float] = None
    """Distance between detector bins, in --unit; that between rows is scaled alike, unless
    --row-pitch says it. Default: that of the file, or 1."""
    row_pitch: AutoExpert[float] = None
    """Distance between detector rows, in --unit. Default: that of the file, or that between
    bins."""
    unit: Auto[str] = None
    """Unit of length of pitch, voxels and values: m, cm, mm, um, nm, pm, angstrom or inch. A file's
    lengths in another unit are converted to it. Default: that of the file, or bin."""
    pixel: Auto[float] = None
    """Distance between samples of a slice. Default: that between bins, at the rotation axis."""
    size: Auto[int] = None
    """Samples along each side of a slice. Default: as many as cover the detector."""
    roi: Auto[tuple[int, int, int, int]] = None
    """Part of the slice: first column and the one after the last, first line and the one after the
    last. Default: all of it."""
    pad: Expert[Switch] = "auto"
    """Extend the projections of an object that is wider than the detector; auto does where they do
    not end at zero."""


@dataclass(frozen=True, kw_only=True)
class CorrectionOptions:
    """What is corrected before the reconstruction."""

    group: ClassVar[str] = "correction"

    rings: Literal[
        "auto",
        "off",
        "on",
        "vo",
        "sorting",
        "filtering",
        "fitting",
        "large",
        "dead",
        "wavelet-fft",
    ] = "auto"
    """Ring removal: the filters of Vo, Atwood and Drakopoulos (2018), of which vo (or on) combines
    dead, large and sorting, or wavelet-fft of Muench et al. (2009). auto is vo for counts or
    transmission over 150 degrees or more, otherwise off."""
    zingers: Auto[float] = None
    """Replace zingers (single pixels hit by cosmic rays or scattered photons) that exceed their
    neighbours by this many standard deviations of the noise, such as 6; of scans of line
    integrals also those that fall short of them. Default: off."""
    hardening: Auto[tuple[float, ...]] = None
    """Beam hardening of one material: coefficients a1 a2 ... of the polynomial a1 y + a2 y^2 + ...
    that makes line integrals y proportional to thickness. Default: off."""
    binning: int = 1
    """Average blocks of N detector rows and N bins first; --center, --pitch and --tilt still
    refer to the detector before binning, and so does --rows, except for cones, whose --rows are
    slices of the volume after binning."""
    delta_beta: Auto[float] = None
    """Phase retrieval after Paganin et al. (2002) for a parallel beam and one material: the ratio
    delta / beta of its refractive index; needs --energy, --propagation and a pitch in a unit of
    length. Default: off."""
    energy: Auto[float] = None
    """Phase retrieval: photon energy in keV."""
    propagation: Auto[float] = None
    """Phase retrieval: distance from the sample to the detector in millimetres."""


@dataclass(frozen=True, kw_only=True)
class VolumeOutput:
    """What is written."""

    group: ClassVar[str] = "output"

    out: Path = Path("rift-reconstruct")
    """Folder for the slices, preview.png, report.html, config.json and metrics.json."""
    format: Literal["tiff", "tiff-stack", "zarr", "h5", "mrc"] = "tiff"
    """A folder of TIFF slices, one TIFF stack (both with ImageJ metadata), a multi-resolution
    OME-Zarr store, one HDF5 file, or one MRC file."""
    dtype: Literal["float32", "uint16", "uint8"] = "float32"
    """Sample type of the volume; integers cover --window."""
    window: AutoExpert[tuple[float, float]] = None
    """For integer samples: attenuation of the smallest and the largest integer. Default: of uint16
    the range of all slices; of uint8 that of 99.8 % of the values of a few slices, with a
    margin."""
    preview: bool = False
    """Reconstruct only the middle slice, as preview.png, and estimate the time for all. Of cone
    beams, for fbp and backproject only."""


@dataclass(frozen=True)
class ReconstructSettings(
    SpreadRun, VolumeOutput, CorrectionOptions, GeometryOptions, MethodOptions, ScanInput
):
    """Reconstruct a scan of parallel, fan or cone beams.

    Example: rift reconstruct scan.h5 --out slices --filter shepp-logan --format zarr
    """

    def check(self) -> None:
        """Check what depends on nothing but the settings.

        Raises:
            InputError: a value is out of its range, or an option does not apply to the method.
        """
        usual = {field.name: field.default for field in dataclasses.fields(self)}
        for name, methods in _ONLY.items():
            if getattr(self, name) != usual[name] and self.method not in methods:
                raise InputError(
                    f"--{name} does not apply to --method {self.method}: leave it out, or choose "
                    f"--method {' or '.join(methods)}"
                )
        # Made now, so that its arguments are checked before any work.
        self.view_filter()
        least = {"steps": 1, "size": 1, "background": 0, "subsets": 1, "binning": 1}
        for name, bound in least.items():
            value = getattr(self, name)
            if value is not None and value < bound:
                raise InputError(f"--{name} is {value}, wanted {bound} or more")
        for name in ("noise", "weight", "pixel", "zingers"):
            value = getattr(self, name)
            if value is not None and not 0 < value < float("inf"):
                raise InputError(f"--{name} is {value:g}, wanted a positive number")
        if self.error is not None and self.footprint is not None:
            raise InputError(
                f"--footprint {self.footprint} does not apply with --error, which projects through "
                "the Fourier transform: leave one of them out"
            )
        if self.hardening is not None:
            from rift_cl.reconstruct.preprocess.hardening import checked_coefficients

            checked_coefficients(self.hardening)
        self._check_samples()
        check_tilt(self.tilt)
        if self.centers is not None and (self.center is not None or self.tilt is not None):
            raise InputError("--centers replaces --center and --tilt: leave those out")
        if self.subsets not in (None, 1) and self.precondition is not None:
            raise InputError("--subsets and --precondition cannot be combined: give one of them")
        self.check_cluster()
        if self.resume and self.overwrite:
            raise InputError("--resume continues what --overwrite discards: give one of them")

    def _check_samples(self) -> None:
        from rift_cl.io.volumes import SampleWindow

        if self.dtype == "float32":
            if self.window is not None:
                raise InputError("--window is for integer samples: add --dtype uint16 or uint8")
            return
        if self.window is not None:
            # Made now, so that its width is checked before any work.
            SampleWindow(self.dtype, *self.window)
        if self.format == "mrc" and self.dtype == "uint8":
            raise InputError("--format mrc cannot hold unsigned 8-bit samples: use --dtype uint16")

    def open_scan(self, *, fan: bool = False) -> ScanFile:
        """As of every command, with lengths in the unit that is asked for."""
        from rift_cl.commands.inputs.scan_lengths import with_lengths

        return with_lengths(super().open_scan(fan=fan), self.pitch, self.unit, self.row_pitch)

    @property
    def iterative(self) -> bool:
        """Whether the method iterates."""
        return self.method in ITERATIVE

    @property
    def attenuation(self) -> bool:
        """Whether slices hold attenuation per unit of length; backprojected integrals do not."""
        return self.method != "backproject"

    @property
    def most_steps(self) -> int:
        """Maximum number of iterations per slice; 1 for a direct method."""
        if not self.iterative:
            return 1
        if self.steps is not None:
            return self.steps
        if self.method == "cgls" and self.precondition is not None:
            return _PRECONDITIONED_CGLS
        return max(_FEWEST_PASSES, -(-_STEPS[self.method] // (self.subsets or 1)))

    def view_filter(self) -> Filter:
        """The filter along the detector.

        Raises:
            InputError: its options do not fit each other.
        """
        from rift_cl.operators import FILTERS, HighPass, Ramp

        if self.filter == "high-pass":
            if self.cutoff is not None:
                raise InputError("--cutoff does not apply to --filter high-pass: leave it out")
            return HighPass(1.0 if self.exponent is None else self.exponent)
        if self.exponent is not None:
            raise InputError("--exponent applies to --filter high-pass: add it")
        found = FILTERS[self.filter or "ram-lak"]
        if self.cutoff is None:
            return found
        if not isinstance(found, Ramp):
            raise InputError(
                f"--cutoff does not apply to --filter {self.filter}, which is no windowed ramp: "
                "leave it out"
            )
        return Ramp(found.window, self.cutoff)

    def decisive(self) -> dict[str, Any]:
        """The settings on which the slices depend, as text: of files not where they are.

        What the scan's hold is told by the scan; here that of its geometry is.
        """
        # Imported when used: the command's help reads no file.
        from rift_cl.io.file_content import Content

        geometry = {}
        if self.geometry is not None and self.geometry.is_file():
            geometry["geometry"] = Content.of((self.geometry,), self.geometry).words
        return (
            {
                name: str(without_place(name, value))
                for name, value in dataclasses.asdict(self).items()
                if name not in _FREE
            }
            | geometry
            | decisive_parts()
        )
