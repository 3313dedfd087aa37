"""Variants of the search for defaults are fits', and its tables tell what was found."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_xray.settings import FitXraySettings

TOOLS = Path(__file__).parents[2] / "tools"


@pytest.fixture
def search(monkeypatch):
    monkeypatch.syspath_prepend(TOOLS)
    yield importlib.import_module("search_defaults")
    sys.modules.pop("search_defaults", None)


@pytest.fixture
def scores(search):
    size = search.Size(3000, 20_000, 1, 0.1)
    return search.Scores("0.1", "lego", 0, size, 30.0, 0.9, 12.0)


@pytest.mark.parametrize(
    ("kind", "kept"), [("photos", FitPhotosSettings), ("xray", FitXraySettings)]
)
def test_every_variant_is_taken_and_no_two_are_the_same(search, kind, kept):
    variants = search.VARIANTS[kind]
    made = [kept.of(Path("capture"), Path("out"), **values) for values in variants.values()]
    for number, settings in enumerate(made):
        settings.check()
        assert settings not in made[:number], [*variants][number]


def test_a_factor_is_of_what_was_given_or_of_the_default(search):
    given = {"learning_rates.means": 3.0}
    found = search.times(2, "learning_rates.means", "learning_rates.logits", of=given)
    settings = FitPhotosSettings.of(Path("capture"), Path("out")).training
    assert found["learning_rates.means"] == 6
    assert found["learning_rates.logits"] == 2 * settings.learning_rates.logits


def test_gains_are_over_the_same_seeds_and_spread_is_half_of_what_seeds_differ_by(search, scores):
    found = [scores, replace(scores, seed=1, psnr=40.0)]
    ours = [(0, 33.0), (1, 44.0), (2, 46.0)]
    found += [replace(scores, variant="defaults", seed=seed, psnr=psnr) for seed, psnr in ours]
    (table, meant) = search.tables(found)
    assert table.rows == [("0.1", "35.00 ± 5.00, 12 s"), ("defaults", "41.00 ± 6.50 (+3.50), 12 s")]
    assert [row[0] for row in meant.rows] == ["0.1", "defaults"]
    assert "--strategy.noise 5e+05" in meant.rows[0][1]


def test_only_fits_of_one_size_compare(search, scores):
    larger = replace(scores, variant="defaults", size=replace(scores.size, steps=30_000))
    tables = [*search.tables([scores, larger])][:-1]
    assert [len(table.rows) for table in tables] == [1, 1]
    assert "+" not in tables[1].rows[0][1]


def test_kinds_are_told_apart(search, scores):
    xray = replace(scores, kind="xray", variant="min mass x 4", capture="tooth", ssim=None)
    found = [scores, xray, replace(xray, variant="defaults", psnr=29.0)]
    photos, _, rays, meant = search.tables(found)
    assert (photos.title.split(":")[0], rays.title.split(":")[0]) == ("Photographs", "X-rays")
    assert [row[1] for row in rays.rows] == ["29.00, 12 s", "30.00 (+1.00), 12 s"]
    assert "--strategy.min-mass 0.08" in meant.rows[1][1]


def test_a_search_goes_on_where_it_was(search, scores, tmp_path, monkeypatch):
    fitted = []

    def fit(options, capture, variant, seed, size):
        fitted.append((capture.name, variant, seed))
        return replace(scores, capture=capture.name, variant=variant, seed=seed, size=size)

    monkeypatch.setattr(search, "_fitted", fit)
    asked = search.Options((Path("lego"),), variants=("0.1", "moves / 2"), out=tmp_path / "search")
    search.search(asked)
    search.search(replace(asked, seeds=(0, 1)))
    variants = [(variant, seed) for seed in (0, 1) for variant in asked.variants]
    assert fitted == [("lego", *variant) for variant in variants]
    kept = [search.Scores.read(path) for path in asked.out.glob("*.json")]
    assert {(fit.variant, fit.seed) for fit in kept} == set(variants)
