"""A trainer of splats in plain torch, on the CPU: the peer that our trainer races.

What one would write who has torch and no kernels of his own: the tiles of ``bench.torch_tiles``,
gradients by autograd, torch's own Adam in its fused form, SSIM by convolutions. It does what a step
of ours does: the same rates and groups, L1 and D-SSIM, penalties, and the random walk of 3DGS as
MCMC (Kheradmand et al. 2024), whose numbers torch draws for itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch.nn.functional import conv2d, normalize

from bench.torch_tiles import draw, flushed_denormals, on_threads
from rift_cl.geometry import Camera
from rift_cl.train import McmcSettings, TrainSettings
from rift_cl.train.schedules import LearningRateSchedule

_BETAS, _EPSILON = (0.9, 0.999), 1e-15
_WINDOW, _SIGMA = 11, 1.5
_C1, _C2 = 0.01**2, 0.03**2
_STEEPNESS, _FAINT = 100.0, 0.005


class TorchTrainer:
    """Splats in training, in torch.

    Args:
        raw: first splats before their activations, as ``Parameters.of`` takes them.
        settings: of the run, with the MCMC strategy; splats are not relocated.
        extent: of the scene, for learning rates.
        size: of the scene, for scales.
        threads: of torch; as many as it takes if None.
    """

    def __init__(
        self,
        raw: Mapping[str, Any],
        settings: TrainSettings,
        *,
        extent: float,
        size: float,
        threads: int | None = None,
    ) -> None:
        self._settings, self._schedule = settings, LearningRateSchedule(settings, extent)
        self._size, self._threads, self._step = size, threads, 0
        assert isinstance(settings.strategy, McmcSettings)
        self._strategy = settings.strategy
        arrays = {name: torch.tensor(array) for name, array in raw.items()}
        sh = arrays.pop("sh")
        arrays |= {"sh": sh[:, :1].clone(), "sh_rest": sh[:, 1:].clone()}
        self._leaves = {name: array.requires_grad_() for name, array in arrays.items()}
        groups = [{"params": [leaf], "name": name} for name, leaf in self._leaves.items()]
        self._adam = torch.optim.Adam(groups, lr=0.0, betas=_BETAS, eps=_EPSILON, fused=True)
        self._random = torch.Generator().manual_seed(settings.seed)

    def step(self, camera: Camera, target: torch.Tensor, background: torch.Tensor) -> float:
        """One picture; its loss without penalties, as ours gives it."""
        with flushed_denormals(), on_threads(self._threads):
            rates = self._set_rates()
            drawn = self._drawn()
            loss = image_loss(
                draw(drawn, camera, background), target, ssim_weight=self._settings.ssim_weight
            )
            self._adam.zero_grad()
            (loss + self._penalties(drawn)).backward()
            self._adam.step()
            self._step += 1
            if self._step <= self._schedule.cooldown:
                self._shake(self._strategy.noise * rates["means"])
            return float(loss.detach())

    def _set_rates(self) -> dict[str, float]:
        rates = self._schedule.learning_rates(self._step)
        rates["sh_rest"] = rates["sh"] * self._settings.learning_rates.sh_rest
        for group in self._adam.param_groups:
            group["lr"] = rates[group["name"]]
        return rates

    def _drawn(self) -> dict[str, torch.Tensor]:
        leaves = self._leaves
        return {
            "means": leaves["means"],
            "quats": leaves["quats"],
            "scales": leaves["log_scales"].exp(),
            "opacities": leaves["logits"].sigmoid(),
            "sh": torch.cat([leaves["sh"], leaves["sh_rest"]], 1),
        }

    def _penalties(self, drawn: Mapping[str, torch.Tensor]) -> torch.Tensor:
        if self._step >= self._schedule.cooldown:
            return torch.zeros(())
        opacity, scale = drawn["opacities"].mean(), drawn["scales"].mean()
        strategy = self._strategy
        return strategy.opacity_penalty * opacity + strategy.scale_penalty / self._size * scale

    @torch.no_grad()
    def _shake(self, amount: float) -> None:
        """Move splats by ``amount gate Sigma xi``; Sigma xi = R S^2 R' xi by rotations alone."""
        drawn = self._drawn()
        gate = torch.sigmoid(_STEEPNESS * (_FAINT - drawn["opacities"]))
        xi = torch.randn(drawn["means"].shape, generator=self._random)
        quats = normalize(drawn["quats"], dim=1)
        grown = _turned(quats * torch.tensor([1.0, -1, -1, -1]), xi) * drawn["scales"] ** 2
        self._leaves["means"] += amount * gate[:, None] * _turned(quats, grown)


def image_loss(image: torch.Tensor, target: torch.Tensor, *, ssim_weight: float) -> torch.Tensor:
    """The mean of ``(1 - w) |image - target| + w (1 - SSIM)``, of (height, width, C) images."""
    pixels = (image - target).abs().mean()
    return (1 - ssim_weight) * pixels + ssim_weight * (1 - _similarity(image, target).mean())


def _similarity(image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """The map of SSIM: Gaussian window, population covariance, mirrored borders."""
    x, y = image.permute(2, 0, 1), target.permute(2, 0, 1)
    mx, my, xx, yy, xy = _blurred(torch.cat([x, y, x * x, y * y, x * y])).chunk(5)
    vx, vy, cov = xx - mx * mx, yy - my * my, xy - mx * my
    above = (2 * mx * my + _C1) * (2 * cov + _C2)
    return above / ((mx * mx + my * my + _C1) * (vx + vy + _C2))


def _blurred(planes: torch.Tensor) -> torch.Tensor:
    """(C, height, width) planes, each blurred down and along."""
    half = _WINDOW // 2
    away = torch.arange(-half, half + 1)
    weights = torch.exp(-0.5 * (away / _SIGMA) ** 2)
    weights = (weights / weights.sum()).view(1, 1, _WINDOW, 1)
    down = conv2d(_mirrored(planes, half, 1)[:, None], weights)
    return conv2d(_mirrored(down, half, 3), weights.transpose(2, 3))[:, 0]


def _mirrored(planes: torch.Tensor, half: int, axis: int) -> torch.Tensor:
    """Continued by its own edge, backwards, which is not what torch calls reflection."""
    length = planes.shape[axis]
    before, after = planes.narrow(axis, 0, half), planes.narrow(axis, length - half, half)
    return torch.cat([before.flip(axis), planes, after.flip(axis)], axis)


def _turned(quats: torch.Tensor, vectors: torch.Tensor) -> torch.Tensor:
    """(N, 3) vectors turned by (N, 4) unit quaternions, w first."""
    w, axis = quats[:, :1], quats[:, 1:]
    once = torch.linalg.cross(axis, vectors)
    return vectors + 2 * (w * once + torch.linalg.cross(axis, once))
