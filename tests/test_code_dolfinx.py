"""examples/dolfinx on 2 and on 4 ranks: the same pictures, and spheres of the radius that the theory has."""

import math
import os
import subprocess
import sys

import OpenImageIO

mpirun, python, program, folder = sys.argv[1:]
STEP, RADIUS, PIXELS = 2.5e-4, 0.35, 480  # the program's; the picture is of height 1


def run(ranks):
    place = os.path.join(folder, f"np{ranks}")
    os.makedirs(place, exist_ok=True)
    scene = os.path.splitext(program)[0] + ".yaml"
    subprocess.run([mpirun, "-n", str(ranks), python, program, scene], cwd=place, check=True, timeout=600)
    return place


def pixels(path):
    picture = OpenImageIO.ImageInput.open(path)
    assert picture, f"{path}: there is no such picture"
    return picture.read_image("uint8")


two, four = run(2), run(4)
for cycle in range(0, 61, 20):
    for name in ("sphere", "slope"):
        file = f"{name}_{cycle:03}.png"
        a, b = pixels(os.path.join(two, file)), pixels(os.path.join(four, file))
        # The solver stops at 1e-10, and sums of ranks differ by less: a pixel may change where a surface's edge is.
        differing = (a != b).any(axis=2).sum()
        assert differing <= 20, f"{file}: {differing} pixels differ between 2 and 4 ranks"
    blue = pixels(os.path.join(four, f"sphere_{cycle:03}.png")).astype(int)
    area = (blue[:, :, 2] - blue[:, :, 0] > 25).sum() / PIXELS**2
    drawn, expected = math.sqrt(area / math.pi), math.sqrt(RADIUS**2 - 4 * cycle * STEP)
    print(f"{cycle}: the radius is {drawn:.4f}, by the theory {expected:.4f}")
    # The sharp limit errs by the square of eps over the radius, 0.04 of the way of 0.1 at most, halved on average over
    # the run; a pixel is 0.002.
    assert abs(drawn - expected) < 0.004, "the radius is not the theory's"
