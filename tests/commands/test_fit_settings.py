"""Every setting of a fit is an option, and ``config.json`` repeats the fit that wrote it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from rift_cl.commands.cli import COMMANDS, main
from rift_cl.commands.fit_photos.presets import PRESETS
from rift_cl.commands.fit_photos.settings import FitPhotosSettings
from rift_cl.commands.fit_xray.settings import FitXraySettings
from rift_cl.commands.run_folder.saved_settings import options_of, record_of, saved_settings
from rift_cl.errors import InputError
from rift_cl.train.strategy import DefaultSettings

CLASSES = {"fit photos": FitPhotosSettings, "fit xray": FitXraySettings}
# Other values, for options that do not take every one of their type.
OTHERS = {
    "basis": "hermite",
    "geometry": Path("geometry.yaml"),
    "activation": "exp",
    "angular": "lg",
    "loss": "l2",
    "light": "linear",
    "homogenise_by": "coverage",
    "band_limit": "pixels",
    "format": "h5",
    "kind": "counts",
    "angle_unit": "degrees",
    "rows": (1, 2),
    "order": 2,
    "octaves": 1,
    "color_order": 3,
    "downscale": 2,
    "hold_out": 3,
    "center": 3.5,
    "pitch": 0.5,
    "row_pitch": 0.25,
    "noise": 0.5,
    "first_splats": 0.5,
    "strategy.grow_gradient": 0.5,
    "strategy.prune_screen_size": 0.5,
    "test": (Path("one"), Path("two")),
    "out": Path("other"),
    "rendering.near": 0.5,
    "rendering.far": 5.0,
    "rendering.tile": 8,
    "homogenise": 0.75,
    "tilt": 1.5,
    "preset": "lobes",
    "environment": "shared",
}


LEFT_OUT = {
    "fit photos": ("config", "strategy"),
    "fit xray": ("config", "strategy", "rendering.antialiased"),
}


def meant(monkeypatch, job, *words):
    """The settings that a command line means; nothing runs."""
    found = []
    entry = COMMANDS[job]._replace(run=lambda settings, output: found.append(settings))
    monkeypatch.setitem(COMMANDS, job, entry)
    assert main([*job.split(), *map(str, words)]) == 0
    return found[0]


def other_value(option):
    """A value that is not the default."""
    if option.name in OTHERS:
        return OTHERS[option.name]
    if isinstance(option.default, bool):
        return not option.default
    if option.default is None:
        return "other"
    return option.default + 1 if isinstance(option.default, int) else option.default / 2 or 0.25


@pytest.mark.parametrize(
    ("job", "kind"),
    [("fit photos", {}), ("fit photos", {"strategy": "default"}), ("fit xray", {})],
    ids=["residual", "default", "xray"],
)
def test_every_setting_is_an_option(monkeypatch, job, kind):
    usual = CLASSES[job].of(Path("what"), Path("rift-fit"), **kind)
    # Absolute gradients are for splats without modes, and nothing dims what adds up.
    wanted = [
        option._replace(value=other_value(option))
        for option in options_of(usual)
        if not (option.fixed or option.positional or option.name in LEFT_OUT[job])
        and (not kind or option.name.startswith("strategy."))
    ]
    words = [word for option in wanted for word in option.words()]
    for name, value in kind.items():
        words += [f"--{name}", value]
    found = {
        option.name: option.value for option in options_of(meant(monkeypatch, job, "x", *words))
    }
    assert {option.name: option.value for option in wanted}.items() <= found.items()
    assert len(wanted) == 12 if kind else len(wanted) > 50


def test_settings_by_name_are_those_of_the_command_line(monkeypatch):
    options = {"steps": 9, "basis": "hermite", "learning_rates.means": 1e-3, "strategy.every": 7}
    words = ("--steps", 9, "--basis", "hermite", "--learning-rates.means", 1e-3)
    found = meant(monkeypatch, "fit photos", "x", "--out", "y", *words, "--strategy.every", 7)
    assert found == FitPhotosSettings.of(Path("x"), Path("y"), **options)
    whole = FitPhotosSettings.of(Path("x"), Path("y"), strategy=DefaultSettings(every=7))
    by_name = {"strategy": "default", "strategy.every": 7}
    assert whole == FitPhotosSettings.of(Path("x"), Path("y"), **by_name)


@pytest.mark.parametrize("name", PRESETS)
def test_options_override_a_preset_on_the_command_line_and_in_python(monkeypatch, name):
    words = ("--preset", name, "--learning-rates.means", 1e-3)
    found = meant(monkeypatch, "fit photos", "x", "--out", "y", *words)
    options = {"preset": name, "learning_rates.means": 1e-3}
    assert found == FitPhotosSettings.of(Path("x"), Path("y"), **options)
    wanted = {**PRESETS[name], **options}
    assert wanted.items() <= {option.name: option.value for option in options_of(found)}.items()


def test_a_preset_that_contradicts_an_option_is_refused():
    settings = FitPhotosSettings.of(Path("x"), Path("y"), preset="lobes", sh_degree=2)
    with pytest.raises(InputError, match="--sh-degree"):
        settings.check()


def test_a_preset_and_a_run_to_repeat_are_refused_together(tmp_path, capsys):
    config = tmp_path / "config.json"
    config.write_text("{}", encoding="utf-8")
    assert main(["fit", "photos", "x", "--preset", "lobes", "--config", str(config)]) == 3
    assert "--preset" in capsys.readouterr().err


@pytest.mark.parametrize("job", CLASSES)
def test_a_record_gives_the_settings_back(tmp_path, job):
    kind = {"strategy": "default"} if job == "fit photos" else {"solve": 20, "rows": (1, 3)}
    given = CLASSES[job].of(Path("x"), Path("y"), steps=9, **kind).decided(50)
    path = tmp_path / "config.json"
    path.write_text(json.dumps({"job": job, "settings": record_of(given)}))
    found = saved_settings(path, job, CLASSES[job])
    assert found == given == found.decided(50)


@pytest.mark.full
def test_a_config_repeats_a_fit_and_is_repeated_by_it(capture, tmp_path):
    def run(out, *words):
        options = ("--out", str(out), "--quiet")
        assert main(["fit", *words, *options]) == 0
        config = json.loads((out / "config.json").read_text())
        splats = hashlib.sha256((out / "scene.ply").read_bytes()).hexdigest()
        return splats, {k: v for k, v in config["settings"].items() if k not in ("out", "config")}

    words = ("--steps", "30", "--splats", "60", "--hold-out", "4", "--homogenise", "0.5")
    more = ("--learning-rates.quats", "0.002", "--rendering.antialiased", "--basis", "hermite")
    first = run(tmp_path / "1", str(capture), *words, *more)
    decided = first[1]["training"]
    assert decided["basis"]["order"] == decided["basis"]["color_order"] == 1
    assert decided["noise"] is not None and first[1]["downscale"] == first[1]["first_splats"] == 1
    second = run(tmp_path / "2", "--config", str(tmp_path / "1" / "config.json"))
    assert second == first == run(tmp_path / "3", "--config", str(tmp_path / "2" / "config.json"))
    again = run(tmp_path / "4", "--config", str(tmp_path / "1" / "config.json"), "--seed", "7")
    assert again[0] != first[0]
    assert again[1]["training"] == {**decided, "seed": 7}


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({"job": "fit photos", "settings": {"holdout": 3}}, "'holdout'; did you mean 'hold_out'"),
        (
            {"job": "fit photos", "settings": {"training": {"learning_rate": {}}}},
            "'learning_rate'; did you mean 'learning_rates'",
        ),
        ({"job": "fit photos", "settings": {"training": {"steps": "many"}}}, "wanted a whole"),
        ({"job": "fit photos", "settings": {"training": {"steps": 0}}}, "steps is 0"),
        ({"job": "fit photos", "settings": {"training": 7}}, "wanted settings by name"),
        ({"job": "fit photos", "settings": {"training": {"strategy": {"name": "best"}}}}, "'best'"),
        ({"job": "fit photos", "settings": {"light": "candle"}}, "wanted one of display, linear"),
        ({"job": "fit photos", "rift_cl": "0.0.1", "settings": {}}, "version '0.0.1'"),
        ({"job": "fit xray", "settings": {}}, "'rift fit xray', not of 'rift fit photos'"),
        ({"settings": {}}, "cannot be read"),
    ],
)
def test_a_config_that_cannot_be_used_is_told_in_a_sentence(tmp_path, capsys, record, words):
    path = tmp_path / "config.json"
    path.write_text(json.dumps(record))
    assert main(["fit", "photos", "x", "--config", str(path)]) == 3
    told = capsys.readouterr().err
    assert words in told and "Traceback" not in told


def test_an_option_that_is_not_there_is_told_with_the_nearest():
    with pytest.raises(InputError, match=r"'spalts'.*'splats'"):
        FitPhotosSettings.of(Path("x"), Path("y"), spalts=3)
    with pytest.raises(InputError, match="refine_poses"):
        FitXraySettings.of(Path("x"), Path("y"), refine_poses=True)


@pytest.mark.parametrize(
    ("job", "words", "option", "field"),
    [
        ("fit photos", "--loss l3", "--loss", "loss"),
        ("fit photos", "--rendering.tile 0", "--rendering.tile", "rendering.tile"),
        ("fit photos", "--learning-rates.means -1", "--learning-rates.means", "learning_rates"),
        ("fit photos", "--homogenise 9", "--homogenise", "homogenise"),
        ("fit photos", "--order 2", "--order", "order"),
        (
            "fit photos",
            "--strategy default --strategy.split-scale -1",
            "--strategy.split-scale",
            "strategy.split_scale",
        ),
        ("fit xray", "--splats 0", "--splats", "splats"),
    ],
)
def test_a_refused_setting_is_named_as_its_option_and_in_python_as_its_field(
    job, words, option, field, capsys, tmp_path
):
    assert main([*job.split(), str(tmp_path), *words.split()]) == 3
    assert capsys.readouterr().err.startswith(f"rift: {option} is ")
    names = (word.removeprefix("--").replace("-", "_") for word in words.split()[::2])
    values = [json.loads(v) if v[-1].isdigit() and v != "l3" else v for v in words.split()[1::2]]
    with pytest.raises(InputError, match=f"^'rift {job}': {field}"):
        CLASSES[job].of(tmp_path, tmp_path, **dict(zip(names, values, strict=True)))


@pytest.mark.parametrize("kind", ["nope", "xray"])
def test_a_kind_that_is_none_of_these_fits_is_refused(kind, capsys, tmp_path):
    assert main(["fit", "photos", str(tmp_path), "--strategy", kind]) == 3
    said = capsys.readouterr().err
    assert said.startswith(f"rift: --strategy is {kind!r}, wanted one of residual, mcmc, default, ")
    assert "rift --load FILE.py" in said
    with pytest.raises(InputError, match="strategy is "):
        FitPhotosSettings.of(Path("x"), Path("y"), strategy=kind)
