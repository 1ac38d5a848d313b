"""examples/openfoam on 2 and on 4 ranks: the same pictures; the tank is where its motion puts it, and the water is as
much as OpenFOAM says, and where it was before."""

import csv
import math
import os
import re
import shutil
import subprocess
import sys

import numpy
import OpenImageIO

examples, folder, *flags = sys.argv[1:]  # flags: what libinsitu is compiled with
RANKS = 2, 4


def run(case, ranks):
    place = os.path.join(folder, f"{case}{ranks}")
    shutil.rmtree(place, ignore_errors=True)
    paths = os.path.join(folder, "built") + ":" + os.environ.get("LD_LIBRARY_PATH", "")
    subprocess.run([os.path.join(examples, "run"), case, str(ranks), place], check=True, timeout=1800,
                   env={**os.environ, "LD_LIBRARY_PATH": paths})
    with open(os.path.join(place, "log.interFoam")) as file:
        log = file.read()
    assert "FOAM Warning" not in log, f"{case} on {ranks} ranks: {log[log.index('FOAM Warning'):][:400]}"
    return log


def pixels(case, ranks, name):
    path = os.path.join(folder, f"{case}{ranks}", f"{name}.png")
    picture = OpenImageIO.ImageInput.open(path)
    assert picture, f"{path}: there is no such picture"
    return picture.read_image("uint8")[:, :, :3].astype(int)


def compare(case, name, share):
    """What differs is where the solvers' own answers do, by what they stop at: a pixel at the edges of the water."""
    two, four = (pixels(case, ranks, name) for ranks in RANKS)
    differing = (abs(two - four).max(axis=2) > 64).mean()
    print(f"{case} {name}: {differing:.5f} of the pixels differ between 2 and 4 ranks")
    assert differing <= share, "the pictures of 2 and 4 ranks differ"


def compare_water(case, ranks, log):
    """The mean of alpha.water, by cells' volumes, against the solver's own at the end of each step: 6 digits, off by up
    to 0.5e-6 of 0.34."""
    with open(os.path.join(folder, f"{case}{ranks}", "water.csv")) as file:
        means = [float(row["mean"]) for row in csv.DictReader(file)]
    steps = re.split(r"^Time = .*$", log, flags=re.M)[1:]
    expected = [float(re.findall(r"Phase-1 volume fraction = (\S+)", step)[-1]) for step in steps]
    worst = max(abs(a / b - 1) for a, b in zip(means, expected))
    print(f"{case} on {ranks} ranks: {len(means)} steps, the water is OpenFOAM's to {worst:.1e}")
    assert len(means) == len(expected) and worst <= 2e-6, "the share of water is not OpenFOAM's"
    return means


# ---- the tank -------------------------------------------------------------------------------------------------------

WALLS = [(-15, -10), (-20, -5), (-20, 10), (-10, 20), (10, 20), (20, 10), (20, -5), (15, -10)]  # y and z, as it stands
HEIGHT = 40  # of the picture, about z = 2


def motion(time):
    """Roll, sway and heave: OpenFOAM's solidBodyMotionFunction SDA by the case's dynamicMeshDict."""
    scale = math.sqrt(50)
    period, natural, step, growth = 13.93 / scale, 11.93 / scale, 0.059 / scale, -0.001 / scale
    rate, now = growth / step, period + growth * time / step
    speed, phase = 2 * math.pi / now, 2 * math.pi * (period / now - 1 + math.log(now / period)) / rate
    roll = max(0.22654 * math.exp(-(now - natural) ** 2 / 4), 0.10472)
    sway, heave = phase + math.pi, phase + math.pi / 2
    return (roll * math.sin(speed * time + phase), 2.34 / 50 * (math.sin(speed * time + sway) - math.sin(sway)),
            3.79 / 50 * (math.sin(speed * time + heave) - math.sin(heave)))


def is_in_tank(time, shape):
    roll, sway, heave = motion(time)
    size = HEIGHT / shape[0]
    y = (numpy.arange(shape[1]) + 0.5 - shape[1] / 2) * size - sway
    z = 2 - (numpy.arange(shape[0]) + 0.5 - shape[0] / 2)[:, None] * size - heave
    y, z = math.cos(roll) * y + math.sin(roll) * z, math.cos(roll) * z - math.sin(roll) * y  # before it rolled
    inside = numpy.ones(shape[:2], bool)
    for (y0, z0), (y1, z1) in zip(WALLS, WALLS[1:] + WALLS[:1]):
        inside &= (y1 - y0) * (z - z0) <= (z1 - z0) * (y - y0)
    return inside


def check_tank(ranks):
    means = compare_water("tank", ranks, run("tank", ranks))
    for time in 1, 2, 3, 4:
        picture = pixels("tank", ranks, f"side_{time}")
        is_covered = abs(picture - picture[0, 0]).sum(axis=2) > 30
        beside = (is_covered != is_in_tank(time, picture.shape)).sum()
        # All sections along the tank are alike, and the colour's red goes from 1 in air to 0 in water.
        share = (1 - picture[:, :, 0] / 255)[is_covered].mean()
        print(f"tank on {ranks} ranks, {time} s: {beside} pixels beside the walls, {share:.5f} of it water")
        # A pixel's centre on a wall may count on either side; 12 pixels a metre, 115 m of walls: 1380 pixels are there.
        assert beside <= 14, "the tank is not where its motion puts it"
        # The means at vertices smear the surface evenly on both sides, but for its curvature; codes of 8 bits round.
        assert abs(share - means[-1]) <= 1e-3, "the water in the picture is not as much as the cells have"


# ---- the dam --------------------------------------------------------------------------------------------------------

# The water's reach along the floor, and its height in the plane x = 0.3. The first row is what setFields has put there;
# the others are what these cases gave when the pictures were looked at. A refined cell is 1 / 64.
DAM = {"0.0": (0.1875, 0.75), "0.1": (0.2833, 0.7042), "0.2": (0.4875, 0.5646), "0.3": (0.75, 0.3583)}


def check_dam(ranks):
    log = run("dam", ranks)
    compare_water("dam", ranks, log)
    cells = [int(count) for count in re.findall(r"Refined from \d+ to (\d+) cells", log)]
    assert cells and cells[-1] > 1.2 * 32256, "the mesh was not refined"
    for time, (front, height) in DAM.items():
        is_water = pixels("dam", ranks, f"front_{time}")[:, :, 0] < 128
        columns, rows = (numpy.flatnonzero(is_water.any(axis=axis)) for axis in (0, 1))
        seen = (columns.max() + 1) / 480, 1 - rows.min() / 480
        print(f"dam on {ranks} ranks, {time} s: front {seen[0]:.4f}, height {seen[1]:.4f}")
        assert abs(seen[0] - front) <= 1 / 64 and abs(seen[1] - height) <= 1 / 64, f"expected {front}, {height}"


subprocess.run([os.path.join(examples, "build"), os.path.join(folder, "built"), *flags], check=True, timeout=900)
for ranks in RANKS:
    check_tank(ranks)
    check_dam(ranks)
for time in 1, 2, 3, 4:
    compare("tank", f"tank_{time}", 0.01)
    compare("tank", f"side_{time}", 0.01)
for time in DAM:
    for name in "water", "cells", "front":
        compare("dam", f"{name}_{time}", 0.002)
