#!/usr/bin/python3
"""test_view_page.py INSITU_VIEW INSITU_WAVE FOLDER: insitu-view's page beside a running simulation, in a browser without a
screen. The run is steered by edits of its scene, right and wrong ones. Where Debian's chromium, chromium-driver or
python3-selenium is missing the test is skipped (status 77).
"""
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys

from cinema_browser import By, start, wait
from view_process import View

program, wave, folder = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])

SCENE = """parameters: {strength: 1, period: 0.8}
images:
  - name: fronts
    size: [320, 200]
    every: 40
    camera: {automatic: {direction: [1, -1.6, 0.7]}, up: [0, 0, 1]}
    layers:
      - isosurface: {field: pressure, values: [-0.1, 0.1], colour_by: {field: speed, map: viridis}}
    decorations: {outline: true}
    outputs: [{cinema: run.cdb}]
statistics:
  - {field: pressure, path: pressure.csv, every: 10}
"""


class Page:
    def __init__(self, driver, view):
        self.driver = driver
        # The page and that of the pictures in it look for news five times as often as they do for a user.
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {
            "source": "{ const wait = window.setTimeout; window.setTimeout = (f, delay) => wait(f, delay / 5); }"})
        driver.get(view.address)

    def at(self, name):
        return self.driver.find_element(By.ID, name)

    def text(self, name):
        return self.at(name).text

    def edit(self, text):
        self.driver.execute_script("const t = document.getElementById('text'); t.value = arguments[0];"
                                   "t.dispatchEvent(new Event('input', {bubbles: true}))", text)

    def save(self, text):
        self.edit(text)
        self.at("save").click()

    def picture(self):
        """The caption of the picture that is shown."""
        self.driver.switch_to.frame(self.at("pictures"))
        try:
            shown = self.driver.execute_script("return document.getElementById('picture0').naturalWidth")
            return self.at("caption0").text if shown else ""
        finally:
            self.driver.switch_to.default_content()


def report():
    return json.loads((folder / "run.cdb" / "report.json").read_text())


def peaks():
    with open(folder / "pressure.csv", newline="") as file:
        return [float(row["maximum"]) for row in csv.DictReader(file) if row["maximum"]]


def a_run_that_begins_is_followed(page, run):
    wait("the page waits", lambda: "no pictures yet" in page.text("waiting"))
    wait("the scene is read", lambda: page.at("text").get_attribute("value") == SCENE)
    run()
    wait("a picture is shown", lambda: page.at("pictures").is_displayed() and "cycle" in page.picture())
    first = page.picture()
    wait("a later one is", lambda: page.picture() not in ("", first))
    wait("the run draws by the scene", lambda: "draws by this scene" in page.text("scene_state"))
    assert page.text("now").startswith("cycle "), page.text("now")
    wait("statistics are drawn", lambda: len(page.driver.find_elements(By.CSS_SELECTOR, "#curves path.maximum")) == 1)
    wait("warnings are told", lambda: "image \"fronts\": the isosurface of \"pressure\" at 0.1 is empty" in page.text("warnings"))


def a_broken_edit_is_reported_with_its_line(page):
    page.save(SCENE.replace("period: 0.8", "period: fast"))
    wait("the error", lambda: "Line 1: parameters.period: \"fast\" is not allowed, expected a number" == page.text("scene_message"))
    assert "goes on with the last one" in page.text("scene_state") and page.at("lines").find_element(By.TAG_NAME, "b").text == "1"
    page.save(SCENE.replace("size:", "sise:"))
    wait("the next one", lambda: page.text("scene_message").startswith("Line 4: images[0]: the key \"sise\" is unknown (did you mean size?)"))
    assert page.at("lines").find_element(By.TAG_NAME, "b").text == "4"
    shot(page, "broken.png")
    before = report()["cycle"]
    wait("the run goes on", lambda: report()["cycle"] > before)
    assert report()["parameters"] == {"strength": 1, "period": 0.8}


def an_edit_steers_the_run(page):
    before = max(peaks())
    page.save(SCENE.replace("strength: 1", "strength: 20"))
    wait("the run has taken it", lambda: "draws by this scene" in page.text("scene_state") and not page.text("scene_message"))
    assert report()["parameters"]["strength"] == 20 and not page.driver.find_elements(By.CSS_SELECTOR, "#lines b")
    wait("the wave is higher", lambda: max(peaks()) > 10 * before)
    page.save(SCENE.replace("field: pressure, values", "field: presure, values"))
    wait("a field that is not there is told", lambda: "\"presure\"" in page.text("error"))
    page.save(SCENE)
    wait("and forgotten", lambda: page.text("error") == "" and "draws by this scene" in page.text("scene_state"))
    wait("a picture is shown", lambda: "cycle" in page.picture())
    shot(page, "steered.png")


def edits_of_others_are_kept(page):
    page.edit(SCENE + "# mine\n")
    assert page.text("scene_state") == "Not saved yet."
    other = SCENE + "# another one's\n"
    (folder / "scene.new").write_text(other)
    os.rename(folder / "scene.new", folder / "scene.yaml")
    page.at("save").click()
    wait("it is refused", lambda: "Not saved: the file was changed by another program" in page.text("scene_message"))
    assert (folder / "scene.yaml").read_text() == other
    page.at("revert").click()
    wait("the file is shown", lambda: page.at("text").get_attribute("value") == other)
    wait("the run draws by it", lambda: "draws by this scene" in page.text("scene_state"))


def no_script_failed(page):
    failed = [entry for entry in page.driver.get_log("browser") if entry["source"] == "javascript" or "Content Security" in entry["message"]]
    assert not failed, json.dumps(failed, indent=1)


def shot(page, name):
    page.driver.save_screenshot(str(folder / name))


def main():
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "scene.yaml").write_text(SCENE)
    running = []

    def run():
        running.append(subprocess.Popen([wave, "--scene", "scene.yaml", "--size", "16", "--cells", "hex", "--steps", "10000000"],
                                        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))

    try:
        with View(program, "run.cdb", "--scene", "scene.yaml", folder=folder) as view:
            driver = start(folder / "profile", (1400, 1100))
            try:
                page = Page(driver, view)
                a_run_that_begins_is_followed(page, run)
                for test in (a_broken_edit_is_reported_with_its_line, an_edit_steers_the_run, edits_of_others_are_kept, no_script_failed):
                    test(page)
                    print(test.__name__, "is so", flush=True)
            finally:
                driver.quit()
    finally:
        for process in running:
            process.kill()
            process.wait()
    shutil.rmtree(folder / "profile", ignore_errors=True)


os.environ["OMP_NUM_THREADS"] = "1"
main()
