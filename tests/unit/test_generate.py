"""`generate`: a project in C that compiles alone, watches as `run` does, and is the same whenever it is written."""

import json
import os
import re
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest

from faultbond.app import generation
from faultbond.cli import main
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import GenerationError
from faultbond.model.text import load_model, parse_model
from faultbond.synthesis.c_files import FLEETS
from faultbond.synthesis.extent import count_lanes, watch_only, with_lanes
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.readable import readable_model
from faultbond.synthesis.specify import build_spec
from faultbond.types import TARGETS

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
RC = EXAMPLES / "rc"
EMPTY = {"PATH": os.environ["PATH"]}  # no folder of headers or libraries but the compiler's own
ROWS = 1300  # the fault of the RC circuit begins at row 1000

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")


def generate(model: Path, folder: Path, *options: str) -> None:
    """Write the project of a model."""
    assert main(["generate", str(model), "-o", str(folder), *options]) == 0


def made(folder: Path, *targets: str) -> str:
    """Run make in a folder; gives what it says."""
    done = subprocess.run(
        ["make", "-C", str(folder), "OPTIMISE=-O1", "SMALL=-O1", *targets],
        capture_output=True,
        text=True,
        env=EMPTY,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stderr
    return done.stdout


def told_by_run(model: Path, recording: Path, capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    """Give the records of `run`."""
    capsys.readouterr()
    main(["run", str(model), str(recording), "--json", "-"])
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project of the RC circuit, built."""
    folder = tmp_path_factory.mktemp("generate") / "rc"
    generate(RC / "model.yaml", folder)
    made(folder, "libfaultbond.a", "example")
    return folder


def test_the_library_finds_what_run_finds(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The example on the library raises the alarm and names the parameter at the samples at which `run` does."""
    lines = (RC / "fault_capacitor.csv").read_text().splitlines()[: ROWS + 1]
    (tmp_path / "fault.csv").write_text("\n".join(lines) + "\n")
    done = subprocess.run(
        [project / "example"], input="\n".join(lines[1:]), capture_output=True, text=True, env=EMPTY, check=True
    )
    records = told_by_run(RC / "model.yaml", tmp_path / "fault.csv", capsys)
    alarms = [record["time"] for record in records if record["record"] == "detection"]
    assert [float(line.split()[0]) for line in done.stdout.splitlines() if "a fault" in line] == alarms
    named = re.findall(r"^(\S+) s: (\w+) = (\S+), probability (\S+)$", done.stdout, re.MULTILINE)
    told = [record for record in records if record["record"] == "diagnosis"]
    assert len(named) > 2
    for (time, name, estimate, probability), record in zip(named, told, strict=False):
        best = record["candidates"][0]  # type: ignore[index]
        assert (float(time), name) == (pytest.approx(record["time"]), *best["parameters"])
        assert float(estimate) == pytest.approx(best["parameters"][name]["estimate"], rel=1e-5)
        assert float(probability) == pytest.approx(best["probability"], abs=6e-4)


def test_the_same_model_gives_the_same_bytes(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written from another folder, at another time, each file is the same; none holds a path of this machine."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))  # which keeps projects
    shutil.copy(RC / "model.yaml", tmp_path / "model.yaml")
    generate(tmp_path / "model.yaml", tmp_path / "again")
    for path in (tmp_path / "again").rglob("*"):
        if path.is_file():
            assert path.read_bytes() == (project / path.relative_to(tmp_path / "again")).read_bytes(), path.name
            assert str(tmp_path) not in path.read_text(encoding="utf-8")
    assert not [name for name in FLEETS if (project / "core" / name).exists()]
    copied = (project / "core" / "core.c").read_bytes()
    assert copied == (ROOT / "src" / "faultbond" / "core" / "core.c").read_bytes()


def test_what_is_kept_is_what_would_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The second time the same files and the same record come from the cache; other wishes are another project."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))
    shutil.copy(RC / "model.yaml", tmp_path / "model.yaml")
    records = []
    for folder in ("one", "two"):
        generate(tmp_path / "model.yaml", tmp_path / folder, "--json", str(tmp_path / f"{folder}.json"))
        records.append(json.loads((tmp_path / f"{folder}.json").read_text()) | {"output": ""})
        monkeypatch.setattr(generation, "_made", None)  # whatever is not kept fails from now on
    assert records[0] == records[1]
    assert contents(tmp_path / "one") == contents(tmp_path / "two")
    wishes = (["--watch-only"], ["--lanes-at-most", "300"], ["--target", "aarch64-linux"])
    for options in wishes:
        assert main(["generate", str(tmp_path / "model.yaml"), "-o", str(tmp_path / "other"), *options]) == 3
    shutil.copy(
        tmp_path / "model.yaml", tmp_path / "renamed.yaml"
    )  # the title of a model without a name is that of its file
    assert main(["generate", str(tmp_path / "renamed.yaml"), "-o", str(tmp_path / "other")]) == 3
    (tmp_path / "model.yaml").write_text((tmp_path / "model.yaml").read_text() + "# changed\n")
    assert main(["generate", str(tmp_path / "model.yaml"), "-o", str(tmp_path / "other")]) == 3


def test_a_model_with_a_file_beside_it_is_made_each_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A curve in a file of its own may change without the model's bytes."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))
    text = (RC / "model.yaml").read_text().replace("law: e = V}", 'law: "e = table(V, curve)"}')
    (tmp_path / "model.yaml").write_text(text + "tables: {curve: {file: curve.csv, x: V, y: V}}\n")
    made = []
    for most in (10, 11):
        (tmp_path / "curve.csv").write_text(f"0,0\n5,5\n10,{most}\n")
        generate(tmp_path / "model.yaml", tmp_path / "plant")
        made.append(contents(tmp_path / "plant"))
    assert made[0] != made[1]


def contents(folder: Path) -> dict[Path, bytes]:
    """Give what files below a folder hold."""
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_folder_of_somebody_is_left_alone(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that holds something else is refused; one that was generated is written anew."""
    (tmp_path / "thesis.tex").write_text("mine")
    assert main(["generate", str(RC / "model.yaml"), "-o", str(tmp_path)]) == 2
    assert "was not generated by faultbond" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
    copy = tmp_path / "copy"
    shutil.copytree(project, copy)
    (copy / "fb.hpp").write_text("changed")
    generate(RC / "model.yaml", copy)
    assert (copy / "fb.hpp").read_bytes() == (project / "fb.hpp").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "{folder}/no/plant"], "there is no folder"),
        (["-o", "{folder}/file"], "this is a file"),
        (["-o", "{folder}/plant.fmu"], "plant.fmu: a folder is written here. For an FMU say which version"),
        (["-o", "{folder}/plant.html"], "plant.html: a folder is written here. For a page in a browser say --web."),
        (["-o", "{folder}/plant", "--web"], "plant: a page is one file. Name one that ends in .html"),
        (["-o", "{folder}/plant.html", "--web", "--target", "native"], "--target: --web writes a page"),
        (["-o", "{folder}/plant.html", "--web", "--recording", "{folder}/no.csv"], "no.csv: cannot be read"),
        (
            ["-o", "{folder}/plant", "--recording", "rows.csv"],
            "--recording: only a page, --web, has a recording inside",
        ),
        (["-o", "{folder}/plant", "--target", "pdp11"], "--target pdp11: no such target; one of native, x86_64"),
        *(
            (["-o", "{folder}/" + name, "--watch-only", "--lanes-at-most", "300", *more], "--watch-only has no filters")
            for name, more in {"plant": [], "plant.html": ["--web"], "plant.fmu": ["--fmu", "3"]}.items()
        ),
        (["-o", "{folder}/plant", "--lanes-at-most", "3"], "the single faults of RC circuit, with"),
    ],
)
def test_what_cannot_be_is_told(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mistake is told in one line, and nothing is written."""
    (tmp_path / "file").write_text("")
    given = [argument.format(folder=tmp_path) for argument in arguments]
    assert main(["generate", str(RC / "model.yaml"), *given]) == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert not (tmp_path / "plant").exists()


def test_what_has_no_time_has_no_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A network without time is refused by its file and name."""
    assert main(["generate", str(EXAMPLES / "thesis" / "fig_3_7.yaml"), "-o", str(tmp_path / "plant")]) == 2
    assert re.search(r"fig_3_7.yaml: .* has no time \(`sample_time: none`\)", capsys.readouterr().err)


def test_the_text_for_people_is_the_same_code(tmp_path: Path) -> None:
    """Names and comments change nothing: the filters compile to the same bytes from both texts of the model."""
    graph = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    plant = build_plant(graph)
    spec = build_spec(build_step_model(plant))
    text = model_text(spec, build_step_model(plant, all_inputs=True))
    core, objects = ROOT / "src" / "faultbond" / "core", []
    shown = readable_model(text, spec, graph)
    for name, content in (("plain", text), ("shown", shown)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "model.h").write_text(content)
        command = ["cc", "-O1", "-c", "-I.", f"-I{core}", str(core / "one.c"), "-o", "one.o"]
        subprocess.run(command, cwd=tmp_path / name, check=True)
        objects.append((tmp_path / name / "one.o").read_bytes())
    assert objects[0] == objects[1]
    assert "const lanes J = 1.5 * v[factor_J];" in shown
    (number,) = re.findall(r"line +(\d+)  K: +e1 = K\*f2", shown)
    assert "GY" in (EXAMPLES / "dc_motor" / "model.yaml").read_text().splitlines()[int(number) - 1]


NASTY = """\
name: "*/ int x; /* \\\\ ??/"
sample_time: 1 s
inputs: {input: {unit: V}}
components:
  source: {type: Se, law: e = input}
  resistance: {type: R, parameters: {double: 3 ohm}}
  store: {type: C, parameters: {lanes: 2 F}}
junctions: {loop: 1}
bonds: [source -> loop -> resistance, loop -> store]
sensors: {size: {reads: store.e, unit: V, noise: 0.1 V}}
"""


def test_names_of_users_break_nothing(tmp_path: Path) -> None:
    """Names that are words of C or of the core, and a title that ends comments, give a project that compiles."""
    (tmp_path / "nasty.yaml").write_text(NASTY)
    graph = parse_model(NASTY)
    generate(tmp_path / "nasty.yaml", tmp_path / "plant", "--watch-only")
    made(tmp_path / "plant", "one.o")
    for name in ("library.c", "example.c"):
        command = ["cc", "-std=c99", "-Wpedantic", "-Werror", "-DFB_LANES=2", "-fsyntax-only", "-I.", "-Icore", name]
        subprocess.run(command, cwd=tmp_path / "plant", env=EMPTY, check=True)
    assert {item.name for item in graph.parameters} == {"double", "lanes"}


CPP = """\
#include <array>
#include <cstdio>
#include "fb.hpp"

static faultbond::Monitor monitor, other;

int main()
{
    std::array<double, N_INPUTS> inputs{};
    std::array<double, N_OUTPUTS> readings{};
    static std::array<std::uint8_t, FB_SAVED_BYTES> saved;
    double time;
    int alarms = 0;
    while (std::scanf("%lf,%lf,%lf", &time, &inputs[0], &readings[0]) == 3) {
        if (!monitor.step(time, time > 0.0 ? 0.02 : 0.0, inputs, readings)) continue;
        alarms += static_cast<int>(monitor.report().detected);
    }
    if (!monitor.save(saved) || !other.restore(saved)) return 1;
    saved[100] ^= 1;
    if (other.restore(saved)) return 1;
    other.diagnose();
    const Candidate &best = other.candidates()[0];
    const char *name = faultbond::name(best.suspects[0]);
    std::printf("%d %s %d\\n", alarms, name, other.accept(best.hypothesis) == faultbond::Decision::taken);
}
"""


def cpp(text: str, standard: str, project: Path, folder: Path) -> str:
    """Compile a program on fb.hpp and run it over the recording with a fault; gives what it prints."""
    (folder / "main.cpp").write_text(text)
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    command = ["c++", f"-std={standard}", *warnings, f"-I{project}", "main.cpp", f"{project}/libfaultbond.a", "-lm"]
    subprocess.run(command, cwd=folder, env=EMPTY, check=True)
    rows = "\n".join((RC / "fault_capacitor.csv").read_text().splitlines()[1 : ROWS + 1])
    return subprocess.run([folder / "a.out"], input=rows, capture_output=True, text=True, env=EMPTY, check=True).stdout


def test_the_face_for_cpp(project: Path, tmp_path: Path) -> None:
    """A program on fb.hpp watches, saves and restores, and decides; damaged bytes are refused."""
    assert cpp(CPP, "c++17", project, tmp_path) == "1 C 1\n"


def test_programs_of_the_page(project: Path, tmp_path: Path) -> None:
    """The program in C of the page is the one in each folder; that in C++ finds the fault."""
    page = (ROOT / "docs" / "embedding.md").read_text(encoding="utf-8")
    blocks = re.compile(r"^```(c|cpp)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
    (_, in_c), (_, in_cpp) = blocks.findall(page)
    assert in_c == (project / "example.c").read_text(encoding="utf-8")
    last = cpp(in_cpp, "c++20", project, tmp_path).splitlines()[-1]
    assert re.fullmatch(r"25\.\d+ s: C, probability (0\.9\d|1\.00)", last), last


def test_all_of_it_is_cpp_too(project: Path, tmp_path: Path) -> None:
    """The library and the program compile as C++17, and pass the self-test."""
    copy = tmp_path / "plant"
    shutil.copytree(project, copy, ignore=shutil.ignore_patterns("*.o", "*.a", "watch", "example"))
    said = made(copy, "CC=c++", "STANDARD=-x c++ -std=c++17", "OPTIMISE=-O0", "SMALL=-O0", "all", "check")
    assert "6 records, as expected" in said


@pytest.mark.skipif(shutil.which("cmake") is None, reason="there is no cmake")
def test_the_target_of_cmake(project: Path, tmp_path: Path) -> None:
    """Another project takes the folder in, and links faultbond::faultbond."""
    (tmp_path / "CMakeLists.txt").write_text(
        f"""\
cmake_minimum_required(VERSION 3.15)
project(mine C)
add_subdirectory({project} plant)
add_executable(mine {project}/example.c)
target_link_libraries(mine PRIVATE faultbond::faultbond)
"""
    )
    build = tmp_path / "build"
    for command in (
        ["cmake", "-S", str(tmp_path), "-B", str(build), "-DCMAKE_BUILD_TYPE=Debug"],
        ["cmake", "--build", str(build)],
    ):
        subprocess.run(command, capture_output=True, check=True)
    rows = "\n".join((RC / "fault_capacitor.csv").read_text().splitlines()[1 : ROWS + 1])
    done = subprocess.run([build / "mine"], input=rows, capture_output=True, text=True, check=True)
    assert "s: a fault" in done.stdout
    assert (build / "plant" / "watch").exists()


@pytest.mark.skipif(shutil.which("cmake") is None, reason="there is no cmake")
def test_the_package_of_cmake(project: Path, tmp_path: Path) -> None:
    """Installed, the folder is found by its version, and not by that of another time."""
    build, place = tmp_path / "build", tmp_path / "place"
    for command in (
        ["cmake", "-S", str(project), "-B", str(build), "-DCMAKE_BUILD_TYPE=Debug", "-DFAULTBOND_PROGRAM=OFF"],
        ["cmake", "--build", str(build)],
        ["cmake", "--install", str(build), "--prefix", str(place)],
    ):
        subprocess.run(command, capture_output=True, check=True)
    said = {}
    for wanted in (version("faultbond"), "99.0"):
        mine = tmp_path / wanted
        mine.mkdir()
        (mine / "CMakeLists.txt").write_text(
            f"""\
cmake_minimum_required(VERSION 3.15)
project(mine C)
find_package(faultbond {wanted})
message(STATUS "found ${{faultbond_FOUND}} ${{faultbond_VERSION}}")
"""
        )
        command = ["cmake", "-S", str(mine), "-B", str(mine / "build"), f"-DCMAKE_PREFIX_PATH={place}"]
        said[wanted] = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert f"found 1 {version('faultbond')}" in said[version("faultbond")]
    assert "found 0" in said["99.0"]


def test_fewer_lanes() -> None:
    """With fewer lanes pairs wait in reserve, the last first; without a bank nothing is tested."""
    plant = build_plant(load_model(EXAMPLES / "tank" / "model.yaml"))
    spec = build_spec(build_step_model(plant))
    assert with_lanes(spec, count_lanes(spec)) is spec
    fewer = with_lanes(spec, 400)
    assert 300 < count_lanes(fewer) <= 400
    assert fewer.hypotheses == tuple(sorted(spec.hypotheses, key=len))[: len(fewer.hypotheses)]
    assert {len(chosen) for chosen in fewer.hypotheses} == {1, 2}
    assert set(fewer.hypotheses) | set(fewer.reserve) == set(spec.hypotheses)
    assert not set(fewer.hypotheses) & set(fewer.reserve)
    assert fewer.instruments == spec.instruments
    with pytest.raises(GenerationError, match="need 277 lanes"):
        with_lanes(spec, 266)
    none = watch_only(spec)
    assert (count_lanes(none), none.n_hypotheses, none.thresholds) == (0, 0, spec.thresholds)


def test_alarms_without_a_bank(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With --watch-only the alarm comes at the same sample, and no candidate is told."""
    generate(RC / "model.yaml", tmp_path / "plant", "--watch-only", "--json", str(tmp_path / "told.json"))
    told = json.loads((tmp_path / "told.json").read_text())
    assert (told["record"], told["watch_only"], told["lanes"]) == ("generate", True, 0)
    records = [json.loads(line) for line in (tmp_path / "plant" / "check" / "expected.jsonl").read_text().splitlines()]
    full = told_by_run(RC / "model.yaml", tmp_path / "plant" / "check" / "recording.csv", capsys)
    assert [record for record in records if record["record"] == "detection"] == [
        record for record in full if record["record"] == "detection"
    ]
    assert len([record for record in full if record["record"] == "detection"]) == 1
    assert all(record["candidates"] == [] for record in records if record["record"] == "diagnosis")
    assert all(record["within_accuracy"] is None for record in records if record["record"] == "diagnosis")
    readme = (tmp_path / "plant" / "README.md").read_text()
    assert "Tested: nothing: alarms are raised, and no fault is named" in " ".join(readme.split())
    assert "nominal" not in readme.partition("## Which faults")[2].partition("The laws")[0]


def test_records_of_the_self_test(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is expected of the self-test is what `run` writes of its samples."""
    records = [json.loads(line) for line in (project / "check" / "expected.jsonl").read_text().splitlines()]
    assert records == told_by_run(RC / "model.yaml", project / "check" / "recording.csv", capsys)
    assert [record["record"] for record in records].count("detection") == 1


def test_what_runs_seldom_is_compiled_for_speed_here_and_for_size_elsewhere(project: Path) -> None:
    """By `-O1` for this machine, where a program may be larger and its diagnoses are faster; else by `-Os`."""
    for target, level in (("native", "-O1"), ("aarch64-linux", "-Os"), ("cortex-m7", "-Os")):
        words = ["make", "-n", "-B", "-C", str(project), f"TARGET={target}", "ZIG=zig"]
        told = subprocess.run(words, capture_output=True, text=True, env=EMPTY, check=True).stdout
        (line,) = (line for line in told.splitlines() if "-c library.c" in line)
        assert level in line.split()


def test_targets_of_the_makefile(project: Path) -> None:
    """The Makefile knows each target that the program knows, and refuses others."""
    text = (project / "Makefile").read_text()
    assert set(re.findall(r"^ZIG_(\S+) =", text, re.MULTILINE)) == set(TARGETS[1:])
    done = subprocess.run(
        ["make", "-C", str(project), "TARGET=pdp11"], capture_output=True, text=True, env=EMPTY, check=False
    )
    assert done.returncode != 0
    assert "pdp11: no such target; one of native" in done.stderr
