"""A report, opened in a browser: what is on the page is what the study found."""

import re
import shutil

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from typer.testing import CliRunner

import deli
from deli.cli import app
from deli.numerals import numeral
from deli.studies.findings import findings

STUDY = """
title = "Loose & tight <solvers>"
workers = 1
[base]
steps = 30
step_size = 0.1
scene.name = "spring_sphere"
method.name = "gvi"
solvers = { backend = "daqp", polish = false }
[axes]
"scene.name" = ["spring_sphere", "nonlinear_oscillator"]
"solvers.default.backend" = ["daqp", "clarabel"]
"solvers.default.tolerance" = [1e-3, 1e-9]
"""
PLOTS = """
[[plots]]
kind = "heat_map"
title = "Contacts that last"
x = "solver"
y = "solver_tolerance"
value = "smooth_contacts"
where = { scene = "spring_sphere" }
[[plots]]
kind = "profile"
title = "How often, and how fast"
cost = "wall_time"
by = "solver"
"""

TRUTH_VALUES = """
base = { scene.name = "point_mass", steps = 20 }
[axes]
"solvers.default.polish" = [true, false]
skip = [true, false]
step_size = [0.01, 0.02]
[[plots]]
kind = "heat_map"
title = "Time"
x = "step_size"
y = "polish"
value = "wall_time"
panels = "skip"
where = { polish = false }
"""


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("report")
    (place / "study.toml").write_text(STUDY)
    assert call("study", place / "study.toml", "-o", place / "out", "-q").exit_code == 0
    assert call("report", place / "out").exit_code == 0
    return place / "out"


@pytest.fixture(scope="module")
def browser():
    found = [shutil.which(name) for name in ("chromium", "google-chrome", "chromium-browser")]
    driver = shutil.which("chromedriver")
    if driver is None or not any(found):
        pytest.skip("no browser: install chromium and chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = next(name for name in found if name)
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    window = webdriver.Chrome(options=options, service=Service(driver))
    yield window
    window.quit()


def texts(browser, tag):
    return [element.text for element in browser.find_elements(By.TAG_NAME, tag)]


def test_the_page_shows_findings_pictures_and_cases(folder, browser, tmp_path):
    alone = tmp_path / "alone.html"
    alone.write_bytes((folder / "report.html").read_bytes())  # nothing else beside it
    browser.get(alone.as_uri())
    study = deli.open_study(folder)
    assert browser.title == "Loose & tight <solvers>"
    assert texts(browser, "h1") == ["Loose & tight <solvers>"]
    assert texts(browser, "li")[: len(findings(study))] == findings(study)
    pictures = browser.find_elements(By.TAG_NAME, "img")
    assert len(pictures) >= 3
    for picture in pictures:
        assert browser.execute_script("return arguments[0].complete && arguments[0].naturalWidth > 300", picture)
    cases = browser.find_elements(By.TAG_NAME, "table")[0].find_elements(By.TAG_NAME, "tr")
    assert len(cases) == 1 + study["state"].size
    band = numeral(float(study["energy_band"].sel(scene="spring_sphere", solver="daqp", solver_tolerance=1e-3)), 3)
    assert band in cases[1].text.split()
    assert not browser.get_log("browser")


def test_the_text_names_the_same_pictures(folder):
    text = (folder / "report.md").read_text()
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", text)
    assert pictures
    assert all((folder / picture).stat().st_size > 1000 for picture in pictures)
    assert 'scene.name = "spring_sphere"' in text


def test_a_study_chooses_its_plots(folder):
    study = deli.open_study(folder)
    from deli.studies.report import write_report

    study.attrs["study"] = STUDY + PLOTS
    _, text = write_report(study)
    assert re.findall(r"!\[(.*?)\]", text.read_text()) == ["Contacts that last", "How often, and how fast"]
    study.attrs["study"] = (STUDY + PLOTS).replace("where = {", "where = { polish = false,")
    write_report(study.expand_dims(polish=[False]).transpose("scene", ...))  # no mask
    for wrong, found in (('x = "solver"', 'x = "solvers"'), ('spring_sphere" }', 'sphere" }')):
        study.attrs["study"] = STUDY + PLOTS.replace(wrong, found)
        with pytest.raises(deli.InputError, match=r"plots\.0\.(x|where\.scene) is 's\w+'; .*allowed: .*s"):
            write_report(study)


def test_a_folder_without_a_study_is_refused(tmp_path):
    result = call("report", tmp_path)
    assert result.exit_code == 2
    assert "holds no study: there is no manifest.json" in result.output


def test_plots_pick_one_of_two_truth_values(tmp_path):
    (tmp_path / "study.toml").write_text(TRUTH_VALUES)
    assert call("study", tmp_path / "study.toml", "-o", tmp_path / "out", "--workers", "1", "-q").exit_code == 0
    ended = call("report", tmp_path / "out")
    assert ended.exit_code == 0, ended.output
    assert (tmp_path / "out" / "report" / "0-heat_map.png").stat().st_size > 1000
