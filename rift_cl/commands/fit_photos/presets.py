"""Named settings of ``rift fit photos``: beside the defaults, others that serve.

A preset takes the place of the defaults; options that are given besides override it, and
``config.json`` holds every value, so that ``--config`` repeats a run whatever its preset was.
``tools/search_defaults.py`` compares them, and what else might serve, on held-out views.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

PRESETS: Mapping[str, Mapping[str, Any]] = {
    # Eight spherical Gaussians each: higher scores in a longer time, for viewers that know them.
    "lobes": {"angular": "sg", "modes": 8},
    # Depth and normals nearer to the surface, at some loss of the photographs.
    "surface": {"surface.normal_consistency": 0.03},
    # The defaults of version 0.1.0, whose degrees of harmonics joined every 500 steps.
    "0.1": {
        "octaves": 0,
        "sh_every": 1 / 6,
        "angular.first": 0.15,
        "learning_rates.means": 1.6e-4,
        "learning_rates.means_steps": 0,
        "learning_rates.quats": 1e-3,
        "learning_rates.log_scales": 5e-3,
        "learning_rates.sh_rest": 0.2,
        "strategy": "mcmc",
        "strategy.noise": 5e5,
    },
}
