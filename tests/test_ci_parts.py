"""What installs the programs beside faultbond for the tests: it never fails, and says in a line what is not there."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / ".ci" / "parts"
NEEDED = ("bash", "env", "grep", "head", "mktemp", "rm", "sleep", "tail", "timeout", "cat")
pytestmark = [
    pytest.mark.skipif(not SCRIPT.is_file(), reason="there is no .ci, as in a package"),
    pytest.mark.skipif(any(shutil.which(name) is None for name in NEEDED), reason="not all tools of a shell are here"),
]
NOTHING = "exit 0"
APT = """\
echo "$@" >> {folder}/asked
case "$*" in
  *{fails}*) {how} ;;
  *--no-download*) : > {folder}/installed ;;
esac
exit 0
"""


def said(folder: Path, *, fails: str = "nothing", how: str = "exit 1", programs: dict[str, str] | None = None) -> str:
    """Run it where there are only these programs, and give what it says; what it asks of apt-get is noted."""
    tools = folder / "tools"
    tools.mkdir()
    for name in NEEDED:
        (tools / name).symlink_to(str(shutil.which(name)))
    known = {
        "apt-get": APT.format(folder=folder, fails=fails, how=how),
        "dpkg-query": f"[ -e {folder}/installed ] && echo installed; {NOTHING}",
        "dpkg": NOTHING,
        "sudo": 'shift; exec "$@"',
    }
    for name, text in (known if programs is None else programs).items():
        (tools / name).write_text(f"#!{shutil.which('bash')}\n{text}\n")
        (tools / name).chmod(0o755)
    environment = {"PATH": str(tools), "FAULTBOND_PARTS_PATIENCE": "1", "TMPDIR": str(folder)}
    done = subprocess.run(["bash", str(SCRIPT)], capture_output=True, text=True, env=environment, check=True)
    assert done.stderr == ""
    return done.stdout


def asked(folder: Path) -> list[str]:
    """Give what was asked of apt-get, without its options."""
    words = [line.split() for line in (folder / "asked").read_text().splitlines()]
    kinds = ("update", "--simulate", "--download-only", "--no-download")
    return [next(item for item in kinds if item in line) for line in words]


def test_all_is_fetched_before_it_is_installed(tmp_path: Path) -> None:
    """Each part is known to be had, all are fetched, then all are installed; a second time nothing is asked."""
    assert "tests that need them skip" not in said(tmp_path)
    assert [item for k, item in enumerate(asked(tmp_path)) if item not in asked(tmp_path)[:k]] == [
        "update",
        "--simulate",
        "--download-only",
        "--no-download",
    ]
    shutil.rmtree(tmp_path / "tools")
    (tmp_path / "asked").unlink()
    assert said(tmp_path) == ""
    assert not (tmp_path / "asked").exists()


@pytest.mark.parametrize("how", ["echo 'E: no network' >&2; exit 1", "sleep 60"])
@pytest.mark.parametrize(
    ("fails", "why", "last"),
    [
        ("--simulate", "this system does not have them", "--simulate"),
        ("--download-only", "they cannot be fetched", "--download-only"),
        ("--no-download", "they cannot be installed", "--no-download"),
    ],
)
def test_a_step_that_fails_or_hangs_ends_it(tmp_path: Path, how: str, fails: str, why: str, last: str) -> None:
    """It ends well with a line, and what follows that step is not tried."""
    told = said(tmp_path, fails=fails, how=how).splitlines()[-1]
    assert told.startswith("faultbond: without chromium-headless-shell fonts-liberation mosquitto ")
    assert f"({why}{': E: no network' if 'E:' in how else ''}); the tests that need them skip" in told
    assert asked(tmp_path)[-1] == last


def test_an_npm_that_is_there_is_left_alone(tmp_path: Path) -> None:
    """Whoever made it: Debian's does not go with the node of others. Where there is none it is installed."""
    assert " npm " in said(tmp_path).splitlines()[0]
    other = tmp_path / "other"
    other.mkdir()
    programs = {"apt-get": "exit 1", "dpkg-query": NOTHING, "dpkg": NOTHING, "sudo": NOTHING, "npm": NOTHING}
    told = said(other, programs=programs)
    assert "cppcheck" in told
    assert "npm" not in told


def test_without_lists_those_of_before_serve(tmp_path: Path) -> None:
    """Where the lists of packages cannot be had anew, as a source of others is gone, it goes on."""
    assert "skip" not in said(tmp_path, fails="update")
    assert asked(tmp_path)[-1] == "--no-download"


def test_without_apt_or_rights_nothing_is_tried(tmp_path: Path) -> None:
    """It says so."""
    assert "(there is no apt-get); the tests that need them skip" in said(tmp_path, programs={})
    if os.geteuid():
        shutil.rmtree(tmp_path / "tools")
        programs = {"apt-get": NOTHING, "dpkg-query": NOTHING, "sudo": "exit 1"}
        assert "(only root may install them)" in said(tmp_path, programs=programs)
