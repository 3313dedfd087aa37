"""Plan from where to photograph a target, and what another view would bring.

Views sample the target's Fourier domain; the planner chooses those that leave least of its power
unknown, under constraints: here a sector of 120 degrees, between the horizon and 60 degrees above
it. ``rift.plan_views`` does the same from the options of ``rift plan`` and writes a report. Run it
with the number of views, 12 if not given.
"""

import sys

import numpy as np

import rift_cl as rift

views = int(sys.argv[1]) if sys.argv[1:] else 12
target = rift.Target(center=np.zeros(3), diameter=60.0, snr=1000.0)
sector = rift.Constraints(elevation=np.radians([0, 60]), azimuth=np.radians([-60, 60]))
planned = rift.plan(target, views, sector)
print(planned)
print(planned.verdict())
for place in planned.order:
    azimuth, elevation = np.degrees([planned.azimuth[place], planned.elevation[place]])
    print(f"azimuth {azimuth:6.1f}, elevation {elevation:5.1f} degrees")

unknown, gradients = rift.merit(planned.cameras, target)
print(f"{unknown:.1%} of the target's power stays unknown")
more = rift.next_views(planned, target, 1, compare=False)
print(f"one more: {rift.merit([*planned.cameras, *more.cameras], target)[0]:.1%}")
