"""The required speeds and sizes in memory (bars), and how the measured figures compare with them (claims)."""

from typing import NamedTuple

import page
from performance_results import NONE, Mesh


class Bar(NamedTuple):
    """A requirement: the ratio of our figure to the peer's must be at least limit if is_least, otherwise at most
    limit."""
    name: str
    unit: str
    peer: str
    is_least: bool
    limit: float
    aim: float = None

    @property
    def asked(self):
        return f"{'≥' if self.is_least else '≤'} {self.limit:g}" + (f", aim {self.aim:g}" if self.aim else "")


LEAST, MOST = True, False
TRACES = {
    "isosurface trace": Bar(
        "Isosurface, traced from all cells", "Mrays/s", "Embree tracing extracted triangles", LEAST, 1, 2)}
NEW_VALUES = {
    "isosurface": Bar("One isosurface, new values", "ms", "Embree: extract, build, trace", MOST, 1, 0.5),
    "isosurfaces": Bar("Three isosurfaces, new values", "ms", "Embree: extract, build, trace", MOST, 1, 0.5)}
NEW_MESH = {
    "isosurface": Bar("One isosurface, new mesh", "ms", "VTK: extract, first render", MOST, 1),
    "isosurfaces": Bar("Three isosurfaces, new mesh", "ms", "VTK: extract, first render", MOST, 1)}
SAH_BUILD = Bar("SAH build", "Mcells/s", "Embree MEDIUM, the faster of binary and 8-wide", LEAST, 2)
MORTON_BUILD = Bar("Morton build", "Mcells/s", "Embree LOW", LEAST, 1)
SAH_COST = Bar("Cost of the SAH tree", "tests a ray", "Embree MEDIUM, binary", MOST, 1.05)
REFIT = Bar("Refit of ranges", "Mcells/s", "100 Mcells/s", LEAST, 1)
TREE_SIZE = Bar("Tree with one field", "B/cell", "16 B/cell", MOST, 1, 0.5)
BUILD_PEAK = Bar("Peak of its build", "B/cell", "40 B/cell", MOST, 1)
VOLUMES = {
    "ray cast": Bar("Volume, samples half a cell apart", "ms", "VTK ray cast", LEAST, 10),
    "projected tets": Bar("Volume, samples half a cell apart", "ms", "VTK projected tets", LEAST, 3)}
THESIS = Bar(
    "Volume, samples half a cell apart (an aim)", "Mrays/s", "the thesis's 5.3 and 4.5 on twenty AVX2 cores", LEAST, 1)
LANES_16 = Bar("Isosurface, 16 lanes", "Mrays/s", "8 lanes", LEAST, 1.6)
LANES_8 = Bar("Isosurface, 8 lanes", "Mrays/s", "4 lanes", LEAST, 1.6)
THREADS_2 = Bar("Isosurface, 2 threads", "Mrays/s", "1 thread", LEAST, 1.9)


class Claim(NamedTuple):
    """A measured ratio on one mesh, compared with a bar."""
    bar: Bar
    mesh: Mesh
    figures: str
    ratio: float

    @property
    def holds(self):
        return self.ratio >= self.bar.limit if self.bar.is_least else self.ratio <= self.bar.limit

    @property
    def text(self):
        ratio = write_ratio(self.ratio)
        return f"{ratio if self.holds else f'**{ratio}**'} ({self.figures})"


def write_ratio(x):
    return f"{x:.2f}" if x < 10 else f"{x:.1f}"


def figures(*numbers):
    return " / ".join(map(page.write_number, numbers))


def claim(bar, mesh, ours, theirs, work=None):
    """Return [claim] of two times or costs, or [] if one is missing. If work is given, the figures are speeds."""
    if not ours or not theirs:
        return []
    shown = figures(work / ours, work / theirs) if work else figures(ours, theirs)
    return [Claim(bar, mesh, shown, theirs / ours if bar.is_least else ours / theirs)]


def claim_measure(bar, mesh, measure, asked):
    """Do the same as claim() for a measure and the required figure."""
    ours = mesh.median(measure)
    return [Claim(bar, mesh, figures(ours), ours / asked)] if ours else []


def claim_traces(mesh):
    rays, embree = 1000 * (mesh.median("rays") or 0), mesh.embree_trace()
    return [c for measure, bar in TRACES.items() for c in claim(bar, mesh, mesh.median(measure), embree, rays)]


def claim_steps(mesh):
    claims = []
    for picture, bar in NEW_VALUES.items():
        claims += claim(bar, mesh, mesh.median(f"{picture} new values"),
                        mesh.least(f"{picture} embree route low", f"{picture} embree route medium"))
    for picture, bar in NEW_MESH.items():
        claims += claim(bar, mesh, mesh.median(f"{picture} new mesh"), mesh.median(f"{picture} vtk route"))
    return claims


def claim_builds(mesh):
    work = mesh.cells / 1000
    medium = mesh.least("embree cells medium", "embree cells medium wide")
    return (claim(SAH_BUILD, mesh, mesh.median("build sah"), medium, work)
            + claim(MORTON_BUILD, mesh, mesh.median("build morton"), mesh.median("embree cells low"), work)
            + claim(SAH_COST, mesh, mesh.median("build sah cost"), mesh.median("embree cells medium cost")))


def claim_volumes(mesh):
    ours = mesh.median("volume samples frame")
    return [c for peer, bar in VOLUMES.items() for c in claim(bar, mesh, ours, mesh.median(f"volume vtk {peer} frame"))]


def claim_scaling(bar, better, worse):
    """Return [claim] that compares the first mesh of `better` with the same mesh of `worse`, or [] if one is
    missing."""
    if not better.meshes:
        return []
    mesh = better.meshes[0]
    ours, theirs = mesh.median("isosurface"), worse.find(mesh.kind, mesh.n).median("isosurface")
    return [Claim(bar, mesh, figures(ours, theirs), ours / theirs)] if ours and theirs else []


def claim_scalings(results, threads):
    sixteen, eight, four = (results[f"scaling {isa} {threads}"] for isa in ("avx512", "avx2", "sse4.2"))
    claims = claim_scaling(LANES_16, sixteen, eight) + claim_scaling(LANES_8, eight, four)
    return claims + (claim_scaling(THREADS_2, sixteen, results["scaling avx512 1"]) if threads == 2 else [])


def all_claims(results):
    claims = []
    for mesh in results["peers"].meshes:
        claims += claim_traces(mesh) if mesh.kind == "tets" else []
    for mesh in results["steps"].meshes:
        claims += claim_steps(mesh)
    for mesh in results["peers"].meshes:
        claims += claim_builds(mesh)
    render = results["render"]
    claims += claim_measure(REFIT, render.find("tets", 126), "refit ranges", 100)
    for mesh in render.meshes:
        if mesh.kind == "tets":
            claims += claim_measure(TREE_SIZE, mesh, "tree size", 16)
            claims += claim_measure(BUILD_PEAK, mesh, "build peak", 40)
    for mesh in results["volumes"].meshes:
        claims += claim_volumes(mesh)
    for n, speed in ((55, 5.3), (126, 4.5)):
        claims += claim_measure(THESIS, render.find("tets", n), "volume", speed)
    return claims + claim_scalings(results, results.most_threads())


class Standing:
    """All claims, also as a table with a row for each bar and a column for each mesh."""

    def __init__(self, claims):
        self.claims = claims
        self.missed = [claim for claim in claims if not claim.holds]
        self.meshes = list(dict.fromkeys(str(claim.mesh) for claim in claims))
        self.rows = {}
        for claim in claims:
            self.rows.setdefault(claim.bar, {})[str(claim.mesh)] = claim

    def span(self, words):
        """Return the smallest and the largest ratio of the claims whose bar's name or peer contains `words`."""
        return span(claim.ratio for claim in self.claims if words in claim.bar.name or words in claim.bar.peer)


def span(ratios):
    texts = [write_ratio(ratio) for ratio in sorted(ratios)]
    return " to ".join(dict.fromkeys([texts[0], texts[-1]])) if texts else NONE


def span_of_speeds(meshes, ours, theirs):
    """Return the range of the factors by which ours is faster than theirs, on meshes with both times."""
    return span(mesh.median(theirs) / mesh.median(ours) for mesh in meshes if mesh.has(ours) and mesh.has(theirs))
