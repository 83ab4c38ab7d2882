"""Shells complete what the parser takes: verbs, options, choices and files."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from faultbond.cli import build_parser, main
from faultbond.cli.completion import SHELLS, Verb, script, verbs_of

needs_bash = pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")


@pytest.fixture(scope="module")
def scripts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the script of each shell."""
    folder = tmp_path_factory.mktemp("completion")
    for shell in SHELLS:
        (folder / shell).write_text(script(shell, build_parser()), encoding="utf-8")
    return folder


def completed(scripts: Path, folder: Path, *words: str) -> set[str]:
    """Give what bash offers for the last of some words behind the program's name."""
    line = (
        'source "$1"; shift; COMP_WORDS=(faultbond "$@"); COMP_CWORD=$#; _faultbond; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    call = ["bash", "--norc", "-c", line, "bash", str(scripts / "bash"), *words]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return set(done.stdout.split("\n")) - {""}


@needs_bash
def test_bash_completes(scripts: Path, tmp_path: Path) -> None:
    """Bash offers verbs, then options of the verb, choices of an option, and files, also such with blanks."""
    for name in ("model.yaml", "my plant.yaml", "data.csv"):
        (tmp_path / name).touch()
    verbs = {verb.name for verb in verbs_of(build_parser())}
    assert completed(scripts, tmp_path, "") == verbs
    assert completed(scripts, tmp_path, "s") == {"serve", "simulate"}
    assert completed(scripts, tmp_path, "--v") == {"--version"}
    assert completed(scripts, tmp_path, "run", "--me") == {"--method"}
    assert completed(scripts, tmp_path, "run", "--method", "") == {"bank", "classic"}
    assert completed(scripts, tmp_path, "run", "m") == {"model.yaml", "my plant.yaml"}
    assert completed(scripts, tmp_path, "fit", "model.yaml", "d") == {"data.csv"}
    assert completed(scripts, tmp_path, "fit", "model.yaml", "data.csv", "-o", "m") == {"model.yaml", "my plant.yaml"}
    assert completed(scripts, tmp_path, "simulate", "model.yaml", "--seed", "") == set()
    assert completed(scripts, tmp_path, "demo", "") == set()
    assert completed(scripts, tmp_path, "completion", "") == set(SHELLS)


@needs_bash
@pytest.mark.parametrize("verb", verbs_of(build_parser()), ids=lambda verb: verb.name)
def test_bash_knows_the_options_of_each_verb(verb: Verb, scripts: Path, tmp_path: Path) -> None:
    """What bash offers after a verb and a dash are the options in its help."""
    known = {word for item in verb.options for word in item.words}
    assert {"--help", "--json"} <= known
    assert completed(scripts, tmp_path, verb.name, "-") == known


@pytest.mark.parametrize("shell", SHELLS)
def test_shells_can_read_it(shell: str, scripts: Path) -> None:
    """Each shell reads its script without complaint, and each script names every verb and every long option."""
    text = (scripts / shell).read_text(encoding="utf-8")
    for verb in verbs_of(build_parser()):
        assert verb.name in text
        words = [word for item in verb.options for word in item.words if word.startswith("--")]
        assert [word for word in words if (f"-l {word[2:]}" if shell == "fish" else word) not in text] == []
    if shutil.which(shell):
        done = subprocess.run([shell, "-n", str(scripts / shell)], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")


def test_the_verb_prints_the_script(capsys: pytest.CaptureFixture[str]) -> None:
    """`completion SHELL` prints it; a shell that is not known is refused with the ones that are."""
    assert main(["completion", "bash"]) == 0
    assert capsys.readouterr().out == script("bash", build_parser())
    assert main(["completion", "csh"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert all(shell in told for shell in SHELLS)


@pytest.mark.parametrize("verb", verbs_of(build_parser()), ids=lambda verb: verb.name)
def test_help_has_an_example(verb: Verb, capsys: pytest.CaptureFixture[str]) -> None:
    """The help of each verb ends with a command that the program takes."""
    with pytest.raises(SystemExit):
        main([verb.name, "--help"])
    example = " ".join(capsys.readouterr().out.rpartition("Example: ")[2].split())
    command = re.search(r"faultbond ([^)\"&|;]+)", example)
    assert command is not None
    assert build_parser().parse_args(shlex.split(command[1])).verb == verb.name
