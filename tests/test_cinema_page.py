#!/usr/bin/python3
"""test_cinema_page.py SIX_CALLS FOLDER: the page of Cinema databases in a browser without a screen, from file://.

Two runs write their databases; the page is then moved by sliders and keys as a user would, and each picture that it shows is
held against the line of data.csv that says so. Where Debian's chromium, chromium-driver or python3-selenium is missing the
test is skipped (status 77).
"""
import csv
import itertools
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

from cinema_browser import ActionChains, By, Keys, start, wait

program, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()

NAME = 'a, "b" #1%'  # what a table, a script and a URL each have to write in their own way
SCENE = """
images:
  - name: '{name}'
    size: [160, 120]
    every: {every}
    camera: {{orbit: {{views: {views}, elevation: [0, 40]}}}}
    sweep: {{isovalues: true, fields: [pressure]}}
    layers: [{{isosurface: {{field: pressure, values: {values}, colour_by: {{field: pressure, range: [-1, 1]}}}}}}]
    outputs: [{{cinema: {database}}}]
"""


def draw(database, **keys):
    scene = folder / "scene.yaml"
    scene.write_text(SCENE.format(name=NAME, database=database, **keys))
    subprocess.run([program, scene], cwd=folder, check=True)


class Page:
    def __init__(self, driver):
        self.driver = driver

    def open(self, query=""):
        self.driver.get((folder / "run.cdb" / "index.html").as_uri() + query)
        wait("a picture is shown", lambda: self.is_shown(0))

    def at(self, name):
        return self.driver.find_element(By.ID, name)

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def is_shown(self, pane):
        return self.run("const p = document.getElementById('picture' + arguments[0]);"
                        "return p.offsetParent !== null && p.complete && p.naturalWidth > 0", pane)

    def file(self, pane=0):
        """The picture's file below the database, as the disk names it."""
        return self.run("return decodeURIComponent(document.getElementById('picture' + arguments[0]).src"
                        ".replace(/.*\\//, ''))", pane)

    def caption(self, pane=0):
        return self.at(f"caption{pane}").text

    def sliders(self):
        return [s.get_attribute("id").removeprefix("slider_")
                for s in self.driver.find_elements(By.CSS_SELECTOR, "#sliders input[type=range]")]

    def value(self, name):
        return int(self.run("return document.getElementById('slider_' + arguments[0]).value", name))

    def last(self, name):
        return int(self.run("return document.getElementById('slider_' + arguments[0]).max", name))

    def move(self, name, index):
        self.run("const s = document.getElementById('slider_' + arguments[0]); s.value = arguments[1];"
                 "s.dispatchEvent(new Event('input', {bubbles: true}))", name, index)

    def moves(self, names, combinations):
        """The picture's file and caption after the sliders were moved to each combination of indices, in one call."""
        return self.run("return arguments[1].map(indices => { arguments[0].forEach((name, n) => {"
                        "const s = document.getElementById('slider_' + name);"
                        "if (+s.value !== indices[n]) { s.value = indices[n];"
                        "s.dispatchEvent(new Event('input', {bubbles: true})); } });"
                        "return [decodeURIComponent(document.getElementById('picture0').src.replace(/.*\\//, '')),"
                        "document.getElementById('caption0').innerText]; })", names, combinations)

    def key(self, key, on=None):
        self.run("(arguments[0] ? document.getElementById(arguments[0]) : document.activeElement)"
                 "[arguments[0] ? 'focus' : 'blur']()", on)
        ActionChains(self.driver).send_keys(key).perform()

    def hurry(self):
        """Lets the page look for new pictures ten times as often, until it is opened again."""
        self.run("const wait = window.setTimeout; window.setTimeout = (f, delay) => wait(f, delay / 10)")

    def message(self):
        return self.at("message").text

    def shot(self, name):
        self.driver.save_screenshot(str(folder / name))


def table(database):
    with open(folder / database / "data.csv", newline="") as file:
        return list(csv.DictReader(file))


def sliders_show_every_picture(page):
    page.open()
    rows = table("run.cdb")
    assert page.at("title").text == "run.cdb", page.at("title").text
    names = page.sliders()
    assert names == ["time", "phi", "theta", "isovalue"], names  # cycle goes with time, and there is one field
    values = {n: sorted({float(r[n]) for r in rows}) for n in names}
    count = 0
    combinations = list(itertools.product(*(range(len(values[n])) for n in names)))
    for indices, (file, caption) in zip(combinations, page.moves(names, combinations), strict=True):
        row, = (r for r in rows if all(float(r[n]) == values[n][i] for n, i in zip(names, indices)))
        assert file == row["FILE"], (file, row)
        assert row["FILE"].startswith(NAME) and f"time {row['time']}, phi {row['phi']}" in caption, caption
        count += 1
    assert count == len(rows), (count, len(rows))
    wait("the last is loaded", lambda: page.is_shown(0))
    assert page.run("return document.getElementById('picture0').naturalWidth") == 160
    page.shot("one_run.png")


def keys_move_sliders(page):
    page.open()
    page.key(Keys.ARROW_RIGHT)
    assert page.value("time") == 1 and page.value("phi") == 0
    page.key(Keys.ARROW_LEFT)
    page.key(Keys.ARROW_LEFT)  # stays at the first
    assert page.value("time") == 0
    page.key(Keys.END)
    assert page.value("time") == page.last("time")
    page.key(Keys.HOME)
    page.key(Keys.ARROW_UP)
    assert page.value("time") == 0 and page.value("phi") == 1
    page.key(Keys.ARROW_DOWN)
    assert page.value("phi") == 0
    page.key(Keys.ARROW_RIGHT, on="slider_theta")
    assert page.value("theta") == 1 and page.value("time") == 0 and "theta 40" in page.caption(), page.caption()
    label = page.run("return document.getElementById('slider_theta').labels[0].textContent")
    assert label == "theta" and page.at("slider_theta").get_attribute("aria-valuetext") == "theta 40"
    page.at("with").send_keys("a b")  # keys of a text are the text's
    assert page.at("with").get_attribute("value") == "a b" and page.at("play").text == "Play"


def space_plays_over_time(page):
    page.open()
    page.at("speed").send_keys("25")
    page.move("isovalue", 1)
    page.key(Keys.SPACE)
    assert page.at("play").text == "Stop"
    seen = []

    def has_gone_round():
        if not seen or seen[-1] != page.value("time"):
            seen.append(page.value("time"))
        return seen.count(0) >= 2 and set(seen) == set(range(page.last("time") + 1))

    wait("all steps were shown, and the first again", has_gone_round)
    page.key(Keys.SPACE)
    assert page.at("play").text == "Play" and page.value("isovalue") == 1
    stopped = page.value("time")
    time.sleep(0.3)
    assert page.value("time") == stopped
    page.at("play").click()
    wait("it plays on by its button", lambda: page.value("time") != stopped)
    page.at("play").click()


def two_runs_stand_side_by_side(page):
    page.open()
    assert not page.at("picture1").is_displayed()
    page.at("with").send_keys("../other.cdb", Keys.ENTER)
    wait("the second run is shown", lambda: page.is_shown(0) and page.is_shown(1))
    left, right = page.at("picture0").rect, page.at("picture1").rect
    assert left["x"] + left["width"] <= right["x"] and abs(left["y"] - right["y"]) < 1, (left, right)
    assert page.at("title").text == "run.cdb and other.cdb"
    assert page.caption(1).startswith("other.cdb: cycle 0"), page.caption(1)
    rows = table("other.cdb")
    page.move("phi", page.last("phi"))  # the other has views at 0 and 180 degrees alone
    row, = (r for r in rows if (r["cycle"], r["phi"], r["theta"], r["isovalue"]) == ("0", "180", "0", "0.2"))
    assert page.file(1) == row["FILE"] and "nearest" in page.caption(1) and "nearest" not in page.caption(0)
    page.shot("two_runs.png")
    page.at("remove").click()
    wait("one run is left", lambda: not page.at("picture1").is_displayed())
    page.open("?with=../other.cdb/index.html")
    wait("both by the page's address", lambda: page.is_shown(0) and page.is_shown(1))


def what_is_missing_is_reported(page):
    page.open("?with=../none.cdb")
    wait("the message", lambda: "no table at" in page.message() and "none.cdb/data.js" in page.message())
    assert page.is_shown(0) and not page.at("picture1").is_displayed()
    page.open("?with=../100%.cdb")
    wait("the message", lambda: "no table at" in page.message())
    page.open("?with=https://example.org/other.cdb")
    wait("the message", lambda: "same disk" in page.message())
    assert page.is_shown(0)
    victim = folder / "run.cdb" / table("run.cdb")[1]["FILE"]
    victim.rename(folder / "victim.png")
    page.open()
    page.move("phi", 1)
    wait("the message", lambda: "cannot be read" in page.message())
    (folder / "victim.png").rename(victim)


def runs_of_one_name_are_distinguished(page):
    (folder / "later").mkdir()
    shutil.copytree(folder / "other.cdb", folder / "later" / "run.cdb")
    page.open("?with=../later/run.cdb")
    wait("both are shown", lambda: page.is_shown(1))
    names = page.caption(0).split(":")[0], page.caption(1).split(":")[0]
    assert names == (f"{folder.name}/run.cdb", "later/run.cdb"), names


def new_pictures_are_found(page):
    page.open()
    page.move("phi", 2)
    steps = page.last("time")
    draw("run.cdb", every=1, views=3, values=[0.2, 0.5])
    page.at("again").click()
    wait("there are more steps", lambda: page.last("time") > steps)
    assert page.value("phi") == 2 and page.message() == ""


def replace(path, text):
    """Writes the file as the library does: the page, which reads it at any time, finds all of it."""
    new = path.with_suffix(".new")
    new.write_text(text)
    new.replace(path)


def the_newest_is_followed(page):
    shutil.rmtree(folder / "run.cdb")
    draw("run.cdb", every=4, views=3, values=[0.2, 0.5])  # one step: there is no slider of steps
    page.open()
    assert page.sliders() == ["phi", "theta", "isovalue"], page.sliders()
    page.hurry()
    page.move("phi", 2)
    page.move("isovalue", 1)
    page.at("follow").click()
    draw("run.cdb", every=1, views=3, values=[0.2, 0.5])
    wait("the newest step is shown", lambda: "time" in page.sliders() and page.value("time") == page.last("time") == 3, 6)
    assert (page.value("phi"), page.value("isovalue")) == (2, 1) and page.at("follow").is_selected()
    row = page.caption()
    assert "cycle 3, time 1.5, phi 240, theta 0, isovalue 0.5" in row and "nearest" not in row, row
    last = folder / "run.cdb" / "data.js"  # the last step again, but without the side that is looked at
    whole = last.read_text()
    kept = [line for line in whole.splitlines() if not (line.startswith('"3,') and ",240," in line)]
    replace(last, "\n".join(kept) + "\n")
    wait("the newest of this side is shown", lambda: "cycle 2, time 1, phi 240" in page.caption(), 6)
    page.key(Keys.ARROW_LEFT)
    assert not page.at("follow").is_selected() and page.value("time") == 1
    replace(last, whole)
    time.sleep(0.5)
    assert page.value("time") == 1, "a step that was chosen stays"
    page.open("?follow")
    wait("the newest step is shown", lambda: page.value("time") == 3 and page.at("follow").is_selected())
    page.shot("follow.png")


def contrast(page, selector):
    """Of a text with the page's background, as WCAG 2 defines it."""
    colours = page.run("const of = e => getComputedStyle(e); return [of(document.querySelector(arguments[0])).color,"
                       "of(document.body).backgroundColor]", selector)

    def luminance(text):
        parts = [float(v) / 255 for v in text[text.index("(") + 1:-1].split(",")[:3]]
        parts = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in parts]
        return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]

    low, high = sorted(luminance(c) for c in colours)
    return (high + 0.05) / (low + 0.05), luminance(colours[1])


def light_and_dark_are_readable(page):
    for scheme in ("light", "dark"):
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia",
                                    {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
        page.open("?with=../other.cdb")
        wait("both are shown", lambda: page.is_shown(1))
        for selector in ("h1", "figcaption", "output", "button", "#keys"):
            ratio, background = contrast(page, selector)
            assert ratio >= 4.5, (scheme, selector, ratio)
            assert (background > 0.5) == (scheme == "light"), (scheme, background)
        page.shot(scheme + ".png")


def nothing_comes_from_a_network(page):
    page.open("?with=../other.cdb")
    wait("both are shown", lambda: page.is_shown(1))
    loaded = page.run("return performance.getEntriesByType('resource').map(e => e.name)")
    assert all(name.startswith("file:") for name in loaded), loaded
    sources = page.run("return [...document.querySelectorAll('[src],[href]')].map(e => e.src || e.href)")
    assert sources and all(name.startswith("file:") for name in sources), sources


def no_script_failed(page):
    failed = [entry for entry in page.driver.get_log("browser") if entry["source"] == "javascript"]
    assert not failed, json.dumps(failed, indent=1)


def main():
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    draw("run.cdb", every=2, views=3, values=[0.2, 0.5])
    draw("other.cdb", every=1, views=2, values=[0.2])
    driver = start(folder / "profile", (1200, 900))
    try:
        page = Page(driver)
        for test in (sliders_show_every_picture, keys_move_sliders, space_plays_over_time, two_runs_stand_side_by_side,
                     what_is_missing_is_reported, runs_of_one_name_are_distinguished, light_and_dark_are_readable,
                     new_pictures_are_found, the_newest_is_followed,
                     nothing_comes_from_a_network, no_script_failed):
            test(page)
            print(test.__name__, "is so", flush=True)
    finally:
        driver.quit()
    shutil.rmtree(folder / "profile", ignore_errors=True)


os.environ["OMP_NUM_THREADS"] = "1"
main()
