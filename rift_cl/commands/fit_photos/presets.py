"""Named settings of ``rift fit photos``, for fits of one purpose.

A preset takes the place of the defaults; options that are given besides override it, and
``config.json`` holds every value, so that ``--config`` repeats a run whatever its preset was.
``tools/search_defaults.py`` compares them, and what else might serve, on held-out views.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# Positions, scales and rotations that move faster serve short fits, and so does colour by direction
# that is there nearly from the start; the random walk only blurs what has been found.
_RATES = {
    "learning_rates.means": 1.28e-3,
    "learning_rates.log_scales": 2e-2,
    "learning_rates.quats": 4e-3,
    "strategy.noise": 0.0,
}
PRESETS: Mapping[str, Mapping[str, Any]] = {
    "fast": {**_RATES, "angular": "sg", "modes": 8, "angular.first": 0.05},
    "harmonics": {**_RATES, "sh_every": 1 / 14, "learning_rates.sh_rest": 1.0},
}
