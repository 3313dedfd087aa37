"""The pictures of the documentation, each with the command that made it and its processor time.

    python tools/draw_gallery.py --data data          # all that can be drawn from what is there
    python tools/draw_gallery.py --only plan bases    # some of them

Pictures of tutorials come from running the tutorials; the others from the commands that their
functions name. Real data are looked for in the folder ``--data`` by the names that ``rift samples``
gives them (tooth/tooth.h5, ...), and commands name them so. ``drawn.json`` beside the pictures
keeps what was run, when and on which device; ``docs/gallery.md`` shows it between marks.
"""

from __future__ import annotations

import io
import json
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tyro
from PIL import Image

import rift_cl as rift
from rift_cl.io import read_image, read_volume
from rift_cl.report.plot import figure_png, image_grid
from rift_cl.report.plot.figure import add_panel, new_figure
from run_page import inside, run_commands, run_page

_ROOT = Path(__file__).parents[1]
_GALLERY = _ROOT / "docs" / "gallery.md"
_TUTORIALS = _ROOT / "docs" / "tutorials"
# Bytes of a still picture and of a film, at most.
_STILL, _FILM = 150_000, 1_000_000
_BLUE = "#1f4e8c"
_LETTERS = 9
# Views of each panel of coverage, and how far the ring's stand above its plane, in radians.
_VIEWS, _ABOVE = 96, np.radians(30)


@dataclass(frozen=True)
class Options:
    """Draw the pictures of the documentation.

    Args:
        data: folder of real data; pictures whose data are absent are left as they are.
        only: names of pictures, such as plan; all if none is given.
        out: folder of the pictures and of drawn.json.
    """

    data: Path | None = None
    only: tuple[str, ...] = ()
    out: Path = _ROOT / "docs" / "pictures"


class Picture(NamedTuple):
    """A picture that can be drawn.

    Args:
        draw: draws it in the current folder, which holds the data; what it returns is written.
        commands: what a reader types to get the same.
        needs: the data that it reads, relative to the folder of real data; empty if none.
    """

    draw: Callable[[], bytes]
    commands: str
    needs: str = ""


def _slices(path: Path) -> np.ndarray:
    return np.asarray(read_volume(path))


def _pair(images: list[Any], titles: list[str], window: Any = None, **how: Any) -> bytes:
    columns = how.pop("columns", len(images))
    return _small(
        figure_png(image_grid(images, titles=titles, columns=columns, window=window, **how))
    )


def _small(png: bytes) -> bytes:
    """The picture with as many colours, or greys, as let it stay small."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    samples = np.asarray(picture, np.uint8)
    grey = (samples == samples[..., :1]).all()
    found = png
    for colours in (256, 128, 64, 32):
        buffer = io.BytesIO()
        if grey:
            step = 255 / (colours - 1)
            few = Image.fromarray(np.rint(np.rint(samples[..., 0] / step) * step).astype(np.uint8))
        else:
            few = picture.quantize(colours, dither=Image.Dither.NONE)
        few.save(buffer, "PNG", optimize=True)
        found = buffer.getvalue()
        if len(found) <= _STILL:
            break
    return found


_TOOTH = """\
rift reconstruct tooth/tooth.h5 --method backproject --rings off --out unfiltered
rift reconstruct tooth/tooth.h5 --out slices
"""
_DENDRITES = """\
rift reconstruct dendrites/RealDataDend.mat --background 100 --center 629.5 --rings off \\
    --out striped
rift reconstruct dendrites/RealDataDend.mat --background 100 --center 629.5 --rings vo \\
    --out slices
"""
_ORNAMENT = """\
rift samples ornament --out capture
rift fit capture --out fit --steps 5000 --splats 8000
rift render fit --out film --frames 36 --size 320 240
"""
_WALNUT = "rift reconstruct walnut/walnut_cone.npz --out volume\n"
_PLAN = "rift plan --views 24 --diameter 60 --elevation 0 60 --azimuth -60 60 --out plan\n"


def _tooth() -> bytes:
    run_commands(_TOOTH, "draw_gallery")
    slices = [_slices(Path(f"{name}/slices"))[0] for name in ("unfiltered", "slices")]
    # Only the filtered slice has a unit: each has a window of its own.
    windows = [tuple(np.percentile(image, [0.5, 99.5])) for image in slices]
    names = ["without the filter", "with it, rings removed"]
    titles = [
        f"{name}\nwindow {low:.2g} to {high:.2g}".replace("-", "\N{MINUS SIGN}")
        for name, (low, high) in zip(names, windows, strict=True)
    ]
    images = [_grey(image, *window) for image, window in zip(slices, windows, strict=True)]
    return _pair(images, titles)


def _grey(image: np.ndarray, low: float, high: float) -> np.ndarray:
    """Equal red, green and blue, black at ``low`` and white at ``high``."""
    return np.repeat(np.clip((image - low) / (high - low), 0, 1)[..., None], 3, -1)


def _dendrites() -> bytes:
    run_commands(_DENDRITES, "draw_gallery")
    before, after = _slices(Path("striped/slices"))[0], _slices(Path("slices/slices"))[0]
    quarter = len(after) // 4
    cut = slice(quarter, 3 * quarter)
    images = [_averaged(image[cut, cut]) for image in (before, after)]
    window = tuple(np.percentile(images[1], [0.5, 99.5]))
    return _pair(images, ["as measured", "stripes removed"], window)


def _averaged(image: np.ndarray) -> np.ndarray:
    """Means of 3 x 3 samples, against the noise."""
    side = len(image) // 3
    return image[: 3 * side, : 3 * side].reshape(side, 3, side, 3).mean((1, 3))


def _walnut() -> bytes:
    run_commands(_WALNUT, "draw_gallery")
    volume = _slices(Path("volume/slices"))
    z, y, x = (side // 2 for side in volume.shape)
    high = float(np.percentile(volume, 99.8))
    views = [volume[z], volume[:, y], volume[:, :, x]]
    titles = ["across the axis", "along it", "along it, turned"]
    return _pair(views, titles, (0, high), unit="per mm")


def _ornament() -> bytes:
    run_commands(_ORNAMENT, "draw_gallery")
    frames = sorted(Path("film/frames").glob("*.png"))
    _film(frames)
    quarters = frames[:: len(frames) // 4]
    return _pair([read_image(frame)[..., :3] for frame in quarters], [""] * 4)


def _film(frames: list[Path]) -> None:
    """An animated picture of the frames, which stops after two turns."""
    pictures = [Image.open(frame).convert("RGB") for frame in frames]
    for quality in (90, 80, 70, 60, 50, 40):
        pictures[0].save(
            "film.webp",
            save_all=True,
            append_images=pictures[1:],
            duration=110,
            loop=2,
            quality=quality,
            method=6,
        )
        if Path("film.webp").stat().st_size <= _FILM:
            return


def _plan() -> bytes:
    run_commands(_PLAN, "draw_gallery")
    frames = json.loads(Path("plan/transforms.json").read_text())["frames"]
    places = np.array([np.array(frame["transform_matrix"])[:3, 3] for frame in frames])
    azimuth = np.degrees(np.arctan2(places[:, 1], places[:, 0]))
    elevation = np.degrees(np.arcsin(places[:, 2] / np.linalg.norm(places, axis=1)))
    figure = new_figure(620, 380)
    axes = figure.add_axes((0.14, 0.18, 0.82, 0.68))
    axes.scatter(azimuth, elevation, color=_BLUE, s=30)
    axes.set_xlabel("azimuth in degrees")
    axes.set_ylabel("elevation in degrees")
    axes.set_title("24 planned views in a sector", fontsize=10)
    return _small(figure_png(figure))


def _coverage() -> bytes:
    """How densely 96 views on a ring, and 96 all around, sample a plane that holds the axis."""
    target = rift.Target(center=np.zeros(3), diameter=1.0, snr=1000.0)
    edge = 24.0
    line = np.linspace(-edge, edge, 193)
    up, along = np.meshgrid(line, line, indexing="ij")
    k = np.stack([along, np.zeros_like(up), up], -1).reshape(-1, 3)
    turn = np.arange(_VIEWS) * 2 * np.pi / _VIEWS
    golden = np.arange(_VIEWS) * np.pi * (3 - np.sqrt(5))
    height = 1 - (2 * np.arange(_VIEWS) + 1) / _VIEWS
    places = {
        f"a ring of {_VIEWS} views, {np.degrees(_ABOVE):.0f}° up": _from(
            turn, np.full(_VIEWS, _ABOVE)
        ),
        f"{_VIEWS} views all around": _from(golden, np.arcsin(height)),
    }
    figure = new_figure(1190, 560)
    for place, (title, views) in enumerate(places.items()):
        found = rift.coverage(views, target, k)[0].reshape(up.shape)
        axes = add_panel(figure, 92 + 500 * place, 40, 440, 440)
        shown = axes.imshow(
            np.log10(np.clip(found, 1e-3, None)),
            cmap="gray",
            vmin=-1,
            vmax=2,
            extent=(-edge, edge, -edge, edge),
            origin="lower",
        )
        axes.set_title(title, fontsize=_LETTERS)
        axes.set_xlabel("kx, cycles per diameter", fontsize=_LETTERS)
        axes.tick_params(labelsize=_LETTERS - 1)
        axes.axvline(0, color="white", linewidth=0.8, linestyle=":")
        axes.text(0.8, -edge + 1, "axis", color="white", fontsize=_LETTERS)
        if not place:
            axes.set_ylabel("kz", fontsize=_LETTERS)
            _mark_cone(axes, edge)
    bar = figure.colorbar(shown, cax=add_panel(figure, 1052, 40, 18, 440), extend="min")
    bar.set_label("log10 density", fontsize=_LETTERS)
    bar.ax.tick_params(labelsize=_LETTERS - 1)
    return _small(figure_png(figure))


def _mark_cone(axes: Any, edge: float) -> None:
    """Mark the frequencies within the ring's elevation of its axis, which no view samples."""
    side = edge * np.tan(_ABOVE)
    for x in (-side, side):
        axes.plot([-x, x], [-edge, edge], color="white", linewidth=1.2, linestyle="--")
    axes.text(0, 0.72 * edge, "missed", color="white", fontsize=_LETTERS, ha="center", va="center")
    axes.set_xlim(-edge, edge)


def _from(azimuth: np.ndarray, elevation: np.ndarray) -> list[rift.Camera]:
    """Cameras 3 away that look at the origin."""
    cameras = []
    for a, e in zip(azimuth, elevation, strict=True):
        out = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0])
        view = np.eye(4)
        view[:3, :3] = right, np.cross(-out, right), -out
        view[2, 3] = 3
        cameras.append(rift.Camera((256, 256), [[600, 0, 128], [0, 600, 128], [0, 0, 1]], view))
    return cameras


def _bases() -> bytes:
    line = np.linspace(-4, 4, 97)
    y, x = np.meshgrid(line[::-1], line, indexing="ij")
    points = np.stack([x, y], -1)
    images, titles = [], []
    hermite, laguerre = rift.basis.Hermite(2, 2), rift.basis.Laguerre(2)
    for basis in (hermite, laguerre):
        images += [basis.evaluate(one, points) for one in np.eye(basis.n_coeff)]
    titles += [f"m = {m}, n = {n}" for m, n in hermite.indices()]
    titles += [_polar(*index) for index in laguerre.indices()]
    rows = ["Hermite", "Laguerre"]
    return _pair(images, titles, (-1, 1), columns=6, size=1.2, row_labels=rows)


def _polar(p: int, turns: int, sine: int) -> str:
    part = ("\ncosine", "\nsine")[sine] if turns else "\n"
    return f"p = {p}, l = {turns}{part}"


def _tutorial(name: str, draw: Callable[[dict[str, Any]], bytes]) -> Callable[[], bytes]:
    return lambda: draw(run_page(_TUTORIALS / f"{name}.md", Path()))


def _scan_slice(names: dict[str, Any]) -> bytes:
    titles = ["reconstructed,\nwith 5,000 photons' noise", "the phantom itself"]
    return _pair([names["middle"], names["truth"]], titles, (0, 1), unit="per mm")


def _few_views(_: dict[str, Any]) -> bytes:
    images = [_slices(Path(f"few-{name}/slices"))[2] for name in ("fbp", "tv")]
    return _pair(images, ["30 views, fbp", "30 views, tv"], (0, 1), unit="per mm")


def _held_out(_: dict[str, Any]) -> bytes:
    seen = rift.evaluate("fit").scores["held out"][0]
    other = rift.evaluate("fit", ["elsewhere"]).scores["elsewhere"][0]
    titles = ["held-out photograph", "the fit", "from elsewhere: truth", "the fit"]
    return _pair([seen.truth, seen.image, other.truth, other.image], titles)


def _operator_slices(names: dict[str, Any]) -> bytes:
    return _pair(list(names["slices"].values()), list(names["slices"]), (0, 1), size=1.9)


def _filter_slices(names: dict[str, Any]) -> bytes:
    return _pair(list(names["slices"].values()), list(names["slices"]), (0, 1))


def _page(name: str) -> str:
    return f"python tools/run_page.py docs/tutorials/{name}.md"


PICTURES = {
    "tooth": Picture(_tooth, _TOOTH, "tooth/tooth.h5"),
    "dendrites": Picture(_dendrites, _DENDRITES, "dendrites/RealDataDend.mat"),
    "walnut": Picture(_walnut, _WALNUT, "walnut/walnut_cone.npz"),
    "plan": Picture(_plan, _PLAN),
    "coverage": Picture(_coverage, "python tools/draw_gallery.py --only coverage"),
    "bases": Picture(_bases, "python tools/draw_gallery.py --only bases"),
    "tutorial-scan": Picture(_tutorial("scan", _scan_slice), _page("scan")),
    "tutorial-scan-few": Picture(_tutorial("scan", _few_views), _page("scan")),
    "tutorial-photographs": Picture(_tutorial("photographs", _held_out), _page("photographs")),
    "ornament": Picture(_ornament, _ORNAMENT),
    "tutorial-operators": Picture(_tutorial("operators", _operator_slices), _page("operators")),
    "tutorial-own-filter": Picture(_tutorial("own_parts", _filter_slices), _page("own_parts")),
}


def draw(options: Options) -> Iterator[str]:
    """Draw what is asked for and can be drawn.

    Yields:
        A line about each picture.
    """
    options.out.mkdir(parents=True, exist_ok=True)
    kept = options.out / "drawn.json"
    drawn = json.loads(kept.read_text()) if kept.exists() else {}
    data = (options.data or Path("data")).absolute()
    out = options.out.absolute()
    for name in options.only or PICTURES:
        picture = PICTURES[name]
        if not (data / picture.needs).exists() and picture.needs:
            yield f"{name}: {data / picture.needs} is absent"
            continue
        with (
            tempfile.TemporaryDirectory() as folder,
            inside(Path(folder)),
            redirect_stdout(io.StringIO()),
        ):
            if picture.needs:
                Path(picture.needs).parent.mkdir()
                shutil.copy(data / picture.needs, picture.needs)
            begun = time.process_time()
            png = picture.draw()
            seconds = time.process_time() - begun
            if Path("film.webp").exists():
                (out / f"{name}.webp").write_bytes(Path("film.webp").read_bytes())
        (out / f"{name}.png").write_bytes(png)
        drawn[name] = {
            "commands": picture.commands.strip().splitlines(),
            "processor_seconds": round(seconds, 1),
            "device": rift.default_device().name,
            "version": rift.__version__,
            "date": f"{datetime.now(timezone.utc):%Y-%m-%d}",
        }
        kept.write_text(json.dumps(dict(sorted(drawn.items())), indent=1) + "\n")
        yield f"{name}: {seconds:.1f} s of processor time, {len(png)} bytes"
    if _GALLERY.exists():
        _GALLERY.write_text(with_facts(_GALLERY.read_text(encoding="utf-8"), drawn), "utf-8")


def with_facts(page: str, drawn: dict[str, Any]) -> str:
    """The gallery with each picture's commands, time, device and date between its marks."""

    def facts(found: re.Match[str]) -> str:
        name = found[1]
        if name not in drawn:
            return found[0]
        fact = drawn[name]
        commands = "\n".join(fact["commands"])
        return (
            f"<!-- drawn: {name} -->\n```text\n{commands}\n```\n\n"
            f"{fact['processor_seconds']} s of processor time on {fact['device']}, "
            f"{fact['date']}.\n<!-- end -->"
        )

    return re.sub(r"<!-- drawn: (\S+) -->.*?<!-- end -->", facts, page, flags=re.DOTALL)


def main() -> int:
    """Run with the command line's arguments; the exit status."""
    for line in draw(tyro.cli(Options)):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
