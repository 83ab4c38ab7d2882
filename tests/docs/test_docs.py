"""The pages say what the program does: every key, verb, option and record is there, and every example is valid."""

import argparse
import json
import re
import runpy
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
from insert import PAGES, ROOT, RUN, agree, differences, filled
from rooms import PICTURE, drawn

from faultbond.cli import build_parser, main
from faultbond.io.faults import parse_fault
from faultbond.model.expression import FUNCTIONS
from faultbond.model.schema import model_schema
from faultbond.model.structure import Structure
from faultbond.model.text import parse_any
from faultbond.types import ElementType

METHOD, ARCHITECTURE = ROOT / "docs" / "method.md", ROOT / "docs" / "architecture.md"
COMMANDS = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
MODEL_FILE = (ROOT / "docs" / "model-file.md").read_text(encoding="utf-8")
RECORDS = {
    "run": "model model_sha256 method version sample_time explain_anything continues",
    "detection": "time sample change_time signals",
    "diagnosis": (
        "time candidates unexplained signal since until components parameters nominal estimate sd probability group "
        "kind kinds present rate rate_sd forecasts limit earliest latest advice check target gain cost value within "
        "separates untested sets"
    ),
    "accepted": "time components parameters probability kind by repaired",
    "rejected": "time components parameters probability kind by",
    "end": (
        "time samples watched detections missing late duplicate untimed unused clock_jumps saturated frozen wild "
        "dropped silent name role values since until"
    ),
    "analyse": (
        "model model_sha256 states inputs sensors suspects max_faults false_alarms rank hypotheses sets_left_out "
        "groups group_reasons sudden_groups sudden_group_reasons near_groups on_data detectable isolable "
        "by_causality tests structural_sensors routes closed_forms_left_out routes_left_out twins twins_left_out "
        "smallest_fault sensor_advice sensors_now sensors_not_tried input_advice parameters identifiable "
        "falsifiable testable uncertain roots other_values sets angle reason mso mtes first second always words "
        "alike target question components observations equations closed_form refusal steps samples frames "
        "largest_block noise kind degree real_roots singular remarks value within up down certainty effects size "
        "in_noise claimed onsets classes near choices input level change hold before after"
    ),
    "trial": (
        "model model_sha256 version recordings recording samples first last promise kept between_alarms peak "
        "statistics name kind mean spread memory regions sensor of low high after_step moments begin end height side "
        "trials factor needed walk late early part mirrored"
    ),
    "fit": (
        "model model_sha256 version output recordings recording samples readings first last prediction_error "
        "simulation_error parameters name component nominal estimate sd sd_from_data_alone inflation accuracy "
        "determined at_end_of_range noise sensor kind declared found whiteness white statistic lags p spread mean "
        "correlation words correlations value alike widened log_likelihood log_likelihood_before changes "
        "parameter time statistic wild starts reached settled alarms stopped"
    ),
    "structure": (
        "model model_sha256 unknowns known faults unused equations name part open redundancy detectable isolable "
        "by_causality not_detectable fault reason groups group_reasons tests mso mtes sets ways sensors detect isolate "
        "choices cost searched cheapest never_detectable never_groups never_group_reasons"
    ),
    "trace": "model targets ending expanded distinct steps observations",
    "code": "model form text",
    "doctor": "version python platform compiler cache works checks group name state told advice",
    "completion": "shell text",
    "deed": "asset number at who action target comment until undone rows",
    "audit": "number at who what about id name kind size sha256 job asset files of state",
    "history": "asset output model",
    "generate": "model output target files watch_only lanes state_bytes work_bytes saved_bytes test_fault",
    "fmu": "model output fmi token platform files watch_only",
}
BY_NAME = {"detectable": 1, "isolable": 2, "smallest_fault": 1, "effects": 1, "by_causality": 1, "noise": 1}
BY_NAME |= {"other_values": 1}  # levels of keys that are names of parameters, sensors and the like


def section(page: str, title: str) -> str:
    """Give the part of a page under a heading, up to the next heading of the same rank or a higher one."""
    match = re.search(rf"^(#+) [^\n]*{re.escape(title)}[^\n]*\n(.*)", page, flags=re.M | re.S)
    assert match, f"no heading {title}"
    return re.split(rf"^#{{1,{len(match[1])}}} ", match[2], maxsplit=1, flags=re.M)[0]


def rows(text: str) -> dict[str, list[str]]:
    """Give the rows of all tables: their cells by the code words in the first one."""
    cells = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in text.splitlines() if line[:1] == "|"
    ]
    return {word: row for row in cells for word in re.findall(r"`([^`]+)`", row[0])}


def fences(language: str) -> list[tuple[str, str]]:
    """Give (place, text) of the fenced blocks of a language in all pages."""
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for match in re.finditer(rf"^```{language}(?: [^\n]+)?\n(.*?)^```$", text, flags=re.M | re.S):
            line = text.count("\n", 0, match.start()) + 1
            found.append((f"{page.relative_to(ROOT)}:{line}", match[1]))
    return found


def commands() -> list[tuple[str, str]]:
    """Give (place, command) of every console line that calls faultbond for more than help."""
    lines = [(place, line) for place, text in fences("console") for line in text.replace("\\\n", " ").splitlines()]
    calls = [(place, line.removeprefix("$ ")) for place, line in lines if re.match(r"(\$ )?faultbond\b", line)]
    return [(place, call) for place, call in calls if not call.endswith("--help")]


def verbs() -> dict[str, argparse.ArgumentParser]:
    """Give the parser of each verb."""
    actions = build_parser()._actions
    return next(dict(item.choices) for item in actions if isinstance(item, argparse._SubParsersAction))


def table(schema: dict[str, Any]) -> dict[str, Any]:
    """Give the properties of the table that a schema allows, itself or as one of its forms."""
    if "properties" in schema:
        return dict(schema["properties"])
    forms = [item for item in (*schema.get("anyOf", ()), schema.get("additionalProperties")) if isinstance(item, dict)]
    return next((found for found in map(table, forms) if found), {})


MODEL = table(model_schema())
COMPONENT = table(MODEL["components"])
KEYS = {
    "Keys of the model": MODEL,
    "`time`": table(MODEL["time"]),
    "`tables`": table(MODEL["tables"]),
    "`inputs`": table(MODEL["inputs"]),
    "`components`": COMPONENT | table(COMPONENT["start"]),
    "`blocks`": table(MODEL["blocks"]),
    "Parameters": table(COMPONENT["parameters"]),
    "`sensors`": table(MODEL["sensors"]),
    "Lags": table(table(MODEL["sensors"])["lag"]),
    "`slow_error`": table(MODEL["slow_error"]),
    "`checks`": table(MODEL["checks"]),
    "`structure`": table(MODEL["structure"]) | table(table(MODEL["structure"])["further_sensors"]),
}


@pytest.mark.parametrize("title", KEYS)
def test_keys_of_the_model_file(title: str) -> None:
    """Every key of the schema has its row with form, default and example, and no other key has one."""
    assert KEYS[title]
    text = section(MODEL_FILE, title)
    if title == "Keys of the model":
        text = text.split("\n### ")[0]
    table = {word: row for word, row in rows(text).items() if len(row) == 4}
    assert set(table) == set(KEYS[title])
    assert all(all(cells) for cells in table.values())


def test_functions_and_elements() -> None:
    """Every function of a law and every element type is in the reference."""
    assert [name for name in FUNCTIONS if f"`{name}(" not in section(MODEL_FILE, "Laws and other")] == []
    described = re.findall(r"^\| (\w+) \|", section(MODEL_FILE, "`components`"), flags=re.M)
    elements = [item.value for item in ElementType if item is not ElementType.BLOCK]
    assert [name for name in elements if name not in described] == []


@pytest.mark.parametrize("verb", verbs())
def test_verbs_and_their_options(verb: str) -> None:
    """Every verb has a section that names its arguments and options; shared options stand at the top."""
    known = rows(section(COMMANDS, f"`{verb}`")).keys() | rows(section(COMMANDS, "Options of every verb")).keys()
    words = {word.split()[0] for word in known}
    for action in verbs()[verb]._actions:
        for name in action.option_strings or [str(action.metavar)]:
            assert name in words, f"{verb}: {name}"


def test_no_other_verbs_are_described() -> None:
    """Headings of verbs are those of verbs that exist."""
    titles = re.findall(r"^## `(.+)`$", COMMANDS, flags=re.M)
    assert titles == list(verbs())


def test_exit_codes() -> None:
    """Every exit code is explained."""
    codes = re.findall(r"^\| ([\d, ]+) \|", section(COMMANDS, "Exit codes"), flags=re.M)
    assert codes == ["0", "1", "2", "3", "4", "129, 130, 143", "141"]


@pytest.mark.parametrize("record", RECORDS)
def test_fields_of_records(record: str) -> None:
    """Every field of a record is explained in its section."""
    text = section(COMMANDS, f'`"record": "{record}"`')
    assert [name for name in RECORDS[record].split() if f"`{name}`" not in text] == []


def keys(value: object, names: int = 0) -> set[str]:
    """Give all keys of a record and of what is in it; `names` levels of keys are the user's names and do not count."""
    if isinstance(value, list):
        return {key for item in value for key in keys(item, names)}
    if not isinstance(value, dict):
        return set()
    inside = {key for name, item in value.items() for key in keys(item, names - 1 if names else BY_NAME.get(name, 0))}
    return inside if names else {*value, *inside}


@pytest.mark.parametrize("extra", [["--data", str(ROOT / "examples" / "rc" / "healthy.csv")], ["--trace", "R"]])
def test_keys_of_an_analysis(extra: list[str], tmp_path: Path) -> None:
    """No key of the record of an analysis or of a search is left out of the pages."""
    target = tmp_path / "record.json"
    model = ROOT / "examples" / "rc" / "model.yaml"
    assert main(["analyse", str(model), *extra, "--json", str(target)]) == 0
    record = json.loads(target.read_text(encoding="utf-8"))
    known = {"record", *RECORDS[record["record"]].split()}
    assert keys(record) <= known
    assert {"analyse": "hypotheses", "trace": "ending"}[record["record"]] in keys(record)


def test_keys_of_a_structure(tmp_path: Path) -> None:
    """No key of the record of a structure is left out of the pages."""
    target = tmp_path / "record.json"
    assert main(["analyse", str(ROOT / "examples" / "structures" / "three_tanks.yaml"), "--json", str(target)]) == 0
    record = json.loads(target.read_text(encoding="utf-8"))
    assert keys(record) - {"record"} <= {*RECORDS["structure"].split(), "integral", "derivative"}
    assert record["sets"]


def test_keys_of_a_check(tmp_path: Path) -> None:
    """The table of the record of `check` has a row for each of its keys."""
    target = tmp_path / "record.json"
    assert main(["check", str(ROOT / "examples" / "tank" / "model.yaml"), "--json", str(target)]) == 0
    rows = COMMANDS.split('### `"record": "check"`', 1)[1].split("\n###", 1)[0]
    told = {name for row in re.findall(r"^\| (.*?) \|", rows, re.MULTILINE) for name in re.findall(r"`(\w+)`", row)}
    assert set(json.loads(target.read_text(encoding="utf-8"))) - {"record"} == told


def test_a_toolbox_model_becomes_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lines of the page write a file that is read as the structure that it stands for."""
    (place,) = [text for _, text in fences("python") if "model_def" in text]
    monkeypatch.chdir(tmp_path)
    relations = [["q", "p", "fV"], "-y + p**2", ["dp", "p", "diff"], ["dp", "q", "u"]]
    definition = {"type": "VarStruc", "x": ["p", "q", "dp"], "f": ["fV"], "z": ["y", "u"], "rels": relations}
    exec(place, {"model_def": definition})  # noqa: S102 - the lines of our own page
    found = parse_any((tmp_path / "plant.yaml").read_text())
    assert isinstance(found, Structure)
    assert [item.unknowns for item in found.equations] == [("q", "p"), ("p",), ("dp", "q")]
    assert [(item.rate, item.quantity, item.name) for item in found.derivatives] == [("dp", "p", "e3")]
    assert found.unused == ()


@pytest.mark.parametrize("place", [place for place, _ in fences("yaml")])
def test_models_in_the_pages(place: str) -> None:
    """A model shown in a page is a whole and valid model."""
    text = dict(fences("yaml"))[place]
    model = parse_any(text, file=place)
    assert model.equations if isinstance(model, Structure) else model.components and model.sensors


@pytest.mark.parametrize(("place", "command"), commands())
def test_commands_in_the_pages(place: str, command: str) -> None:
    """A command shown in a page is one that the program takes, and so are the faults in it."""
    arguments = build_parser().parse_args(shlex.split(re.split(r" [|>]|;", command)[0], comments=True)[1:])
    assert arguments.verb in verbs(), place
    faults = [parse_fault(text) for text in getattr(arguments, "fault", [])]
    assert len(faults) == command.count("--fault"), place


@pytest.mark.parametrize(
    "page", [page for page in PAGES if RUN in page.read_text(encoding="utf-8")], ids=lambda page: page.name
)
def test_outputs_in_the_pages(page: Path, tmp_path: Path) -> None:
    """What a page shows as output is what its commands print when they are run in order; `make docs` renews it."""
    shown = page.read_text(encoding="utf-8")
    assert differences(shown, filled(shown, tmp_path)) == []


def test_agreement_is_of_words_and_numbers() -> None:
    """Layout and last digits may differ between two outputs, words and sizes may not."""
    assert agree("K1  4.28e11 \u22123 %", "K1 4.29e11\n\u22123 %")
    assert not agree("K1 4.28e11", "K1 5e11")
    assert not agree("K1 4.28e11", "K2 4.28e11")
    assert agree("-o REC, --output REC  file", "-o, --output REC  file")


@pytest.mark.parametrize("page", [METHOD, ARCHITECTURE], ids=lambda page: page.name)
def test_places_in_the_pages(page: Path) -> None:
    """Every module and test that a page names is there, with the function that it names."""
    text = re.sub(r"(?<=\.py|.\.[hc])`, `(\w+)`", r"::\1`", page.read_text(encoding="utf-8"))
    for path, name in re.findall(r"`((?:[\w]+/)*\w+\.(?:py|h|c|c\.in))(?:::(\w+))?`", text):
        file = next((root / path for root in (ROOT, ROOT / "src" / "faultbond") if (root / path).is_file()), None)
        assert file is not None, path
        defined = rf"def {name}\b" if path.endswith(".py") else rf"^(?:static|FB_OF_\w+) [\w ]+\b{name}\("
        assert re.search(defined, file.read_text(encoding="utf-8"), flags=re.M) if name else True, f"{path}::{name}"


def test_figures_are_those_of_the_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The figures of the pages are what their script draws; `python docs/images/draw.py` renews them."""
    images = ROOT / "docs" / "images"
    monkeypatch.setattr(sys, "argv", ["draw.py", str(tmp_path)])
    runpy.run_path(str(images / "draw.py"), run_name="__main__")
    drawn = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()}
    shown = {path.name: path.read_text(encoding="utf-8") for path in images.glob("*.svg") if path != PICTURE}
    assert drawn.keys() == shown.keys()
    assert [name for name, text in shown.items() if not agree(text, drawn[name])] == []


def test_picture_of_the_rooms() -> None:
    """The picture shows the imports of the code as it is; `make docs` renews it."""
    assert PICTURE.read_text(encoding="utf-8") == drawn()


def test_links_between_pages() -> None:
    """A link to a file of the project leads to a file."""
    for page in PAGES:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_paths_in_the_pages() -> None:
    """Examples that commands name exist."""
    named = {word for _, command in commands() for word in command.split() if word.startswith("examples/")}
    assert named
    assert [path for path in named if not (ROOT / path).exists()] == []
