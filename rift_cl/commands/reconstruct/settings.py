"""What ``rift reconstruct`` is asked for, and which options mean something for which method."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rift_cl.commands.inputs.scan_input import ScanInput
from rift_cl.errors import InputError

if TYPE_CHECKING:
    from rift_cl.operators import Filter

SOLVERS = ("sirt", "cgls", "tv")
ITERATIVE = (*SOLVERS, "levels")
Switch = Literal["auto", "on", "off"]
# Options that belong to some methods only; the others take no notice of them, and say so.
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
# Steps that serve as a beginning: SIRT is slow, CGLS gets noisy when it goes on for long.
_STEPS = {"sirt": 100, "cgls": 30, "tv": 200, "levels": 1200}
# With frequencies weighed, CGLS is near its best after the first few.
_PRECONDITIONED_CGLS = 4
# A detector that leans by more is no misalignment, in degrees.
_MOST_TILT = 5.0
# Passes over all subsets, however many there are.
_FEWEST_PASSES = 5
# What may differ between a run and the one that goes on with it: it changes no bit of the result.
_FREE = (
    *("out", "device", "memory", "format", "dtype", "window"),
    *("overwrite", "resume", "dry_run", "preview", "config"),
)


@dataclass(frozen=True)
class ReconstructSettings(ScanInput):
    """Reconstruct a parallel-beam or fan-beam scan, slice by slice.

    Example: rift reconstruct scan.h5 --out slices --filter shepp-logan --format zarr
    """

    out: Path = Path("rift-reconstruct")
    """Folder for the slices, preview.png, report.html, config.json and metrics.json."""
    method: Literal["fbp", "backproject", "sirt", "cgls", "tv", "levels"] = "fbp"
    """Filtered backprojection; backprojection without a filter; steps towards the slice whose
    projections are the measured ones (sirt, cgls), also with the fewest edges (tv); or, of limited
    angles, one material with holes in a disc of it (levels)."""
    filter: str | None = None
    """fbp: filter along the detector: ram-lak, shepp-logan, cosine, hamming, hann, high-pass, or
    the name of one that was registered. Default: ram-lak."""
    cutoff: float | None = None
    """fbp: where the filter's window ends, as a fraction of the Nyquist frequency; 1 if not
    given."""
    exponent: float | None = None
    """fbp: of the high-pass |f|^exponent; 1, the ramp, if not given."""
    compensate: Literal["uniform", "voronoi", "capped-voronoi", "pipe-menon", "exact"] | None = None
    """fbp: density compensation for irregular angles; if not given, voronoi where the angles cover
    180 degrees, else uniform."""
    footprint: Literal["strip", "joseph", "linear"] | None = None
    """Project directly, and spread a pixel over the bins by the area they share (strip), or by
    interpolation between pixels (joseph) or bins (linear)."""
    error: float | None = None
    """Project through the Fourier transform, with this relative error, such as 1e-3. If neither
    this nor --footprint is given, whichever costs less is taken: the Fourier transform with an
    error of 1e-3 for larger slices (from about 150 samples up on a CPU), by which filtered
    backprojection loses less than 0.05 dB, else strip."""
    steps: int | None = None
    """sirt, cgls, tv, levels: most steps for a slice; 100 (divided by --subsets), 30 (with
    --precondition 4), 200, 1200 if not given."""
    subsets: int | None = None
    """sirt: number of ordered subsets of the views; the image is updated after each, so that about
    that many times fewer steps are needed; 1 if not given."""
    noise: float | None = None
    """sirt, cgls, tv: standard deviation of the noise of a line integral; steps end where the
    slice explains the data that well."""
    weight: float | None = None
    """tv, levels: of the total variation; the greater, the smoother."""
    nonnegative: bool = False
    """sirt, tv: no value below zero."""
    weights: Literal["counts"] | None = None
    """sirt, cgls, tv: weigh each ray by the photons that arrived (penalized weighted least
    squares), so that rays starved by metal draw no streaks; all alike if not given."""
    precondition: Literal["ramp", "capped-voronoi"] | None = None
    """sirt, cgls, tv: weigh the residual's frequencies by a filter, which takes fewer steps."""
    center: float | None = None
    """Detector bin of the rotation axis; found automatically when not given, but for fan beams, of
    which it is taken at the detector's middle."""
    rows: tuple[int, int] | None = None
    """First detector row, and the one after the last."""
    pitch: float | None = None
    """Distance between detector bins; the file's own, or 1 bin, when not given."""
    unit: str | None = None
    """Unit of the pitch, such as mm."""
    pixel: float | None = None
    """Distance between samples of a slice; the bins' distance, at the rotation axis, when not
    given."""
    size: int | None = None
    """Samples along each side of a slice; as many as cover the detector when not given."""
    roi: tuple[int, int, int, int] | None = None
    """Part of the slice: first column and the one after the last, first line and the one after
    the last."""
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
    """Remove the stripes in the sinogram that make rings in the slice: 'vo' (the same as 'on')
    combines 'dead', 'large' and 'sorting', the filters of Vo, Atwood and Drakopoulos (2018), as are
    'filtering' and 'fitting'; 'wavelet-fft' is that of Muench et al. (2009). auto: vo, where the
    file holds counts or transmission and the views cover 150 degrees or more; else off."""
    binning: int = 1
    """Average blocks of so many detector rows and bins before all else; --center, --rows, --pitch
    and --tilt keep to the detector as it is."""
    zingers: float | None = None
    """Replace zingers, single pixels that cosmic rays or scattered photons hit, which stand out of
    their neighbours by so many standard deviations of the noise, such as 6; none if not given."""
    tilt: float | None = None
    """Degrees by which the rotation axis leans in the detector's plane, positive where its bin
    grows with the row; projections are turned by it. If not given: the tilt found with the axis,
    where it moves the axis by a quarter of a bin or more; 0 for none."""
    centers: Path | None = None
    """File with the bin of the rotation axis in every detector row (.txt, .csv or .npy), for an
    axis that drifts along the rows; replaces --center and --tilt."""
    half_acquisition: Literal["weighted", "stitched"] = "weighted"
    """Full turns with the axis off the detector's middle: count opposite views by weights, or
    stitch them to views of half a turn that are nearly twice as wide."""
    delta_beta: float | None = None
    """Phase retrieval after Paganin et al. (2002), for a parallel beam and one material: the ratio
    delta / beta of its refractive index; needs --energy, --propagation and a pitch in a unit of
    length; off if not given."""
    energy: float | None = None
    """Phase retrieval: energy of the photons, in keV."""
    propagation: float | None = None
    """Phase retrieval: distance from the sample to the detector, in millimetres."""
    pad: Switch = "auto"
    """Continue an object that is wider than the detector; auto: where the projections do not end
    at zero."""
    preview: bool = False
    """Reconstruct the middle slice alone, as preview.png, and say how long all would take."""
    format: Literal["tiff", "tiff-stack", "zarr", "h5", "mrc"] = "tiff"
    """A folder of TIFF slices, one TIFF file (both with ImageJ's notes), an OME-Zarr store with
    coarser copies, one HDF5 file, or one MRC file."""
    dtype: Literal["float32", "uint16", "uint8"] = "float32"
    """Type of the samples in the volume; integers cover --window."""
    window: tuple[float, float] | None = None
    """For integer samples: the attenuation that the least and the greatest integer stand for; from
    the slices themselves, with a margin, if not given."""
    overwrite: bool = False
    """Replace an earlier reconstruction in the same folder."""
    resume: bool = False
    """Go on with a reconstruction in the same folder that was cut off."""
    dry_run: bool = False
    """Show what would be done, and write nothing."""
    config: Path | None = None
    """config.json of an earlier run, whose settings, with every value that was decided there, are
    the defaults of this one."""

    def check(self) -> None:
        """Check what depends on nothing but the settings.

        Raises:
            InputError: an option makes no sense, or none for this method.
        """
        usual = {field.name: field.default for field in dataclasses.fields(self)}
        for name, methods in _ONLY.items():
            if getattr(self, name) != usual[name] and self.method not in methods:
                raise InputError(
                    f"--{name} means nothing for --method {self.method}: leave it out, or choose "
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
                f"--footprint {self.footprint} means nothing with --error, which goes through the "
                "Fourier transform: leave one of them out"
            )
        self._check_samples()
        if self.tilt is not None and not abs(self.tilt) <= _MOST_TILT:
            raise InputError(f"--tilt is {self.tilt:g} degrees, wanted {_MOST_TILT:g} at most")
        if self.centers is not None and (self.center is not None or self.tilt is not None):
            raise InputError("--centers takes the place of --center and --tilt: leave those out")
        if self.subsets not in (None, 1) and self.precondition is not None:
            raise InputError("--subsets and --precondition both save steps: give one of them")
        if self.resume and self.overwrite:
            raise InputError("--resume goes on with what --overwrite throws away: give one of them")

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
            raise InputError("--format mrc has no unsigned 8-bit samples: take --dtype uint16")

    @property
    def iterative(self) -> bool:
        """Whether the method takes steps."""
        return self.method in ITERATIVE

    @property
    def most_steps(self) -> int:
        """Steps that a slice takes at most; 1 where the method is a formula."""
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
                raise InputError("--cutoff means nothing for --filter high-pass: leave it out")
            return HighPass(1.0 if self.exponent is None else self.exponent)
        if self.exponent is not None:
            raise InputError("--exponent is the high-pass's: add --filter high-pass")
        found = FILTERS[self.filter or "ram-lak"]
        if self.cutoff is None:
            return found
        if not isinstance(found, Ramp):
            raise InputError(
                f"--cutoff means nothing for --filter {self.filter}, which is no windowed ramp: "
                "leave it out"
            )
        return Ramp(found.window, self.cutoff)

    def decisive(self) -> dict[str, Any]:
        """The settings on which the slices depend, as text."""
        return {
            name: str(value)
            for name, value in dataclasses.asdict(self).items()
            if name not in _FREE
        }
