"""Fit splats to photographs, score them on those held out, and film the scene.

The capture comes with the package: 60 renderings of a glossy ornament with their cameras. Take a
folder of your own in its place, posed or not. Records of what was done stand for their folders, so
that one function takes what another gave back; without ``out`` the folder is a temporary one. In a
notebook each shows its pictures. Run it with the number of steps, 1000 if not given.
"""

import sys

import rift_cl as rift
from rift_cl import sample

steps = int(sys.argv[1]) if sys.argv[1:] else 1000


def progress(report):
    """Say where the work stands, now and then."""
    if report.done == report.total:
        print(f"{report.done} {report.what} done")


fitted = rift.fit(sample.ornament(), steps=steps, splats=5 * steps, downscale=2, progress=progress)
print(fitted)
for view in fitted.scores["held out"]:
    print(f"{view.name}: {view.values['fit_psnr']:.1f} dB, {view.image.shape} pixels")
elsewhere = rift.evaluate(fitted, [sample.ornament_off_path()])
print(elsewhere)
film = rift.render(fitted, frames=6, size=(160, 120))
print(film, film.read(0).mean())
