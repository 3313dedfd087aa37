"""What a notebook shows of splats: how many there are, and a picture of them.

The picture is of the camera that a film begins with where no cameras are known.
"""

from __future__ import annotations

import numpy as np

from rift_cl.cl.discovery import default_device
from rift_cl.commands.cameras.film_path import film
from rift_cl.commands.inputs.opened_scene import in_display_light
from rift_cl.commands.inputs.scene_bounds import bounds_of_splats
from rift_cl.io.scenes.splat_scene import SplatScene
from rift_cl.report.notebook import card
from rift_cl.report.plot import jpeg
from rift_cl.splat import Renderer, SplatSettings

_SIZE, _FOV = (240, 320), 45.0


def scene_card(scene: SplatScene) -> str:
    """A scene as HTML.

    Raises:
        DeviceError: there is no device to draw it.
    """
    facts = {
        "splats": len(scene),
        "kind": "densities of an X-ray scan" if scene.mode == "xray" else "light",
        "colours": f"{scene.sh.shape[1]} x {scene.angular}",
    }
    more = "<p>To turn it: <code>rift.view(path)</code> of the scene's file.</p>"
    if not len(scene):
        return card("SplatScene", facts)
    return card(
        type(scene).__name__,
        facts,
        [("splats from a film's first camera", _picture(scene))],
        more=more,
    )


def _picture(scene: SplatScene) -> bytes:
    device = default_device()
    settings = SplatSettings(
        mode=scene.mode,
        activation=scene.activation,
        angular=scene.angular,
        antialiased=scene.antialiased,
        eps2d=SplatSettings.eps2d if scene.eps2d is None else scene.eps2d,
    )
    camera = film(bounds_of_splats(scene), frames=1, size=_SIZE, fov=_FOV)[0]
    image = Renderer(settings, device=device).picture(scene.upload(device), camera).image
    if scene.mode == "xray":
        image = image.mean(axis=2)
        return jpeg(image, window=(0.0, float(np.percentile(image, 99.9)) or 1.0))
    return jpeg(in_display_light(image, scene.light))
