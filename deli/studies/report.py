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

from deli.studies.findings import COMPLETE, findings
from deli.studies.plots import OpenCase, Plot, draw

PICTURES = "report"
DPI = 110
MOST_ROWS = 300
COLUMNS = (
    "energy_band", "energy_drift", "momentum_error", "angular_momentum_error", "violation_worst", "equality_residual",
    "trajectory_error", "smooth_contacts", "solves", "verified_solves", "iterations", "solver_time", "wall_time",
)  # fmt: skip
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2 { font-weight: 600; line-height: 1.2; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; 
  display: block; overflow-x: auto; }
th, td { padding: .2rem .6rem; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
img { max-width: 100%; }
code { background: #f4f4f4; padding: 0 .2em; }
"""


def write_report(
    folder: Path,
    title: str,
    study: str,
    metrics: xr.Dataset,
    ran: Mapping[str, Any],
    plots: list[Plot],
    open_case: OpenCase,
) -> tuple[Path, Path]:
    """Write ``report.md`` with its pictures and ``report.html``, which holds everything, into a study's folder.

    Parameters
    ----------
    folder : Path
    title, study : str
        The study's title, and its file's text.
    metrics : xarray.Dataset
        Metrics, ``outcome`` and ``file`` on the axes of the study.
    ran : mapping
        What ran where, in words.
    plots : list of Plot
    open_case : callable
        Opens the run of a case, given its labels.

    Returns
    -------
    page, text : Path
    """
    pictures = folder / PICTURES
    pictures.mkdir(exist_ok=True)
    blocks = [f"# {title}", "## What it found", _list(findings(metrics))]
    for number, plot in enumerate(plots):
        name = f"{number}-{plot.kind}.png"
        draw(plot, metrics, open_case).savefig(pictures / name, dpi=DPI)
        blocks += [f"## {plot.title}", f"![{plot.title}]({PICTURES}/{name})"]
    blocks += ["## Cases", _cases(metrics), "## Failures", _failures(metrics)]
    blocks += ["## What the numbers mean", _definitions(metrics)]
    blocks += ["## What ran where", _list(f"{key}: {value}" for key, value in ran.items())]
    blocks += ["## The study", f"```toml\n{study.strip()}\n```"]
    text = "\n\n".join(block for block in blocks if block) + "\n"
    source, page = folder / "report.md", folder / "report.html"
    source.write_text(text, encoding="utf-8")
    page.write_text(_page(title, text, folder), encoding="utf-8")
    return page, source


def _page(title: str, text: str, folder: Path) -> str:
    body = MarkdownIt("commonmark").enable("table").render(text)
    body = re.sub(r'src="([^"]+)"', lambda found: f'src="{_inlined(folder / found[1])}"', body)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{html.escape(title)}</title>\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _inlined(picture: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture.read_bytes()).decode()}"


def _list(lines: Any) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _cases(metrics: xr.Dataset) -> str:
    """One row a case; of a study with too many, geometric means over the last axes."""
    axes = [str(name) for name in metrics["outcome"].dims]
    shown = [name for name in COLUMNS if metrics[name].notnull().any()]
    if metrics["outcome"].size <= MOST_ROWS:
        return _table([*axes, "outcome", *shown], list(_rows(metrics, axes, shown)))
    kept = list(axes)
    while len(kept) > 1 and int(np.prod([metrics.sizes[name] for name in kept])) > MOST_ROWS:
        kept.pop()
    complete = metrics[shown].where(metrics["outcome"] == COMPLETE)
    logarithms = complete.map(lambda values: np.log(abs(values)))
    means = logarithms.mean(axes[len(kept) :]).map(np.exp)
    means["outcome"] = (metrics["outcome"] == COMPLETE).sum(axes[len(kept) :])
    told = f"Geometric means over {', '.join(axes[len(kept) :])} of the cases that ended, which `outcome` counts."
    return f"{told}\n\n" + _table([*kept, "outcome", *shown], list(_rows(means, kept, shown)))


def _rows(metrics: xr.Dataset, axes: list[str], shown: list[str]) -> Iterator[list[str]]:
    for index in np.ndindex(*(metrics.sizes[name] for name in axes)):
        case = metrics.isel(dict(zip(axes, index, strict=True)))
        outcome = str(case["outcome"].item()).split(":")[0].split(" (")[0]
        yield [
            *(_word(case[name].item()) for name in axes),
            outcome,
            *(_word(case[name].item()) for name in shown),
        ]


def _failures(metrics: xr.Dataset) -> str:
    told = Counter(str(outcome) for outcome in metrics["outcome"].values.ravel())
    failed = {outcome: count for outcome, count in told.items() if outcome not in (COMPLETE, "")}
    if not failed:
        return "None."
    return _table(["cases", "outcome"], [[str(count), outcome] for outcome, count in sorted(failed.items())])


def _definitions(metrics: xr.Dataset) -> str:
    shown = [name for name in COLUMNS if metrics[name].notnull().any()]
    rows = [[f"`{name}`", metrics[name].attrs["long_name"], metrics[name].attrs["units"]] for name in shown]
    note = "L, M and T are the scene's own units of length, mass and time; s is seconds, 1 a pure number."
    return f"{_table(['metric', 'meaning', 'units'], rows)}\n\n{note}"


def _table(header: list[str], rows: list[list[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _word(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
