"""Gradients of projection and shading, on the device and by torch's autograd."""

from __future__ import annotations

import numpy as np
import torch
import twin_projection as twin
from projection_scenes import shaped, twin_of, upload

from rift_cl.cl.arithmetic import sum_columns
from rift_cl.splat.features import shade, shade_grad
from rift_cl.splat.projection import project, project_grad
from rift_cl.splat.raster import SlotRecords, sum_slots


def tiles_of(boxes):
    return (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])


def random_records(counts, covars, channels, *, seed=1, absgrad=False):
    """Records as a raster gradient leaves them: moments of random numbers at random pixels."""
    random = np.random.default_rng(seed)
    slots = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    splat = np.repeat(np.arange(len(counts)), counts)
    roots = np.linalg.cholesky(covars[splat])
    d = np.einsum("nij,npj->npi", roots, random.standard_normal((len(splat), 5, 2)))
    by_sigma = random.standard_normal((len(splat), 5)) + 0.3
    dx, dy = d[..., 0], d[..., 1]
    moments = [np.ones_like(dx), dx, dy, dx * dx, dx * dy, dy * dy]
    parts = [(by_sigma * moment).sum(1) for moment in moments]
    parts += list(random.standard_normal((channels, len(splat))))
    parts += list(random.uniform(0, 1, (2 * absgrad, len(splat))))
    return slots, np.stack(parts, 1).astype(np.float32)


def sums_of(device, slots, records):
    """The records of each splat, summed on the device."""
    live = device.array(np.ones(len(records), np.uint8))
    return sum_slots(device, device.array(slots), SlotRecords(device.array(records), live))


def run(device, values, kind, *, channels=3, depth_channel=False, shaded=True, one_tile=False):
    """Gradients on the device, with the sums that came in: (host gradients, sums, drawn)."""
    splats, camera, settings = upload(device, values, kind), kind.camera, kind.settings
    projected = project(device, splats, camera, settings)
    covars = np.nan_to_num(twin_of(values, kind).covars) + 1e-9 * np.eye(2)
    counts = tiles_of(device.get(projected.boxes))
    counts = np.minimum(counts, 1) if one_tile else counts
    slots, records = random_records(counts, covars, channels, absgrad=settings.absgrad)
    gradients = project_grad(
        projected,
        sums_of(device, slots, records),
        depth_channel=depth_channel,
    )
    by_sh = None
    if shaded:
        features = device.zeros((len(splats), channels))
        shade(device, splats.means, splats.sh, camera, projected.culled, into=features)
        by_sh = shade_grad(
            device, splats.means, splats.sh, camera, features=features, gradients=gradients
        )
    host = {name: device.get(array) for name, array in vars(gradients).items() if array is not None}
    for name in {"camera", "aperture"} & set(host):
        host[name] = device.get(sum_columns(device, getattr(gradients, name)))
    if shaded:
        host["sh"] = device.get(by_sh)
    sums = np.zeros((len(counts), records.shape[1]))
    np.add.at(sums, np.repeat(np.arange(len(counts)), counts), records)
    return host, sums, device.get(projected.culled) == 0


def oracle(values, kind, sums, drawn, *, depth_channel=False, shaded=True):
    """The same gradients by autograd."""
    leaves = {
        name: torch.tensor(value.astype(float), requires_grad=True)
        for name, value in shaped(values, kind).items()
    }
    view = torch.tensor(kind.camera.view[:3], requires_grad=True)
    lens = torch.tensor(kind.camera.intrinsics, dtype=torch.float64, requires_grad=True)
    opening = aperture_of(kind)
    seen = {name: leaf[torch.tensor(drawn)] for name, leaf in leaves.items()}
    covars = (
        twin.from_six(seen["covars"])
        if kind.covars
        else twin.covariance(seen["quats"], seen["scales"])
    )
    screen = twin.screen(
        seen["means"],
        covars,
        seen["opacities"],
        view,
        lens,
        opening,
        camera=kind.camera,
        settings=kind.settings,
    )
    colors = twin.shade(seen["means"], seen["sh"], view, kind.model) if shaded else None
    twin.loss(screen, torch.tensor(sums[drawn]), colors, depth_channel=depth_channel).backward()
    found = {name: leaf.grad.numpy() for name, leaf in leaves.items() if leaf.grad is not None}
    if opening is not None:
        found["aperture"] = opening.grad.numpy()
    return found | {"camera": np.concatenate([view.grad.numpy().ravel(), lens.grad.numpy()])}


def aperture_of(kind):
    """Radius and focus as a leaf; None without an aperture."""
    if kind.aperture is None:
        return None
    numbers = [kind.aperture.radius, kind.aperture.focus]
    return torch.tensor(numbers, dtype=torch.float64, requires_grad=True)


def error(found, right):
    return np.linalg.norm(found - right) / np.linalg.norm(right)


def errors_by_splat(found, right):
    """Relative errors of the splats that have a gradient; the others must have none."""
    found, right = (array.reshape(len(array), -1).astype(float) for array in (found, right))
    size = np.linalg.norm(right, axis=1)
    assert not found[size == 0].any()
    return np.linalg.norm(found - right, axis=1)[size > 0] / size[size > 0]
