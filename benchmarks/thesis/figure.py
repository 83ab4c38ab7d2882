"""A figure of the thesis, computed anew: its picture, and what the thesis says of it beside what ours shows."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.shared.page import as_markdown
from benchmarks.thesis.chart import Panel, draw
from benchmarks.thesis.page import NOT_PRINTED, SAME

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "images" / "thesis"
COLUMNS = ("", "thesis", "classic", "bank", "remark")
DIFFERS = "differs: "


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One thing that the thesis says of a figure.

    same : whether ours shows it, too; None where the thesis says nothing to compare with
    remark : what else is to be known of it. otherwise : where a difference comes from, shown only where there is one
    """

    what: str
    printed: str = ""
    classic: str = ""
    bank: str = ""
    same: bool | None = None
    remark: str = ""
    otherwise: str = ""

    def __post_init__(self) -> None:
        if self.differs and not (self.remark or self.otherwise):
            raise ValueError(f"{self.what}: ours differs from the thesis, and no remark says why")

    @property
    def differs(self) -> bool:
        """Whether ours shows something else."""
        return self.same is not None and not self.same

    @property
    def cells(self) -> tuple[str, ...]:
        """What is printed of it."""
        verdict = SAME if self.same else f"{DIFFERS}{self.otherwise}" if self.differs and self.otherwise else ""
        values = (self.printed, self.classic, self.bank)
        return (
            self.what,
            *(value or NOT_PRINTED for value in values),
            "; ".join(filter(None, (verdict, self.remark))),
        )


def row(
    what: str,
    printed: str = "",
    classic: str = "",
    bank: str = "",
    *,
    same: bool | None = None,
    remark: str = "",
    otherwise: str = "",
) -> Row:
    """Give a row; its parts are those of `Row`."""
    return Row(
        what=what,
        printed=printed,
        classic=classic,
        bank=bank,
        same=None if same is None else bool(same),
        remark=remark,
        otherwise=otherwise,
    )


def short(value: float) -> str:
    """Write a number to three digits as the thesis does: 4.45e11."""
    return f"{value:.3g}".replace("e+", "e").replace("e-0", "e-")


def percent(value: float, digits: int = 0) -> str:
    """Write a part as per cent."""
    return f"{100 * value:.{digits}f} %"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Figure:
    """A figure under its number.

    number : as in the thesis, `5.13`. caption : in our words. words : what was done, where it is not plain
    """

    number: str
    caption: str
    source: str
    panels: tuple[Panel, ...]
    rows: tuple[Row, ...]
    words: str = ""
    columns: int = 2

    @property
    def name(self) -> str:
        """Name of the picture."""
        return f"figure_{self.number.replace('.', '_')}.svg"

    @property
    def picture(self) -> str:
        """The SVG."""
        return draw(self.panels, self.columns)

    @property
    def text(self) -> str:
        """The figure in Markdown, with its heading."""
        image = f"![{self.caption}](images/thesis/{self.name})"
        place = f"Thesis {self.source}. {self.words}".strip()
        table = as_markdown(COLUMNS, [row.cells for row in self.rows])
        return f"### Figure {self.number}: {self.caption}\n\n{place}\n\n{image}\n\n{table}"


def write_pictures(figures: Sequence[object], folder: Path = FOLDER) -> None:
    """Write the pictures of those that have one."""
    folder.mkdir(parents=True, exist_ok=True)
    for item in figures:
        if isinstance(item, Figure):
            (folder / item.name).write_text(item.picture, encoding="utf-8")
