"""The results of bench_accuracy: for each mesh and size of picture, the errors and times of each setting."""

import page

VOLUME, SURFACE = "volume", "isosurface"


class Setting:
    """One method at one setting: its errors and its times in milliseconds."""

    def __init__(self, row):
        self.layer, self.method, self.value, self.status = map(row.text, ("layer", "method", "setting", "status"))
        self.first, self.frame, self.rms, self.most, self.residual = map(
            row.number, ("first", "frame", "rms", "max", "residual"))
        self.wrong, self.pixels = row.count("wrong"), row.count("pixels")
        self.errors = tuple(map(row.text, ("rms", "max", "wrong", "residual")))
        self.is_volume = self.layer == VOLUME
        self.is_peer = self.method.startswith("VTK")
        self.is_drawn = self.status == "ok"
        # Set if another row has the same picture.
        self.is_repeated = self.method == "sample group" or (self.method == "frames" and self.value == "1")


class Mesh:
    """All settings of a mesh at one size of picture."""

    def __init__(self, name, row, is_usual_size):
        self.mesh, self.size, self.cells, self.build = name, row.count("size"), row.count("cells"), row.number("build")
        self.name = name if is_usual_size else f"{name}, {self.size} x {self.size}"
        self.is_usual_size = is_usual_size
        self.settings = []

    def __str__(self):
        return self.name

    @property
    def volumes(self):
        return [setting for setting in self.settings if setting.is_volume]

    def of(self, method):
        return [setting for setting in self.settings if setting.method == method]

    @property
    def is_linear(self):
        """True if the field is linear in all cells: each cell is then one segment for any step, so there is one
        setting."""
        return len(self.of("segments")) == 1

    def label(self, setting):
        """Return the name of the setting in tables."""
        value = setting.value
        if setting.method == "samples":
            return f"samples, step of {cell_count(value)}"
        if setting.method == "segments":
            return "segments" if self.is_linear else f"segments, parts of {cell_count(value)}"
        if setting.method == "frames":
            return f"samples a cell apart, {value} {'frame' if value == '1' else 'frames'}"
        if setting.method == "sample group":
            return f"samples, step of 1/4 cell, groups of {value}"
        if setting.method == "max_error":
            return f"max_error: {value}"
        return setting.method if value == "-" else f"{setting.method}, {value}"

    def cheapest(self, rms, most):
        """Return our fastest setting of volumes whose errors are at most rms and most, or None if there is none."""
        near = [setting for setting in self.volumes if setting.is_drawn and not setting.is_peer
                and not setting.is_repeated and setting.rms <= rms and setting.most <= most]
        return min(near, key=lambda setting: setting.frame, default=None)


def cell_count(value):
    return f"{value} {'cells' if value in ('2', '4') else 'cell'}"


class Results:
    """The meshes of the newest file in the order of their rows; the size of the first row is the usual one."""

    def __init__(self, paths):
        if not paths:
            raise page.PageError("no CSV file is named: is there one in bench/results?")
        path, rows, comments = page.read_newest_first(paths)[0]
        rows = [row for row in rows if row.text("program") == "bench_accuracy"]
        if not rows:
            raise page.PageError(f"{path}: there is no row of bench_accuracy")
        self.isa, self.threads = rows[0].text("isa"), rows[0].count("threads")
        self.size = rows[0].count("size")
        self.notes = [comment.removeprefix("note: ") for comment in comments if comment.startswith("note: ")]
        self.machine = "; ".join(comment for comment in comments if not comment.startswith("note: "))
        meshes = {}
        for row in rows:
            key = row.text("mesh"), row.count("size")
            if key not in meshes:
                meshes[key] = Mesh(key[0], row, key[1] == self.size)
            meshes[key].settings.append(Setting(row))
        self.meshes = list(meshes.values())

    def figures(self):
        """Return the meshes of each figure by the figure's name: meshes with the finest setting, at most four a
        figure."""
        volumes = [mesh for mesh in self.meshes if any(setting.value == "1/16" for setting in mesh.of("samples"))]
        surfaces = [mesh for mesh in self.meshes if any(setting.value == "1/8" for setting in mesh.of("segments"))]
        figures = {"accuracy_lattices": volumes[:4], "accuracy_grids": volumes[4:8],
                   "accuracy_isosurfaces": surfaces[:4]}
        return {name: meshes for name, meshes in figures.items() if meshes}
