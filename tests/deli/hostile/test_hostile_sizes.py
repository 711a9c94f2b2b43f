"""Sizes that no machine has: refused before anything is allocated, with the estimate, what there is and what to do."""

import pytest
from hostile_judging import DONE, REFUSED, judge

import deli

SMALL = 60_000_000
"""Bytes that a refusal may take."""
COUNTS = {
    "chain_on_cylinder": "masses", "disc_pile": "rows", "granular_chain": "beads", "hard_rods": "rods",
    "wedge": "copies", "hard_sphere_gas": "spheres", "lennard_jones": "spheres", "newtons_cradle": "balls",
}  # fmt: skip
ABSURD = [
    *((f"{scene} scene.{key}={count}", [key, "take about", "GB", "free", "fewer"])
      for scene, key in COUNTS.items() for count in (10**10, 2**62)),
    ("disc_pile scene.rows=100000 scene.columns=100000", ["rows and columns", "10,000,000,000", "GB", "free"]),
    ("wedge scene.walls=100000 scene.copies=100000", ["walls and copies", "GB", "free"]),
    ("lennard_jones scene.spheres=100000", ["all pairs of 100,000 bodies", "GB", "free", "fewer"]),
    ("point_mass steps=10000000000", ["10,000,000,001 rows", "GB of memory", "free", "record.every"]),
    ("point_mass steps=10000000000 record.every=3", ["3,333,333,335 rows", "free"]),
    ("point_mass steps=9007199254740993 record.every=9007199254740992", ["steps", "allowed", "9,007,199,254,740,992"]),
    ("point_mass record.every=9223372036854775807", ["every", "allowed", "9,007,199,254,740,992"]),
    ("point_mass steps=9223372036854775808", ["steps", "64 bits", "allowed"]),
    ("point_mass duration=1e308 step_size=1e-10", ["duration", "inf steps", "allowed"]),
    ("point_mass duration=1e300 step_size=1e-5", ["duration", "1e+305 steps", "allowed"]),
    ("point_mass steps=1 step_size=1e200", ["step_size is 1e+200", "allowed", "1e+150"]),
    ("point_mass step_size=5e-324", ["duration", "steps of step_size 5e-324", "allowed"]),
]  # fmt: skip


def setting(words):
    scene, *overrides = words.split()
    return [scene, *(part for override in overrides for part in ("--set", override))]


@pytest.mark.parametrize("way", [("--dry-run",), ()], ids=["planned", "run"])
@pytest.mark.parametrize(("words", "said"), ABSURD, ids=[words.replace(" ", "-") for words, _ in ABSURD])
def test_runs(victim, tmp_path, words, said, way):
    outcome = judge(victim.run(tmp_path, "run", *setting(words), "-o", "run.nc", *way))
    assert outcome.status == REFUSED
    assert all(word in outcome.errors for word in said), outcome.errors
    assert outcome.grown < SMALL
    assert not list(tmp_path.iterdir())


def test_what_fits_is_planned(victim, tmp_path):
    """The bounds are not so tight that they refuse what runs."""
    most = "steps=9007199254740992 record.every=9007199254740992"
    for words in (
        f"point_mass {most} step_size=1e-9",
        "hard_sphere_gas scene.spheres=2000",
        "disc_pile",
        "granular_chain",
    ):
        assert judge(victim.run(tmp_path, "run", *setting(words), "--dry-run")).status == DONE


def test_more_workers_than_processes(victim, tmp_path):
    (tmp_path / "study.toml").write_text(
        'workers = 1_000_000\nbase = { scene = "point_mass" }\naxes.step_size = [0.1]\n'
    )
    outcome = judge(victim.run(tmp_path, "study", "study.toml", "--dry-run"))
    assert "workers is 1000000; allowed: less than or equal to 1000" in outcome.errors


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    place = tmp_path_factory.mktemp("recorded")
    deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.1, steps=20, output=place / "run.nc")
    return place


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--duration 1e9", ["duration 1000000000.0 at fps 25.0", "100,000 frames"]),
        ("--duration 1e308 --fps 50", ["100,000 frames"]),
        ("--duration 3999 --dpi 200", ["99,975 frames of 1280 x", "GB of memory", "free", "smaller dpi"]),
        ("--fps 1e308", ["fps: found 1e+308", "50 a second"]),
        ("--fps 1e-308", ["fps: found 1e-308", "50 a second"]),
        ("--dpi 1e9", ["dpi: found", "1000 pixels"]),
        ("--dpi inf", ["dpi: found inf"]),
        ("--duration nan", ["duration: found nan"]),
        ("--duration inf", ["duration"]),
        ("--start nan", ["start and end"]),
        (f"--every {10**30}", []),
    ],
)
def test_films(victim, recorded, options, said):
    outcome = judge(victim.run(recorded, "animate", "run.nc", *options.split(), "-q"), "fps", "dpi", "frames", "start")
    assert outcome.status == (REFUSED if said else DONE)
    assert all(word in outcome.errors for word in said), outcome.errors
    assert outcome.grown < 2 * SMALL
