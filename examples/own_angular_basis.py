"""An angular basis of your own: powers of the cosine between the viewing direction and an axis.

Each splat has an axis, which is trained (three numbers of geometry), and coefficients of 1, t, t^2
and so on, with t the cosine. A basis gives its functions and their derivatives in NumPy. Run it, or
give it to ``rift --load``.
"""

import numpy as np

import rift_cl as rift
from rift_cl.basis import AngularFunctions, register_angular_basis
from rift_cl.basis.angular import CONSTANT, Slopes, unit_axes, unit_directions


class CosinePowers(AngularFunctions):
    """Functions of the cosine t to an axis: the constant, t, t^2, ..."""

    name = "cosine"
    n_geometry = 3

    def __init__(self, n_linear):
        self.n_linear = n_linear

    def slopes(self, geometry, directions):
        """All functions with their derivatives by the axis and by the direction."""
        axis, along = unit_axes(np.asarray(geometry, float))
        unit, across = unit_directions(np.asarray(directions, float))
        t, k = (axis * unit).sum(-1)[..., None], np.arange(1, self.n_linear)
        steep = np.concatenate([0 * t, k * t ** (k - 1)], -1)[..., None]
        by_axis, by_unit = steep * unit[..., None, :], steep * axis[..., None, :]
        values = np.concatenate([CONSTANT + 0 * t, t**k], -1)
        return Slopes(values, by_axis @ along, by_unit @ across)

    def start_geometry(self, axes):
        """The axes themselves."""
        return unit_axes(np.asarray(axes, float)).vectors


register_angular_basis("cosine", CosinePowers)


def main():
    """Render splats whose colours are in this basis."""
    device = rift.default_device()
    random = np.random.default_rng(0)
    splats = rift.Splats.upload(
        device,
        means=random.uniform(-1, 1, (50, 3)),
        quats=random.normal(size=(50, 4)),
        scales=np.full((50, 3), 0.1),
        opacities=np.full(50, 0.8),
        sh=random.normal(size=(50, 4, 3)),
        lobes=random.normal(size=(50, 3)),
    )
    view = np.eye(4)
    view[2, 3] = 4
    camera = rift.Camera((32, 32), [[32, 0, 16], [0, 32, 16], [0, 0, 1]], view)
    renderer = rift.Renderer(rift.SplatSettings(angular="cosine"), device=device)
    frame = renderer.forward(splats, camera)
    print(f"mean of the image: {device.get(frame.image).mean():.4f}")


if __name__ == "__main__":
    main()
