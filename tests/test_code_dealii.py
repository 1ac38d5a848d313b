"""examples/dealii, built against an installed library: on 2 and on 4 ranks spheres of the size and at the
place that the solution has, and the same pictures; in Q2 too, of which the corners are drawn."""

import math
import os
import re
import subprocess
import sys

import numpy
import OpenImageIO

cmake, build, source, mpirun, folder = sys.argv[1:]
WIDTH, CIRCLE, TURN, STEP = 0.25, 0.45, math.pi, 0.0125  # the program's
PIXEL = 2.1 / 480  # the picture's
RADIUS = WIDTH * math.sqrt(math.log(2))
SLOPE = RADIUS / WIDTH**2  # of u where it is 1/2: 2 r u / w^2
SHARPEST = 2 / WIDTH**2  # the second derivative of u at its centre, the largest anywhere
FINEST = 2 / (1 + math.sqrt(3)) / 2**4  # side of Q2's smallest cells: the ball's inner cube, refined four times


def make():
    prefix, program = os.path.join(folder, "prefix"), os.path.join(folder, "program")
    log = os.path.join(folder, "build.log")
    with open(log, "w") as out:
        for command in ([cmake, "--install", build, "--prefix", prefix],
                        [cmake, "-S", source, "-B", program, f"-DCMAKE_PREFIX_PATH={prefix}"],
                        [cmake, "--build", program]):
            if subprocess.run(command, stdout=out, stderr=out).returncode != 0:
                sys.exit(open(log).read()[-4000:])
    return os.path.join(program, "heat")


def run(name, ranks, degree):
    """The folder of the pictures, and the solution's largest error at each of their cycles."""
    place = os.path.join(folder, name)
    os.makedirs(place, exist_ok=True)
    command = [mpirun, "-n", str(ranks), program, os.path.join(source, "heat.yaml"), str(degree)]
    done = subprocess.run(command, cwd=place, check=True, timeout=600, capture_output=True, text=True)
    print(done.stdout, done.stderr, sep="")
    assert not done.stderr, "the program has complaints"
    return place, {int(cycle): float(error) for cycle, error in re.findall(r"(\d+): .*error (\S+)", done.stdout)}


def pixels(place, file):
    picture = OpenImageIO.ImageInput.open(os.path.join(place, file))
    assert picture, f"{place}/{file}: there is no such picture"
    return picture.read_image("uint8").astype(int)


def check_sphere(place, cycle, error):
    """u = 1/2 is off by no more than the error of u over its slope; the count of its pixels by less than half of one
    along its rim. A rim that is off by d on one side and by -d on the other moves the centre by 4 d / pi."""
    blue = pixels(place, f"sphere_{cycle:03}.png")
    y, x = numpy.nonzero(blue[:, :, 2] - blue[:, :, 0] > 25)
    radius = math.sqrt(len(x) / math.pi) * PIXEL
    centre = (x.mean() + 0.5) * PIXEL - 1.05, 1.05 - (y.mean() + 0.5) * PIXEL
    angle = TURN * cycle * STEP
    shift = math.dist(centre, (CIRCLE * math.cos(angle), CIRCLE * math.sin(angle)))
    allowed = error / SLOPE + 0.5 * PIXEL
    print(f"{os.path.basename(place)}, {cycle}: radius {radius:.4f}, expected {RADIUS:.4f}; off its place by {shift:.4f}; "
          f"{allowed:.4f} allowed")
    assert abs(radius - RADIUS) < allowed, "the sphere is not of the solution's size"
    assert shift < 4 / math.pi * allowed, "the sphere is not where the solution has it"


os.makedirs(folder, exist_ok=True)
program = make()
(two, errors), (four, errors_of_four) = run("np2", 2, 1), run("np4", 4, 1)
for cycle in range(0, 41, 10):
    check_sphere(two, cycle, errors[cycle])
    check_sphere(four, cycle, errors_of_four[cycle])
    # p4est coarsens no cells whose siblings are on several ranks: some cells differ, none of them where the heat is.
    # The solver stops at 1e-10: a pixel may change where the surface's rim is.
    differing = (pixels(two, f"sphere_{cycle:03}.png") != pixels(four, f"sphere_{cycle:03}.png")).any(axis=2).sum()
    assert differing <= 20, f"cycle {cycle}: {differing} pixels of the sphere differ between 2 and 4 ranks"
    heat = [pixels(place, f"mesh_{cycle:03}.png") for place in (two, four)]
    assert (heat[0][:, :, 1] > 180).sum() > 1000, f"cycle {cycle}: the mesh shows no heat"
    # A family of eight that is coarse on 2 ranks alone shows its edges: a part of a thousand of all cells.
    differing = (abs(heat[0] - heat[1]).max(axis=2) > 8).mean()
    assert differing < 0.01, f"cycle {cycle}: {100 * differing:.1f} % of the pixels of the mesh differ"

# With Q2 the corners are right to the error told; between them a trilinear cell misses h^2 / 8 of each second derivative.
place, errors = run("q2", 2, 2)
for cycle in range(0, 41, 10):
    check_sphere(place, cycle, errors[cycle] + 3 * FINEST**2 / 8 * SHARPEST)
