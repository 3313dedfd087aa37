"""The command line itself: what it lists, and that a command's help loads that command alone."""

import ast
import re
from dataclasses import fields

import pytest
import tyro

from rift_cl.commands.cli import COMMANDS, main
from rift_cl.commands.options import gathered, option_groups, shown_options
from rift_cl.commands.runner import command
from rift_cl.errors import InputError

# What the command line and one class of settings need: far below what any job loads.
MOST_MODULES = 24


def modules_after(python, *arguments):
    """Names of the modules that a process holds when the command line has answered."""
    done = python(
        "import sys\n"
        "from rift_cl.commands.cli import main\n"
        "try:\n"
        f"    main({list(arguments)!r})\n"
        "except SystemExit:\n"
        "    pass\n"
        "print('\\n' + repr(sorted(sys.modules)))"
    )
    assert done.returncode == 0, done.stderr
    return ast.literal_eval(done.stdout.splitlines()[-1])


def settings_modules(modules):
    return {name for name in modules if re.fullmatch(r"rift_cl\.commands\.\w+\.settings", name)}


@pytest.mark.parametrize("name", sorted(COMMANDS.keys() - {"fit photos", "fit xray"}))
def test_help_of_a_command_loads_its_settings_alone(python, name):
    modules = modules_after(python, name, "--help")
    assert settings_modules(modules) == {f"rift_cl.commands.{COMMANDS[name].module}"}
    assert sum(module.startswith("rift_cl") for module in modules) <= MOST_MODULES
    assert not {"numpy", "h5py", "pyopencl", "scipy"} & set(modules)


@pytest.mark.parametrize("name", ["fit photos", "fit xray"])
def test_help_of_a_fit_loads_no_trainer_and_no_renderer(python, name):
    modules = set(modules_after(python, *name.split(), "--help"))
    assert "rift_cl.train.settings" in modules
    computing = {"train.trainer", "train.parameters", "splat.renderer", "cl"}
    assert not modules & {f"rift_cl.{name}" for name in computing}
    assert not {"scipy.linalg", "scipy.ndimage", "h5py", "pyopencl"} & modules


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("no-such-command",), ()])
def test_the_overview_loads_no_settings(python, arguments):
    modules = modules_after(python, *arguments)
    assert settings_modules(modules) == set()
    assert "numpy" not in modules


def test_the_overview_says_of_every_command_what_its_help_says(capsys):
    assert main(["--help"]) == 0
    shown = capsys.readouterr().out
    for name, entry in COMMANDS.items():
        first = re.split(r"(?<=\.)\s", " ".join(entry.settings_class().__doc__.split()))[0]
        assert entry.summary == first, name
        assert f"{name} " in shown and entry.summary in shown


def test_fit_alone_names_both_of_its_commands(capsys):
    assert main(["fit", "--help"]) == 0
    shown = capsys.readouterr().out
    assert "rift fit photos" in shown and "rift fit xray" in shown
    assert main(["fit"]) == 2


@pytest.mark.parametrize("arguments", [["no-such-command"], []])
def test_no_command_is_told(capsys, arguments):
    assert main(arguments) == 2
    assert "rift --help" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["export", "fit", "a film.webp"], "--out 'a film.webp'"),
        (["reconstruct", "scan.h5", "out", "--no-such", "3"], "--out out"),
        (["fit", "photos", "capture", "fit"], "'rift fit photos' is to write there"),
        (["render", "fit", "a", "b"], None),
        (["render", "fit", "a", "--out", "b"], None),
        (["devices", "out"], None),
    ],
)
def test_a_path_too_many_is_taken_for_an_output(arguments, hint, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "Unrecognized options" in said
    assert hint in said if hint else "too many" not in said


@pytest.mark.full
@pytest.mark.parametrize("options", [[], ["--out", "fit"], ["--quiet", "--out", "fit"]])
def test_a_folder_called_as_the_command_is_the_capture(options, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        main(["fit", "photos", *options])
    assert "Missing from rift fit photos" in capsys.readouterr().err
    (tmp_path / "photos").mkdir()
    assert main(["fit", "photos", *options]) == 3
    assert "photos: " in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["fit", "photos", *options, "--steps", "none"])
    assert main(["fit", "photos", *options, "other"]) == 3
    assert "other: " in capsys.readouterr().err


def test_completion_knows_every_command(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--tyro-print-completion", "bash"])
    assert not end.value.code
    shown = capsys.readouterr().out
    assert all(name in shown for name in COMMANDS)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_setting_is_an_option_in_one_group(name):
    settings = COMMANDS[name].settings_class()
    shown = [field.name for group in option_groups(settings) for field in fields(group)]
    assert sorted(shown) == sorted(field.name for field in fields(settings))


def test_help_stands_in_groups_without_negative_twins(capsys):
    with pytest.raises(SystemExit):
        main(["reconstruct", "--help"])
    shown = capsys.readouterr().out
    titles = ("input", "method", "geometry", "correction", "output", "run", "expert", "messages")
    places = [shown.index(f" {title} options ") for title in titles]
    assert places == sorted(places)
    assert "--no-" not in shown and "(default: None)" not in shown


def test_help_shows_numbers_in_four_digits(capsys):
    with pytest.raises(SystemExit):
        main(["fit", "photos", "--help"])
    shown = " ".join(capsys.readouterr().out.replace("\u2502", " ").split())
    assert "(default: 0.07143)" in shown and "(default: 1e+10)" in shown
    assert not re.search(r"\d{5,}\.\d|\.\d{8,}", shown)


@pytest.mark.parametrize("job", ["fit photos", "fit xray"])
def test_what_few_fits_need_is_listed_for_experts(job):
    groups = {}
    for option in shown_options(COMMANDS[job].settings_class()):
        groups.setdefault(option.group.title, set()).add(option.name)
    assert groups.keys() == {"input", "training", "splats", "output", "run", "expert"}
    assert "steps" in groups["training"] and {"order", "eps2d"} <= groups["splats"]
    expert = ("learning_rates.", "strategy.", "solve.", "homogenisation.", "basis.")
    dotted = {name for names in groups.values() for name in names if name.startswith(expert)}
    assert len(dotted) > 15 and dotted <= groups["expert"]


def test_a_list_that_is_given_twice_is_one_list():
    settings = COMMANDS["plan"].settings_class()
    twice = ["--views", "3", "--camera", "a", "b", "--seed", "-1", "--camera=c", "--overwrite"]
    once = ["--views", "3", "--seed", "-1", "--overwrite", "--camera", "a", "b", "c"]
    assert gathered(twice, settings) == once
    assert gathered(once, settings) == once


def test_one_preset_is_given():
    settings = COMMANDS["fit photos"].settings_class()
    with pytest.raises(InputError, match="--preset is given 2 times"):
        gathered(["a", "--preset", "surface", "--preset=lobes"], settings)
    later = ["a", "--dry-run", "--dry-run", "--steps", "5", "--steps", "6"]
    assert gathered(later, settings) == later


def test_a_switch_that_is_on_is_turned_off_by_its_negative():
    found, settings = [], COMMANDS["fit photos"].settings_class()
    for twins, word in ((False, "no-noise-aware"), (True, "no-noise-aware"), (True, "noise-aware")):
        entry = command(lambda made, _: found.append(made), settings, twins=twins)
        assert not tyro.cli(entry, args=["capture", f"--homogenisation.{word}"])()
    aware = [made.training.homogenisation.noise_aware for made in found]
    assert aware == [False, False, True]


@pytest.mark.parametrize("name", ["reconstruct", "analyze", "fit xray"])
def test_help_names_what_an_option_takes_and_not_what_stands_for_nothing(name, capsys):
    with pytest.raises(SystemExit):
        main([*name.split(), "--help"])
    printed = capsys.readouterr().out
    assert "--theta STR" in printed and "None}" not in printed
