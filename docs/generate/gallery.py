"""A picture of each scene, and each figure of the paper in its quick form."""

import hashlib
from pathlib import Path

import deli
from deli import scenes
from deli.figures import CONFIGS, Maker, load_folder
from deli.plotting.style import STYLE
from deli.plotting.trajectory import draw_trajectory
from generate.markdown import paragraphs

SHORT = {"chain_on_cylinder": 0.4, "disc_pile": 0.2, "lennard_jones": 40.0}
"""Durations of scenes whose pictures gain nothing from longer runs."""
LONGEST = 30.0


def draw(folder: Path) -> None:
    """Draw missing pictures, and pictures whose sources have changed."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    stamp = folder / "gallery.sha256"
    digest = _digest()
    if stamp.exists() and stamp.read_text() == digest:
        return
    for name in scenes.available():
        usual = scenes.defaults(name)
        scene = scenes.get(name)()
        duration = min(SHORT.get(name, LONGEST), usual["duration"])
        run = deli.simulate(scene, deli.GVI(scheme=usual["scheme"]), step_size=usual["step_size"], duration=duration)
        with matplotlib.rc_context(STYLE):
            figure = Figure(figsize=(6.0, 4.0), layout="constrained")
            draw_trajectory(figure, run, scene)
            figure.savefig(folder / f"scene_{name}.png", dpi=110)
    maker = Maker(folder / "figures", quick=True)
    for figure in load_folder(CONFIGS, ()):
        maker.picture(figure, maker.dataset(figure))
    stamp.write_text(digest)


def page() -> str:
    """Return the page."""
    parts = ["# Gallery", "The build makes each picture with the deli that it documents.", "## Scenes"]
    parts += [f"### `{name}`\n\n[![{name}](scene_{name}.png){{w=480px}}](scenes.md)" for name in scenes.available()]
    parts += [
        "## Figures of the paper",
        "Quick forms, with shorter runs; `deli figures ID` makes the full one.",
    ]
    for figure in load_folder(CONFIGS, ()):
        parts.append(
            f"### {figure.name}: {figure.table.title}\n\n![{figure.name}](figures/{figure.name}.png){{w=640px}}\n\n"
            f"{figure.table.claim}"
        )
    return paragraphs(*parts)


def _digest() -> str:
    sources = [path for folder in (Path(deli.__file__).parent, CONFIGS) for path in sorted(folder.rglob("*.[pt][yo]*"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources if path.is_file())).hexdigest()
