"""What a kernel is for, in the words of those who use it: a refusal names the feature as well."""

from __future__ import annotations

from rift_cl.cl.build.source import kernel_room

# By the beginning of a kernel's name, the most telling first.
_BY_NAME = {
    "radon_": "the projector of parallel beams",
    "fan_": "the projector of fans",
    "upright_": "the projector of vectors",
    "plane_": "the projector of parallel beams",
    "rays_": "the projector by Fourier transforms (FastProjector)",
    "filter_views": "filters along the detector",
    "rows_": "filters along the detector",
    "backproject_spline": "backprojection as scikit-image's",
    "column_": "the removal of rings",
    "stack_transpose": "the removal of rings",
    "local_median": "the removal of zingers",
    "zinger_": "the removal of zingers",
    "tv_": "reconstruction with total variation",
    "hermite_dilate": "X-ray fits and splats summed at voxels",
    "hermite_voxelise": "X-ray fits and splats summed at voxels",
    "hermite_": "splats with Hermite modes",
    "lobe_": "colours of splats by lobes of direction",
    "light_": "light that splats share and reflect",
    "expected_depth": "depth images of splats",
    "adam": "training",
    "ssim_map": "losses of images (L1, SSIM)",
    "loss_grad": "losses of images (L1, SSIM)",
    "expose": "exposures of photographs",
}
_BY_ROOM = {
    "tomo": "tomography",
    "cone": "the projector of cones",
    "fourier": "Fourier transforms",
    "splat": "splats",
    "train": "training",
    "sampling": "coverage by views",
    "vector": "sums, sorts and other work on arrays",
}


def feature_of(kernel: str) -> str:
    """What a kernel is for, followed by its name."""
    named = (words for start, words in _BY_NAME.items() if kernel.startswith(start))
    words = next(named, None) or _BY_ROOM.get(kernel_room(kernel), "RiFT-CL")
    return f"{words} (kernel {kernel})"
