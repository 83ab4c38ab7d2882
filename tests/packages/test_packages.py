"""The packages that users install: the same bytes each time, whole, and at work in an environment of their own.

`make dist` does more, with all that is needed from the package index; it takes minutes.
"""

import json
import re
import sysconfig
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml
from environments import DONE, NO_VERDICT, PROJECT, ROOT, USER_MISTAKE, built, called, environment_with_nothing, install

SOURCE = ROOT / "src" / "faultbond"
CFF_NEEDS = {"cff-version", "message", "title", "authors"}  # citation-file-format 1.2.0
CFF_KNOWS = CFF_NEEDS | {"type", "version", "license", "abstract", "keywords", "date-released", "doi", "url"}
CFF_KNOWS |= {"repository-code", "references", "preferred-citation", "identifiers", "contact", "commit"}


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The wheel and the package of sources."""
    return built(tmp_path_factory.mktemp("packages"))


@pytest.fixture(scope="module")
def python(packages: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of a new environment with the wheel; what faultbond needs it takes from this environment."""
    folder = tmp_path_factory.mktemp("environment")
    interpreter = environment_with_nothing(folder)
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "needed.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    install(interpreter, "--no-deps", "--no-index", "--no-compile", str(packages[0]))
    return interpreter


def test_two_builds_give_the_same_bytes(packages: tuple[Path, Path], tmp_path: Path) -> None:
    """Neither the time nor the user's mask of permissions is in a package."""
    again = built(tmp_path, umask=0o077)
    assert [path.name for path in again] == [path.name for path in packages]
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in packages]


def test_the_wheel_is_whole(packages: tuple[Path, Path]) -> None:
    """The wheel holds each file of the package, C files and pages included, the example, and nothing else."""
    with zipfile.ZipFile(packages[0]) as wheel:
        found = {name for name in wheel.namelist() if ".dist-info/" not in name}
        metadata = {Path(name).name for name in wheel.namelist()} - {Path(name).name for name in found}
    wanted = {f"faultbond/{path.relative_to(SOURCE)}" for path in SOURCE.rglob("*") if path.is_file()}
    wanted = {name for name in wanted if "__pycache__" not in name}
    copied = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]
    folders = tuple(f"{name}/" for name in copied["wheel"]["force-include"].values())
    assert {name for name in found if not name.startswith(folders)} == wanted
    assert {"faultbond/py.typed", "faultbond/core/core.c", "faultbond/_examples/tank/model.yaml"} <= found
    assert {"LICENSE", "METADATA", "entry_points.txt"} <= metadata


def test_the_sources_are_whole(packages: tuple[Path, Path]) -> None:
    """The package of sources holds code, tests, pages and examples, and nothing that was built."""
    with tarfile.open(packages[1]) as sources:
        found = {name.partition("/")[2] for name in sources.getnames()}
    kept = [
        path for name in ("src", "tests", "docs", "examples") for path in (ROOT / name).rglob("*") if path.is_file()
    ]
    wanted = {str(path.relative_to(ROOT)) for path in kept if path.suffix in (".py", ".c", ".h", ".md", ".yaml")}
    assert wanted - found == set()
    assert {"LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "Makefile", "pyproject.toml"} <= found
    assert [name for name in found if re.match(r"(build|dist|\.venv)/|.*\.(pyc|so)$", name)] == []


def test_the_wheel_works(python: Path, tmp_path: Path) -> None:
    """Installed, faultbond is that of the wheel, and its demo finds the fault in the example of the wheel."""
    version = called(python, tmp_path, "--version", compiler=True)
    assert version.stdout == f"faultbond {PROJECT['version']}\n"
    demo = called(python, tmp_path, "demo", "--json", "records.jsonl", compiler=True)
    assert (demo.returncode, demo.stderr) == (DONE, "")
    assert "/faultbond/_examples/tank/" in demo.stdout.splitlines()[0]
    records = [json.loads(line) for line in (tmp_path / "records.jsonl").read_text(encoding="utf-8").splitlines()]
    assert records[-2]["candidates"][0]["components"] == ["pipe"]
    assert (tmp_path / "report.html").is_file()


def test_the_wheel_without_a_compiler(python: Path, tmp_path: Path) -> None:
    """Without a compiler one line says what to install; `check` works, and `doctor` tells both."""
    if (Path(sysconfig.get_path("purelib")) / "ziglang").exists():
        pytest.skip("ziglang is installed, which is one")
    demo = called(python, tmp_path, "demo", compiler=False)
    assert demo.returncode == USER_MISTAKE
    assert demo.stderr.count("\n") == 1
    assert "pip install 'faultbond[compiler]'" in demo.stderr
    model = next(python.parents[1].glob("lib/*/site-packages/faultbond/_examples/tank/model.yaml"))
    assert called(python, tmp_path, "check", str(model), compiler=False).returncode == DONE
    assert called(python, tmp_path, "doctor", compiler=False).returncode == NO_VERDICT


def test_the_citation_file() -> None:
    """CITATION.cff has what its format requires, nothing that it does not know, and the project's version."""
    found = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert set(found) >= CFF_NEEDS
    assert set(found) <= CFF_KNOWS
    assert (found["cff-version"], found["type"]) == ("1.2.0", "software")
    assert (found["version"], found["license"]) == (PROJECT["version"], PROJECT["license"])
    assert found["authors"]
    assert all(isinstance(item, dict) and ("name" in item or "family-names" in item) for item in found["authors"])


def test_versions_of_python() -> None:
    """Each version of Python that is claimed is not older than the oldest that is allowed."""
    claimed = [name.rpartition(" ")[2] for name in PROJECT["classifiers"] if re.search(r"Python :: 3\.\d+$", name)]
    assert claimed[0] == PROJECT["requires-python"].removeprefix(">=")
    assert claimed == sorted(claimed, key=lambda text: int(text.partition(".")[2]))


def test_extras_and_versions_are_in_the_page() -> None:
    """The page on installing has a row for each extra with what it brings, and tells of each version of Python."""
    page = (ROOT / "docs" / "installing.md").read_text(encoding="utf-8")
    for extra, needed in PROJECT["optional-dependencies"].items():
        (row,) = re.findall(rf"^\| `faultbond\[{extra}\]` \|.*$", page, flags=re.M)
        assert [name for name in needed if re.split("[>=]", name)[0] not in row] == []
    versions = re.findall(r"^\| (3\.[\d., ]+) \|", page, flags=re.M)
    told = [version for cell in versions for version in cell.split(", ")]
    assert [f"Programming Language :: Python :: {version}" for version in told] == [
        name for name in PROJECT["classifiers"] if re.search(r"Python :: 3\.", name)
    ]
