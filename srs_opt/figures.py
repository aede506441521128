"""One style for all pictures: colour-blind safe, units on axes, readable at column width, vector and PNG."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from srs_opt.files import atomic_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Okabe and Ito's palette: distinguishable with any colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
LEFT, RIGHT = COLOURS[0], COLOURS[1]
SEQUENTIAL = "viridis"
COLUMN_IN = 3.5  # width of a paper's column
PAGE_IN = 7.2
_STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 9,
    "axes.labelsize": 8,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "srs-opt",
}


F = TypeVar("F", bound=Callable[..., Any])


def styled(draw: F) -> F:
    """Decorate a drawing function: everything that it draws has the project's style."""

    @wraps(draw)
    def drawn(*args: Any, **options: Any) -> Any:
        import matplotlib as mpl

        with mpl.rc_context(_STYLE):
            return draw(*args, **options)

    return drawn  # type: ignore[return-value]


@styled
def new_figure(
    rows: int = 1, columns: int = 1, *, width_in: float = COLUMN_IN, height_in: float = 2.6, **options: Any
) -> tuple[Figure, Any]:
    """Return a figure in the project's style and its axes (works without a display).

    Options go to ``Figure.subplots`` (``sharex``, ``gridspec_kw`` ...).
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


@styled
def save_figure(figure: Figure, stem: Path | str, *, dpi: int = 200) -> tuple[Path, Path]:
    """Write `figure` as ``stem.png`` and ``stem.svg``, atomically."""
    plain_names(figure)
    stem = Path(stem)
    targets = (stem.with_name(stem.name + ".png"), stem.with_name(stem.name + ".svg"))
    for target in targets:
        with atomic_path(target) as temporary:
            metadata = {"Date": None} if target.suffix == ".svg" else None
            figure.savefig(temporary, dpi=dpi, metadata=metadata)
    return targets


def plain_names(figure: Figure) -> None:
    """Draw every text as it stands: a name may hold a dollar sign, which would begin mathematics.

    The labels of logarithmic axes are matplotlib's own and remain mathematics.
    """
    from matplotlib.text import Text
    from matplotlib.ticker import LogFormatter

    powers: set[Text] = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_formatter(), LogFormatter):
                powers.update(axis.get_ticklabels(which="both"))
    for text in figure.findobj(Text):
        if text not in powers:
            text.set_parse_math(False)


def line_key(label: str, **style: Any) -> Line2D:
    """Return a legend's entry for a style that several lines share, such as one colour per pressure."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **{"color": "black", **style}, label=label)


def draw_body(axes: Axes, x: Any, y: Any, width_m: float, **style: Any) -> None:
    """Draw a body as the capsule of `width_m` along the centre line (x, y), in data units."""
    import shapely

    shape = shapely.LineString(list(zip(x, y))).buffer(width_m / 2, quad_segs=8)
    fill_region(axes, shape, **{"alpha": 0.6, **style})


def fill_region(axes: Axes, region: Any, **style: Any) -> None:
    """Fill a shapely region in data units; its holes stay open."""
    import shapely
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    parts = [part for part in shapely.get_parts(region) if part.geom_type == "Polygon"]
    rings = [Outline(ring.coords, closed=True) for p in parts for ring in (p.exterior, *p.interiors)]
    if not rings:
        return
    axes.add_patch(PathPatch(Outline.make_compound_path(*rings), **{"linewidth": 0, **style}))
    axes.update_datalim([region.bounds[:2], region.bounds[2:]])
    axes.autoscale_view()


@dataclass(frozen=True)
class Picture:
    """A picture of a page, as PNG in base64, with its words."""

    title: str
    caption: str
    png: str


def png_of(figure: Figure, **options: Any) -> bytes:
    """Return a figure as PNG; options go to ``savefig``."""
    plain_names(figure)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", metadata={"Software": None}, **options)
    return stream.getvalue()


def encoded(figure: Figure, title: str, caption: str) -> Picture:
    """Return a figure as a picture of a page that needs no other file."""
    return Picture(title, caption, base64.b64encode(png_of(figure)).decode("ascii"))
