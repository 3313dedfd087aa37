"""``rift export``: files beside each other, what is said of them, and what is refused."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from rift_cl.commands.cli import main
from rift_cl.io.scenes.formats.formats import FORMATS
from rift_cl.io.scenes.splat_scene import SplatScene, XrayScene


@pytest.fixture
def arrays() -> dict[str, np.ndarray]:
    random = np.random.default_rng(0)
    return {
        "means": random.normal(size=(20, 3)),
        "log_scales": np.full((20, 3), -3.0),
        "quats": random.normal(size=(20, 4)),
        "logit_opacities": np.zeros(20),
        "sh": np.zeros((20, 4, 3)),
    }


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def export(*arguments: object) -> int:
    return main(["export", *map(str, arguments)])


@pytest.mark.parametrize("name", list(FORMATS))
def test_a_file_is_written_beside_the_others_and_never_twice(name, here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    out = "copy.ply" if name == "ply" else f"ball{FORMATS[name].suffix}"
    more = ("--out", out) if name == "ply" else ()
    assert export("ball.ply", "--to", name, *more) == 0
    content = (here / out).read_bytes()
    assert out in capsys.readouterr().out
    assert str(here).encode() not in content
    assert export("ball.ply", "--to", name, *more) == 5
    assert "--overwrite" in capsys.readouterr().err
    assert export("ball.ply", "--to", name, *more, "--overwrite") == 0
    assert (here / out).read_bytes() == content
    assert sorted(entry.name for entry in here.iterdir()) == sorted(["ball.ply", out])


def test_the_scene_itself_is_never_overwritten(here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    before = (here / "ball.ply").read_bytes()
    assert export("ball.ply", "--to", "ply", "--overwrite") == 5
    assert "is the scene itself" in capsys.readouterr().err
    assert (here / "ball.ply").read_bytes() == before


def test_what_is_lost_is_said_before_and_nothing_is_written_on_a_dry_run(here, arrays, capsys):
    SplatScene(**arrays, shape_modes=np.zeros((20, 3)), activation="exp").save(here / "ball.ply")
    assert export("ball.ply", "--to", "spz", "--dry-run") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "modes become" in said and "activation exp" in said
    assert [entry.name for entry in here.iterdir()] == ["ball.ply"]
    assert export("ball.ply", "--to", "spz") == 0
    assert "rift: modes become" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["html", *FORMATS])
def test_antialiased_splats_are_told_of_whatever_the_format(name, here, arrays, capsys):
    more = ("--dry-run", "--eps2d", 0.3)
    for antialiased in (False, True):
        SplatScene(**arrays, antialiased=antialiased).save(here / "ball.ply")
        assert export("ball.ply", "--to", name, "--out", "new", *more) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert ("Mip-Splatting" in said) == antialiased
        assert ("no field of the format says so" in said) == (antialiased and name != "spz")


def test_far_splats_of_spz_are_told_of_on_a_dry_run(here, capsys):
    random = np.random.default_rng(1)
    means = random.normal(size=(200, 3))
    for farthest in (10, 1e6):
        means[0] = [0, 0, farthest]
        SplatScene(
            means=means,
            log_scales=np.full((200, 3), -3.0),
            quats=np.tile([1.0, 0, 0, 0], (200, 1)),
            logit_opacities=np.zeros(200),
            sh=np.zeros((200, 1, 3)),
        ).save(here / "ball.ply")
        assert export("ball.ply", "--to", "spz", "--dry-run") == 0
        said = " ".join(capsys.readouterr().out.split())
        assert ("1 of 200 splats" in said) == (farthest == 1e6)


def test_a_scale_that_spz_cannot_hold_is_refused_also_on_a_dry_run(here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    for more in ((), ("--dry-run",)):
        assert export("ball.ply", "--to", "spz", "--scale", 1e5, *more) == 3
        said = " ".join(capsys.readouterr().err.split())
        assert "20 of 20 splats are made narrower" in said and "--scale" in said
    assert [entry.name for entry in here.iterdir()] == ["ball.ply"]


def test_spz_says_whether_splats_are_antialiased(here, arrays, capsys):
    for antialiased in (False, True):
        SplatScene(**arrays, antialiased=antialiased).save(here / "ball.ply")
        assert export("ball.ply", "--to", "spz", "--overwrite", "--eps2d", 0.3) == 0
        assert gzip.decompress((here / "ball.spz").read_bytes())[14] == antialiased
        assert ("the file says so" in " ".join(capsys.readouterr().err.split())) == antialiased


def test_densities_of_xrays_are_no_splats_of_a_viewer(here, arrays, capsys):
    XrayScene(**arrays | {"sh": np.zeros((20, 1, 3))}).save(here / "bone.ply")
    assert export("bone.ply", "--to", "spz") == 3
    assert "X-ray" in capsys.readouterr().err
    assert [entry.name for entry in here.iterdir()] == ["bone.ply"]


def test_an_up_that_is_guessed_is_called_so(here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    for given, guessed in (((), True), (("--up", 0, 0, 1), False)):
        assert export("ball.ply", "--to", "glb", "--dry-run", *given) == 0
        said = " ".join(capsys.readouterr().out.replace("│", " ").split())
        assert "is turned so that up" in said and ("guessed from the splats" in said) == guessed


def test_up_is_y_in_formats_that_say_so(here, arrays):
    SplatScene(**arrays).save(here / "ball.ply")
    assert export("ball.ply", "--to", "glb", "--up", 0, 0, 1, "--quiet") == 0
    from splat_readers import read_glb

    _, read = read_glb((here / "ball.glb").read_bytes())
    x, y, z = np.float32(arrays["means"]).T
    np.testing.assert_allclose(read["POSITION"], np.column_stack([x, z, -y]), atol=1e-6)


@pytest.mark.parametrize("name", ["html", "ply", "compressed-ply", "glb"])
def test_the_format_follows_from_the_extension(name, here, arrays):
    if name == "html":
        pytest.importorskip("viser")
    SplatScene(**arrays).save(here / "ball.ply")
    out = "new." + name.replace("-", ".")
    assert export("ball.ply", "--out", out, "--quiet") == 0
    assert export("ball.ply", "--out", "same", "--to", name, "--quiet") == 0
    assert (here / out).read_bytes() == (here / "same").read_bytes()


@pytest.mark.parametrize(
    ("name", "out", "other"),
    [
        ("ply", "new.spz", "spz"),
        ("glb", "new.SOG", "sog"),
        ("spz", "new.compressed.ply", "compressed-ply"),
        ("ply", "new.compressed.ply", "compressed-ply"),
        ("sog", "new.stl", "stl"),
    ],
)
def test_no_format_is_written_under_the_name_of_another(name, out, other, here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    for more in ((), ("--dry-run",)):
        assert export("ball.ply", "--to", name, "--out", out, *more) == 3
        said = " ".join(capsys.readouterr().err.split())
        assert f"--to {name} contradicts" in said and f"is that of {other}:" in said
    assert export("ball.ply", "--mesh", "--to", "ply", "--out", "new.obj") == 3
    assert [entry.name for entry in here.iterdir()] == ["ball.ply"]


def test_names_without_a_format_and_plys_that_are_compressed_are_as_they_are_told(here, arrays):
    SplatScene(**arrays).save(here / "ball.ply")
    for name, out in (("spz", "new.bin"), ("spz", "new"), ("compressed-ply", "new.ply")):
        assert export("ball.ply", "--to", name, "--out", out, "--quiet") == 0
    assert b"element chunk" in (here / "new.ply").read_bytes()


def test_an_extension_of_no_format_is_told(here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    assert export("ball.ply", "--out", "film.webp") == 3
    assert "'rift render'" in " ".join(capsys.readouterr().err.split())
    assert export("ball.ply", "--mesh", "--out", "new.xyz") == 3
    said = " ".join(capsys.readouterr().err.split())
    assert "(--to)" in said and "render" not in said
    assert [entry.name for entry in here.iterdir()] == ["ball.ply"]


@pytest.mark.parametrize("name", ["ply", "spz", "glb"])
def test_a_scale_multiplies_every_length(name, here, arrays):
    scene = SplatScene(**arrays)
    scene.save(here / "ball.ply")
    larger = SplatScene(
        **{**arrays, "means": 4 * arrays["means"], "log_scales": arrays["log_scales"] + np.log(4)}
    )
    larger.save(here / "larger.ply")
    suffix = FORMATS[name].suffix
    assert export("ball.ply", "--to", name, "--out", f"a{suffix}", "--scale", 4) == 0
    assert export("larger.ply", "--to", name, "--out", f"b{suffix}") == 0
    if name == "ply":
        found, wanted = SplatScene.load(here / "a.ply"), SplatScene.load(here / "b.ply")
        np.testing.assert_allclose(found.means, wanted.means, rtol=1e-6)
        np.testing.assert_allclose(found.log_scales, wanted.log_scales, rtol=1e-6)
    else:
        assert len((here / f"a{suffix}").read_bytes()) == len((here / f"b{suffix}").read_bytes())
    if name == "glb":
        # Positions are float32: a power of two changes none of their digits.
        assert (here / "a.glb").read_bytes()[:400] == (here / "b.glb").read_bytes()[:400]


@pytest.mark.parametrize("scale", ["0", "-1", "nan", "inf"])
def test_a_scale_that_is_none_is_refused(scale, here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    assert export("ball.ply", "--to", "spz", "--scale", scale) == 3
    assert "--scale" in capsys.readouterr().err


def test_a_page_has_no_scale(here, arrays, capsys):
    SplatScene(**arrays).save(here / "ball.ply")
    assert export("ball.ply", "--to", "html", "--scale", 2) == 3
    assert "--scale" in capsys.readouterr().err
