"""A model is text that becomes C and is compiled and run: nothing in it becomes C of its own, or reads a file."""

import asyncio
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from desk_bench import RC, Bench
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import ModelError
from faultbond.model.text import parse_model
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.specify import build_spec

MODEL = (RC / "model.yaml").read_text()
RECORDING = b"".join((RC / "healthy.csv").read_bytes().splitlines(keepends=True)[:200])
EVIL = 'x */ "; system("touch evil"); #include "/etc/passwd" \\\\ ??/ /* //'
QUOTED = "'" + EVIL.replace("'", "''") + "'"


def with_titles() -> str:
    """A model whose texts for people, all that may be any text, are C."""
    return (
        MODEL.replace("name: RC circuit", f"name: {QUOTED}")
        .replace("{V: {unit: V,", f"{{V: {{column: {QUOTED}, unit: V,")
        .replace("{V_C: {reads", f"{{V_C: {{column: {QUOTED[:-1]}2', reads")
    )


def compiled(text: str) -> str:
    """Give what the compiler is given of a model, without the hash of the model's text and what follows from it."""
    plant = build_plant(parse_model(text, file="model.yaml"))
    found = model_text(build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True))
    return re.sub(r"MODEL_HASH\[\] = \{[^}]*\}", "", found)


def test_no_text_of_the_user_is_compiled() -> None:
    """What is compiled of a model whose titles and columns are C is what is compiled of the same model without."""
    assert "evil" in with_titles()
    assert compiled(with_titles()) == compiled(MODEL)


@pytest.mark.parametrize(
    "law",
    [
        'e = R*f; system("id")',
        "e = R*f)); int main(void){} ((",
        "e = __import__('os').system('id')",
        "e = R*f*eval(1)",
        "e = R*f /* x */",
        "e = R*f // x",
        'e = "R"*f',
        "e = R*f\n#include </etc/passwd>",
        "e = R*f*table(f, ../../etc/passwd)",
        "e = R*system(f)",
        "e = R*f.real.__class__",
        "e = R*[f][0]",
        "e = R*f if f else f",
        "e = (lambda: R)()*f",
        "e = R*f*9" + "**9" * 20,
        "e = " + "(" * 2000 + "R*f" + ")" * 2000,
        "e = R*f" + "+f" * 5000,
    ],
)
def test_a_law_is_arithmetic(law: str) -> None:
    """A law with anything in it but numbers, names, operators and known functions is refused, and so is a huge one."""
    quoted = "'" + law.replace("'", "''") + "'"
    text = MODEL.replace("R: {type: R,", f"R: {{type: R, law: {quoted},")
    with pytest.raises(ModelError, match=r"^model\.yaml:"):
        compiled(text)


@pytest.mark.parametrize("name", ["a b", "a;b", "a*/b", "../a", 'a"b', "a\\b", "if(1)", "ä", "x" * 65, "1a", ""])
def test_names_are_words(name: str) -> None:
    """A component, parameter, sensor or input whose name is no word is refused."""
    quoted = "'" + name.replace("'", "''") + "'"
    for before, after in (
        ("{R: 10 kohm}", f"{{{quoted}: 10 kohm}}"),
        ("sensors: {V_C:", f"sensors: {{{quoted}:"),
        ("inputs: {V:", f"inputs: {{{quoted}:"),
        ("  C: {type: C", f"  {quoted}: {{type: C"),
    ):
        assert before in MODEL
        with pytest.raises(ModelError):
            compiled(MODEL.replace(before, after))


def table(file: str) -> str:
    """A model with a table of a file."""
    quoted = "'" + file.replace("'", "''") + "'"
    return (
        MODEL.replace("{R: 10 kohm}", "{R: 10 kohm}, law: 'e = R*table(f, curve)'")
        + f"tables: {{curve: {{file: {quoted}}}}}\n"
    )


@pytest.mark.parametrize(
    "file",
    [
        "/etc/passwd",
        "../secret.csv",
        "../../secret.csv",
        "in/../../secret.csv",
        "./../secret.csv",
        "..",
        ".",
        "/dev/zero",
        "a\0b",
    ],
)
def test_a_table_lies_beside_the_model(tmp_path: Path, file: str) -> None:
    """A table elsewhere is refused in a line that says nothing of what is in it."""
    (tmp_path / "secret.csv").write_text("secret,words\nsecret,words\n")
    (tmp_path / "job" / "in").mkdir(parents=True)
    label = str(tmp_path / "job" / "in" / "model.yaml")
    with pytest.raises(ModelError) as refused:
        parse_model(table(file).replace("a\0b", '"a\\0b"'), file=label)
    assert "words" not in str(refused.value)
    assert "\n" not in str(refused.value)


BOMBS = {
    "aliases": "a: &a [x, x, x, x, x]\nb: &b [*a, *a, *a, *a, *a]\nc: [*b, *b, *b, *b, *b]\n",
    "tags": "name: !!python/object/apply:os.system ['touch evil']\n",
    "depth": "name: " + "[" * 5000 + "]" * 5000 + "\n",
    "width": "name: [" + "x," * 400_000 + "x]\n",
    "merge": "base: &base {a: 1}\nname: {<<: *base}\n",
}


def test_bombs_and_files_at_the_desk(bench: Callable[..., Bench], tmp_path: Path) -> None:
    """Brought to the desk, none of them takes long or much, writes beside its folder, or tells what is in a file."""
    made = bench(seconds=120.0, memory=1_500_000_000)
    (tmp_path / "secret.csv").write_text("secret,words\n1,words\n")

    async def done() -> dict[str, Any]:
        texts = BOMBS | {
            "passwd": table("/etc/passwd"),
            "secret": table("../../../../secret.csv"),
            "titles": with_titles(),
        }
        told = {}
        async with made.at_work():
            for name, text in texts.items():
                model = await made.bring(text.encode(), f"{name}.yaml", "model")
                told[name] = await made.until(await made.order(RECORDING, model=model))
        return told

    told = asyncio.run(done())
    for name in (*BOMBS, "passwd", "secret"):
        assert (told[name]["state"], told[name]["results"]) == ("failed", []), name
        assert told[name]["said"].startswith("model.yaml:"), told[name]["said"]
        assert "root:" not in told[name]["said"]
        assert "words" not in told[name]["said"]
        assert told[name]["ended"] - told[name]["began"] < 60.0
    assert told["titles"]["said"].startswith("recording.csv: ")  # it has no such column
    assert not list(tmp_path.rglob("evil"))
    assert {item.name for item in tmp_path.iterdir()} == {"desk", "secret.csv"}
