"""A picture of the plant: which names it shows and lacks, how that is told, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from faultbond.cli.program import main
from faultbond.errors import FaultbondError
from faultbond.model.document import MAX_BYTES
from faultbond.service.process_picture import ProcessPicture, read_process_picture
from faultbond.service.site import SiteAsset, read_site, site_of
from loop_asset import MODEL, plant
from played import Played, play

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9">'
DRAWN = f"""{HEAD}
  <defs><g id="L"/></defs>
  <g id="layer1"><rect id="R" onclick="alert(1)"/>, <path id="C" d="M0 0"/></g>
  <text id="V_R">meter <a id="L">V</a></text><rect id="r"/>
</svg>"""
TOLD = (
    "shows 3 names of the model: C, R, V_R; it lacks: L, V_I; ids that are no names of the model: layer1, r; "
    "left out for safety: the attribute onclick"
)


def written(folder: Path, picture: str = DRAWN, key: str = "{picture: plant.svg, model: loop.yaml}") -> Path:
    """Write a site file with a model and a picture beside it."""
    (folder / "loop.yaml").write_text(MODEL.read_text())
    (folder / "plant.svg").write_text(picture)
    path = folder / "site.yaml"
    path.write_text(f"assets:\n  loop: {key}\n")
    return path


def test_names_of_the_model_are_marked(tmp_path: Path) -> None:
    """Each in a group that tells it, but not what is only kept to be used; the rest is told."""
    written(tmp_path)
    found = read_process_picture(tmp_path / "plant.svg", plant().graph)
    assert found.told() == f"picture {tmp_path}/plant.svg {TOLD}"
    assert '<g data-component="R"><rect id="R" /></g>, <g data-component="C"><path' in found.svg
    assert found.svg.count("data-component") == 3
    assert "onclick" not in found.svg


def test_many_names_are_told_by_the_first(tmp_path: Path) -> None:
    """Drawing programs give an id to all."""
    written(tmp_path, DRAWN.replace("</svg>", "".join(f'<g id="path{k}"/>' for k in range(9)) + "</svg>"))
    told = read_process_picture(tmp_path / "plant.svg", plant().graph).told()
    assert "names of the model: layer1, r, path0, path1, path2, path3, path4, path5 and 3 more;" in told


def test_a_check_tells_of_the_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In a line, and in the record."""
    path = written(tmp_path)
    assert main(["serve", "--site", str(path), "--check"]) == 0
    assert f"\nloop: picture {tmp_path}/plant.svg {TOLD}\n" in capsys.readouterr().out
    assert main(["serve", "--site", str(path), "--check", "--json", "-"]) == 0
    (asset,) = json.loads(capsys.readouterr().out)["assets"]
    assert asset["picture"] == {
        "file": f"{tmp_path}/plant.svg",
        "shows": ["C", "R", "V_R"],
        "lacks": ["L", "V_I"],
        "strangers": ["layer1", "r"],
        "dropped": ["the attribute onclick"],
    }


@pytest.mark.parametrize(
    ("picture", "told"),
    [
        (f'{HEAD}<g id="Rr"/></svg>', "no id in it is a name of the model; give the elements of the drawing ids such"),
        (f'{HEAD}<defs><g id="R"/></defs></svg>', "no id in it is a name of the model"),
        ("<svg", "plant.svg:1: not XML"),
        (" " * (MAX_BYTES + 1), f"plant.svg: more than {MAX_BYTES} bytes; simplify the drawing"),
        ("<!DOCTYPE svg [<!ENTITY a 'b'>]><svg/>", "plant.svg:1: a document type with entities is not read"),
    ],
)
def test_what_is_no_picture_of_the_plant_is_refused(tmp_path: Path, picture: str, told: str) -> None:
    """By the line of the site file, with the name of the picture and what was expected."""
    with pytest.raises(FaultbondError) as refused:
        read_site(written(tmp_path, picture))
    assert str(refused.value).startswith(f"{tmp_path}/site.yaml:2: asset loop: picture: {tmp_path}/plant.svg")
    assert told in str(refused.value)


def test_a_picture_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is told beside all else that is wrong."""
    path = written(tmp_path, key="{model: loop.yaml, picture: no.svg, source: 'fiel:a'}")
    assert main(["serve", "--site", str(path), "--check"]) == 2
    told = capsys.readouterr().err
    assert f"asset loop: picture: {tmp_path}/no.svg: cannot be read: No such file" in told
    assert len(told.splitlines()) == 2


def test_a_picture_beside_the_model(tmp_path: Path) -> None:
    """By the model's name, where the command line names the model; a site file names its pictures itself."""
    written(tmp_path, key="{model: loop.yaml}")
    told = {"source": None, "store": None, "port": None, "accept": None}
    assert site_of([tmp_path / "loop.yaml"], **told).assets[0].picture is None
    (tmp_path / "plant.svg").rename(tmp_path / "loop.svg")
    shown = site_of([tmp_path / "loop.yaml"], **told).assets[0].picture
    assert shown is not None
    assert shown.shows == ("C", "R", "V_R")
    assert read_site(tmp_path / "site.yaml").assets[0].picture is None
    (tmp_path / "loop.svg").write_text(f"{HEAD}</svg>")
    assert site_of([tmp_path / "loop.yaml"], **told).assets[0].picture is None  # some other drawing


def test_the_tank_has_a_whole_picture() -> None:
    """All that may be at fault is in the picture of the built-in plant, and nothing was left out of it."""
    picture = site_of([], source=None, store=None, port=None, accept=None).assets[0].picture
    assert picture is not None
    assert (len(picture.shows), picture.lacks, picture.strangers, picture.dropped) == (11, (), (), ())


def test_the_picture_of_an_asset_is_shown() -> None:
    """By a tag of its own, and none where the site has none."""
    drawn = ProcessPicture(file="a.svg", svg="<svg/>", shows=("R",), lacks=(), strangers=(), dropped=())

    async def course(played: Played) -> None:
        assert (played.service.picture("loop"), played.service.picture("twin")) == ("<svg/>", "")
        shown, other = (played.service.asset(name)["picture"] for name in ("loop", "twin"))
        assert (shown, other) == (drawn.tag, "")
        assert shown != replace(drawn, svg="<svg></svg>").tag

    assets = tuple(
        SiteAsset(name=name, plant=plant(), source="played:", picture=picture)
        for name, picture in (("loop", drawn), ("twin", None))
    )
    play(Played(more={"assets": assets}), course)
