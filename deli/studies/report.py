"""A study's report: one text in Markdown with its pictures, and the same as a page that needs no other file."""

import base64
import html
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from markdown_it import MarkdownIt

from deli.config.reading import parse_toml
from deli.numerals import numeral
from deli.plotting.figures import write_picture
from deli.recording.whole import write_text
from deli.studies.findings import COMPLETE, findings
from deli.studies.layout import PAGE, PICTURES, TEXT
from deli.studies.matching import SCENE
from deli.studies.model import check_table
from deli.studies.plot_tables import Plot
from deli.studies.plots import check_plots, draw, first_look
from deli.studies.states import DONE, EXCLUDED

_MARKUP = re.compile(r"[\\`*\[\]<>&|]|(?<!\w)_|_(?!\w)")
RAN = ("machine", "workers", "deli_version")
DPI = 110
MOST_ROWS = 1000
COLUMNS = (
    "energy_band", "energy_drift", "momentum_error", "angular_momentum_error", "violation_worst", "equality_residual",
    "trajectory_error", "smooth_contacts", "solves", "verified_solves", "iterations", "solver_time", "cpu_time",
    "recording_time", "wall_time",
)  # fmt: skip
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2 { font-weight: 600; line-height: 1.2; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; 
  display: block; overflow: auto; max-height: 40rem; }
thead th { position: sticky; top: 0; background: white; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid #ddd; text-align: right; }
th { vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; white-space: nowrap; }
img { max-width: 100%; }
code { background: #f4f4f4; padding: 0 .2em; }
"""


def plots_of(study: xr.Dataset) -> list[Plot]:
    """Return the plots of a study's file, or those of a first look.

    Raises
    ------
    InputError
        If a plot names an axis, a metric or a label that the study does not have.
    """
    found = parse_toml(study.attrs["study"]).get("plots", [])
    plots = check_table({"base": {}, "plots": found}).plots or first_look(study)
    check_plots(plots, study)
    return plots


def write_report(study: xr.Dataset) -> tuple[Path, Path]:
    """Write ``report.md`` with its pictures, and ``report.html`` with the pictures inside, into a study's folder.

    Parameters
    ----------
    study : xarray.Dataset
        From `deli.open_study`.

    Returns
    -------
    page, text : Path

    Raises
    ------
    InputError
        If a plot names an axis, a metric or a label that the study does not have.
    """
    folder, title = Path(study.attrs["folder"]), study.attrs["title"]
    plots = plots_of(study)
    pictures = folder / PICTURES
    pictures.mkdir(exist_ok=True)
    blocks = [f"# {_escaped(title)}", "## Findings", _list(map(_escaped, findings(study)))]
    drawn = {}
    for number, plot in enumerate(plots):
        name = f"{PICTURES}/{number}-{plot.kind}.png"
        write_picture(draw(plot, study), folder / name, DPI)
        drawn[name] = _inlined(folder / name)
        blocks += [f"## {_escaped(plot.title)}", f"![{_escaped(plot.title)}]({name})"]
    blocks += ["## Cases", _cases(study), "## Failures", _failures(study)]
    blocks += ["## Metrics", _definitions(study)]
    blocks += [
        "## Machines and versions",
        _list(_escaped(f"{name.replace('_', ' ')}: {study.attrs[name]}") for name in RAN),
    ]
    fence = "`" * (1 + max(map(len, re.findall("`{2,}", study.attrs["study"])), default=2))
    blocks += ["## Study file", f"{fence}toml\n{study.attrs['study'].strip()}\n{fence}"]
    text = "\n\n".join(block for block in blocks if block) + "\n"
    source, page = folder / TEXT, folder / PAGE
    write_text(source, text)
    write_text(page, _page(title, text, drawn))
    return page, source


def _escaped(text: str) -> str:
    """Return text as Markdown that shows it literally, without markup of its own."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(text.split()))


def _page(title: str, text: str, drawn: Mapping[str, str]) -> str:
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    body = re.sub(r"<th>.*?</th>", lambda found: found[0].replace("_", "_<wbr>"), body)
    body = re.sub(r'src="([^"]+)"', lambda found: f'src="{drawn[found[1]]}"', body)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{html.escape(title)}</title>\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _inlined(picture: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture.read_bytes()).decode()}"


def _list(lines: Any) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _cases(study: xr.Dataset) -> str:
    """Return the table of cases, or of geometric means over the last axes if there are too many cases.

    Scenes come first, and axes of one label are left out.
    """
    names = sorted((str(name) for name in study["state"].dims), key=lambda name: name != SCENE)
    axes = [name for name in names if study.sizes[name] > 1] or names[:1]
    study = study.isel({name: 0 for name in names if name not in axes}).transpose(*axes)
    shown = [name for name in COLUMNS if name in study and study[name].notnull().any()]
    if study["state"].size <= MOST_ROWS:
        return _table([*axes, "state", *shown], list(_rows(study, axes, shown)))
    kept = list(axes)
    while len(kept) > 1 and int(np.prod([study.sizes[name] for name in kept])) > MOST_ROWS:
        kept.pop()
    complete = study[shown].where(study["state"] == DONE)
    with np.errstate(divide="ignore"):  # the mean with a zero is zero
        logarithms = complete.map(lambda values: np.log(abs(values)))
    means = logarithms.mean(axes[len(kept) :]).map(np.exp)
    means["state"] = (study["state"] == DONE).sum(axes[len(kept) :])
    counts = complete.notnull().sum(axes[len(kept) :])
    told = (
        f"Geometric means over {', '.join(axes[len(kept) :])} of the completed cases, whose number is `state`. A mean "
        "of fewer cases is followed by their number in brackets. Rows with different numbers of cases are means of "
        "different cases."
    )
    return f"{told}\n\n" + _table([*kept, "state", *shown], list(_rows(means, kept, shown, counts)))


def _rows(
    metrics: xr.Dataset, axes: list[str], shown: list[str], counts: xr.Dataset | None = None
) -> Iterator[list[str]]:
    """Yield the cells of each case, or of means; `counts` holds the numbers of cases behind each mean."""
    for index in np.ndindex(*(metrics.sizes[name] for name in axes)):
        place = dict(zip(axes, index, strict=True))
        case = metrics.isel(place)
        if case["state"].item() == EXCLUDED:
            continue
        words = [_word(case[name].item()) for name in (*axes, "state", *shown)]
        if counts is not None:
            of = [int(counts[name].isel(place)) for name in shown]
            fewer = (f" ({count})" if 0 < count < case["state"].item() else "" for count in of)
            words[-len(shown) :] = [f"{value}{said}" for value, said in zip(words[-len(shown) :], fewer, strict=True)]
        yield words


def _failures(study: xr.Dataset) -> str:
    """Return the table of the outcomes of incomplete cases, with their numbers."""
    ends = study["outcome"].values.ravel()[study["state"].values.ravel() != EXCLUDED].tolist()
    told = Counter(outcome for outcome in ends if outcome != COMPLETE)
    return _table(["cases", "outcome"], [[str(told[end]), _escaped(end)] for end in sorted(told)]) if told else "None."


def _definitions(study: xr.Dataset) -> str:
    shown = [name for name in COLUMNS if name in study and study[name].notnull().any()]
    rows = [[f"`{name}`", study[name].attrs["long_name"], study[name].attrs["units"]] for name in shown]
    note = "L, M and T are the scene's own units of length, mass and time; s is the second; 1 is a pure number."
    return f"{_table(['metric', 'meaning', 'units'], rows)}\n\n{note}"


def _table(header: list[str], rows: list[list[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _word(value: Any) -> str:
    if not isinstance(value, float):
        return _escaped(str(value))
    return numeral(value, 3) if np.isfinite(value) else "–"
