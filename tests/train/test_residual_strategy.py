"""The residual strategy: what splats contribute, which of them are moved, and where to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_parameters import raw_values

from rift_cl.errors import CheckpointError, InputError
from rift_cl.geometry import Camera
from rift_cl.reference.training import residual_image, residual_statistics
from rift_cl.splat.renderer import Renderer
from rift_cl.splat.splats import Splats
from rift_cl.train.parameters import Parameters
from rift_cl.train.strategy import ResidualSettings, TrainingRun
from rift_cl.train.strategy.residual import Contributions, relocate_by_residual

RUN = TrainingRun(steps=1000, splats=500, seed=0, extent=1.0, cooldown=880)
LEAST = {"min_opacity": 0.005, "min_contribution": 0.2}


def parameters_of(device, count=60):
    raw = raw_values(count, 1)
    raw["means"] *= 0.5
    raw["log_scales"] = np.random.default_rng(3).uniform(-3, -2, (count, 3)).astype(np.float32)
    raw["logits"] = np.random.default_rng(2).uniform(-1, 2, count).astype(np.float32)
    moments = {name: np.ones_like(value) for name, value in raw.items()}
    return Parameters.of(device, raw, first=moments, second=moments, step=600)


def camera_of(size=(40, 50)):
    view = np.eye(4)
    view[2, 3] = 4
    height, width = size
    return Camera(size, [[45, 0, width / 2], [0, 45, height / 2], [0, 0, 1]], view)


def frame_of(device, parameters, **more):
    return Renderer(device=device).forward(parameters.drawn, camera_of(), **more)


def drawn_alone(device, parameters):
    """Each splat's share in every pixel, (N, height, width), by drawing with a color of its own."""
    drawn, count = parameters.drawn, len(parameters)
    shares = []
    for k in range(0, count, 3):
        colors = np.zeros((count, 3), np.float32)
        for c in range(min(3, count - k)):
            colors[k + c, c] = 1
        splats = Splats(
            drawn.means,
            quats=drawn.quats,
            scales=drawn.scales,
            opacities=drawn.opacities,
            colors=device.array(colors),
        )
        image = device.get(Renderer(device=device).forward(splats, camera_of()).image)
        shares += [image[..., c] for c in range(min(3, count - k))]
    return np.array(shares)


@pytest.mark.full
@pytest.mark.parametrize("weighted", [False, True])
def test_contributions_are_sums_over_pixels_of_each_splats_share(device, weighted):
    parameters, random = parameters_of(device), np.random.default_rng(0)
    frame = frame_of(device, parameters)
    target = random.uniform(size=(40, 50, 3)).astype(np.float32)
    weights = random.uniform(size=(40, 50)).astype(np.float32) if weighted else None
    found = Contributions(device, len(parameters))
    given = None if weights is None else device.array(weights)
    for _ in range(2):
        found.add(frame, frame.image, device.array(target), given)
    shares = drawn_alone(device, parameters).astype(float)
    image = device.get(frame.image).astype(float)
    asked = residual_image(image, target, 1.0 if weights is None else weights, 3)[..., :2]
    shown = np.tensordot(shares, asked, axes=2)
    wanted = np.zeros((len(parameters), 3))
    for _ in range(2):
        wanted = residual_statistics(wanted, shown, device.get(frame.projection.culled))
    assert wanted[:, 2].max() == 2 and wanted[:, 1].max() > 1
    np.testing.assert_allclose(found.host(), wanted, rtol=2e-4, atol=2e-4)


def test_the_kernel_of_residuals_is_its_twin(device):
    random = np.random.default_rng(5)
    image = random.uniform(size=(7, 9, 5)).astype(np.float32)
    target = random.uniform(size=(7, 9, 3)).astype(np.float32)
    weights = random.uniform(size=(7, 9)).astype(np.float32)
    for given in (None, weights):
        out = device.empty(image.shape)
        device.launch(
            "residual_image",
            (63,),
            image=device.array(image),
            target=device.array(target),
            weights=device.array(target if given is None else given),
            residual=out,
            pixels=63,
            CHANNELS=3,
            IMAGE_CHANNELS=5,
            WEIGHTED=int(given is not None),
        )
        wanted = residual_image(image, target, 1.0 if given is None else given, 5)
        np.testing.assert_allclose(device.get(out), wanted, atol=1e-6)


def test_what_no_view_looks_at_and_what_is_not_finite_is_left_as_it_was(device):
    sums = np.arange(1, 13, dtype=np.float32).reshape(6, 2)
    sums[2, 1] = np.nan
    culled = np.array([0, 1, 0, 3, 4, 2], np.uint8)
    table = device.array(np.ones((6, 3), np.float32))
    device.launch(
        "residual_statistics",
        (6,),
        sums=device.array(sums),
        culled=device.array(culled),
        statistics=table,
        width=2,
        first=0,
        count=6,
    )
    wanted = residual_statistics(np.ones((6, 3)), sums.astype(float), culled)
    assert [row[2] for row in wanted] == [2, 1, 1, 2, 1, 2]
    np.testing.assert_array_equal(device.get(table), wanted)


def table_of(count):
    """Residual shown, pixels made up, views: all alike."""
    return np.tile(np.array([1, 100, 10], np.float32), (count, 1))


def test_unneeded_splats_become_halves_of_those_on_which_the_residual_lies(device):
    before, table = parameters_of(device), table_of(60)
    table[:5, 1] = 0.3  # hidden, or smaller than a pixel
    table[:, 0] = 0
    table[20:40, 0] = 2
    after = relocate_by_residual(before, table, added=4, seed=3, **LEAST)
    old, new = before.host()[0], after.host()[0]
    assert len(after) == 64 and after.step == 600
    touched = np.flatnonzero((new["means"][:60] != old["means"]).any(axis=1))
    places = [*range(5), *range(60, 64)]
    hosts = np.setdiff1d(touched, places)
    assert hosts.size == 9 and hosts.min() >= 20 and hosts.max() < 40
    for host in hosts:
        twin = [k for k in places if (new["quats"][k] == old["quats"][host]).all()]
        assert len(twin) == 1
        pair = new["means"][[host, twin[0]]]
        np.testing.assert_allclose(pair.mean(axis=0), old["means"][host], atol=1e-6)
        longest = np.exp(old["log_scales"][host].max())
        np.testing.assert_allclose(np.linalg.norm(pair[0] - pair[1]), longest, rtol=1e-5)
        np.testing.assert_allclose(
            np.sort(np.exp(new["log_scales"][host] - old["log_scales"][host])), [0.6, 1, 1], 1e-5
        )
        assert new["logits"][host] == new["logits"][twin[0]] == old["logits"][host]
    for moments in after.host()[1:]:
        for name, values in moments.items():
            assert not values[[*places, *hosts]].any(), name
    kept = np.setdiff1d(np.arange(60), [*places, *hosts])
    assert all((new[name][kept] == old[name][kept]).all() for name in old)


def test_a_few_large_splats_do_not_make_the_others_unneeded(device):
    before, table = parameters_of(device), table_of(60)
    table[:6, 1] = 1e5  # a background
    table[6, 1] = 1
    after = relocate_by_residual(before, table, added=0, seed=3, **LEAST)
    old, new = before.host()[0], after.host()[0]
    assert (new["means"] != old["means"]).any(axis=1).sum() == 2  # the seventh, and its host


def test_a_splat_that_no_view_looked_at_stays_unless_it_is_transparent(device):
    before, table = parameters_of(device), table_of(60)
    table[:6] = 0
    raw = before.host()[0]
    raw["logits"][3] = -7
    before = Parameters.of(device, raw, step=600)
    after = relocate_by_residual(before, table, added=0, seed=3, **LEAST)
    moved = (after.host()[0]["means"][:6] != raw["means"][:6]).any(axis=1)
    assert moved.tolist() == [False, False, False, True, False, False]


@pytest.mark.parametrize("residual", [0, np.inf])
def test_nothing_moves_where_there_is_no_residual_to_go_by(device, residual):
    before, table = parameters_of(device), table_of(60)
    table[:, 0] = 0
    table[:5, 1] = 0
    assert relocate_by_residual(before, table, added=9, seed=3, **LEAST) is before


def test_no_more_are_added_than_can_be_halved(device):
    before, table = parameters_of(device), table_of(60)
    table[:, 0] = 0
    table[7:9, 0] = 1
    after = relocate_by_residual(before, table, added=30, seed=3, **LEAST)
    assert len(after) == 62


def test_the_same_step_relocates_alike_and_another_does_not(device):
    table = table_of(60)
    table[:9, 1] = 0
    one, same = (
        relocate_by_residual(parameters_of(device), table, added=5, seed=3, **LEAST).host()[0]
        for _ in range(2)
    )
    other = relocate_by_residual(parameters_of(device), table, added=5, seed=4, **LEAST).host()[0]
    assert all(one[name].tobytes() == same[name].tobytes() for name in one)
    assert one["means"].tobytes() != other["means"].tobytes()


def test_it_looks_at_the_views_before_a_relocation_and_relocates_until_its_last(device):
    settings = ResidualSettings(first=200, every=100, views=30, last=0.85)
    strategy = settings.begin(parameters_of(device), RUN)
    looked = [step for step in range(1000) if strategy.looks_at(step)]
    assert looked == [at - k for at in range(200, 850, 100) for k in range(30, 0, -1)]
    all_of_them = replace(settings, views=1000).begin(parameters_of(device), RUN)
    assert [s for s in range(1000) if all_of_them.looks_at(s)] == list(range(100, 800))


def test_a_long_run_has_no_more_relocations_than_there_may_be(device):
    settings = ResidualSettings(first=100, every=50, relocations=10, last=1.0)
    strategy = settings.begin(parameters_of(device), replace(RUN, steps=3000))
    relocated = [step for step in range(3000) if strategy.relocates_at(step)]
    assert relocated == list(range(300, 3000, 300))
    assert [sum(strategy.looks_at(step) for step in range(at - 300, at)) for at in relocated] == [
        settings.views
    ] * len(relocated)
    short = settings.begin(parameters_of(device), replace(RUN, steps=400))
    assert [s for s in range(400) if short.relocates_at(s)] == list(range(100, 400, 50))
    uneven = replace(settings, first=0, every=1).begin(
        parameters_of(device), replace(RUN, steps=19)
    )
    assert [s for s in range(1, 19) if uneven.relocates_at(s)] == list(range(2, 19, 2))


def test_what_counts_as_unneeded_falls_until_the_last_relocation(device):
    settings = ResidualSettings(min_contribution=0.4, min_contribution_last=0.1, last=0.5)
    strategy = settings.begin(parameters_of(device), RUN)
    found = [strategy.min_contribution(step) for step in (0, 250, 500, 999)]
    assert found == pytest.approx([0.4, 0.25, 0.1, 0.1])


@pytest.mark.full
def test_what_was_seen_is_kept_and_checked(device):
    parameters = parameters_of(device)
    strategy = ResidualSettings().begin(parameters, RUN)
    frame = frame_of(device, parameters)
    strategy.look(frame, frame.image, device.zeros((40, 50, 3)), None)
    kept = strategy.state()
    again = ResidualSettings().begin(parameters, RUN)
    again.restore(kept)
    assert again.state()["contributions"].tobytes() == kept["contributions"].tobytes()
    for wrong in (np.zeros((60, 2), np.float32), np.full((60, 3), np.nan, np.float32)):
        with pytest.raises(CheckpointError, match="contributions"):
            again.restore({"contributions": wrong})
    with pytest.raises(CheckpointError):
        again.restore({})


@pytest.mark.full
def test_splats_with_modes_contribute_by_the_same_sums(device):
    """Modes of zero change no image, so that records of another layout say the same."""
    parameters, target = parameters_of(device), device.zeros((40, 50, 3))
    tables = []
    for modes in (False, True):
        if modes:
            parameters.widen("shape_modes", 3)
            parameters.widen("color_modes", 3)
        frame = frame_of(device, parameters)
        found = Contributions(device, len(parameters))
        found.add(frame, frame.image, target, None)
        tables.append(found.host())
    np.testing.assert_allclose(*tables, rtol=1e-3, atol=1e-3)


@pytest.mark.full
def test_grey_images_and_densities_are_refused(device):
    parameters = parameters_of(device)
    frame = frame_of(device, parameters)
    one = device.zeros((40, 50, 1))
    with pytest.raises(InputError, match="60 splats, contributions are of 59"):
        Contributions(device, 59).add(frame, frame.image, frame.image, None)
    with pytest.raises(InputError, match=r"channels.*mcmc"):
        Contributions(device, 60).add(frame, one, one, None)
    dense = Parameters.of(device, parameters.host()[0], density=True)
    for refused in (
        lambda: ResidualSettings().begin(dense, RUN),
        lambda: relocate_by_residual(dense, table_of(60), added=0, seed=0, **LEAST),
    ):
        with pytest.raises(InputError, match="densities"):
            refused()
