"""glTF faces: a mesh whose morph targets are the bases.

- `write_face`: a `FaceModel` as one compact `.glb`, sparse morph targets, names in `extras.targetNames`.
- `read_gltf`: the mesh with morph targets of any `.glb` or `.gltf`.

Both go through pygltflib for the container; the numbers of an accessor (dense, sparse, strided, quantised) are
decoded here, after the glTF 2.0 specification, section 3.6.2 (accessors).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from signface.content import Content
from signface.errors import SignfaceError
from signface.face.model import FaceModel
from signface.files import whole_file

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_FLOAT, _UINT32, _UINT16 = 5126, 5125, 5123
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963


@dataclass(frozen=True, eq=False)
class RawFace(Content):
    """What a file of shapes holds, before its unit is known.

    Parameters
    ----------
    vertices : (V, 3) float64 array
        Neutral positions, in the file's unit.
    triangles : (T, 3) int64 array
    bases : (N, V, 3) float64 array
        Differences from the neutral.
    names : (N,) tuple of str
    unit : str, optional
        The unit, where the file names it (`m`, `cm` or `mm`).
    identities : (K, V, 3) float64 array, optional
        Shapes of other heads, as differences from the neutral.
    identity_names : (K,) tuple of str
    colours : (V, 3) float64 array, optional
        Colour of each vertex, 0 to 1.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    bases: np.ndarray
    names: tuple[str, ...]
    unit: str | None = None
    identities: np.ndarray | None = None
    identity_names: tuple[str, ...] = ()
    colours: np.ndarray | None = None


class _Blob:
    """A growing binary buffer with its views."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[Any] = []

    def add(self, array: np.ndarray, target: int | None = None) -> int:
        from pygltflib import BufferView

        self.data += b"\0" * (-len(self.data) % 4)
        content = np.ascontiguousarray(array).tobytes()
        self.views.append(BufferView(buffer=0, byteOffset=len(self.data), byteLength=len(content), target=target))
        self.data += content
        return len(self.views) - 1


def write_face(face: FaceModel, path: str | PathLike[str]) -> None:
    """Write a face as `.glb`: one mesh of one primitive in millimetres, one sparse morph target for each base.

    Positions are float32 (errors below 1e-4 mm on a head). The mesh's `extras` hold `targetNames` and
    `unit: "mm"`; its node scales by 0.001, so that other programs see glTF's metres. The bytes depend on the face
    alone.

    Raises
    ------
    SignfaceError
        The ending is not `.glb`, or the file cannot be written.
    """
    import pygltflib as gl

    if Path(path).suffix.lower() != ".glb":
        raise SignfaceError("a face is written as .glb", file=path, hint="choose a name that ends in .glb")
    blob = _Blob()
    count = len(face.mesh.vertices)
    accessors = []

    def bounds(values: np.ndarray) -> dict[str, list[float]]:
        return {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}

    positions = face.mesh.vertices.astype("<f4")
    view = blob.add(positions, _ARRAY_BUFFER)
    accessors.append(gl.Accessor(bufferView=view, componentType=_FLOAT, count=count, type="VEC3", **bounds(positions)))
    kind = _UINT16 if count < 65535 else _UINT32
    view = blob.add(face.mesh.triangles.astype(_COMPONENTS[kind]).ravel(), _ELEMENT_ARRAY_BUFFER)
    accessors.append(
        gl.Accessor(bufferView=view, componentType=kind, count=3 * len(face.mesh.triangles), type="SCALAR")
    )
    targets = []
    for base in face.bases:
        values = base.astype("<f4")
        moved = np.flatnonzero(values.any(axis=1))
        accessor = gl.Accessor(componentType=_FLOAT, count=count, type="VEC3", **bounds(values))
        if len(moved):  # the specification wants at least one element in a sparse accessor
            where = blob.add(moved.astype(_COMPONENTS[kind]))
            accessor.sparse = gl.Sparse(
                count=len(moved),
                indices=gl.AccessorSparseIndices(bufferView=where, componentType=kind),
                values=gl.AccessorSparseValues(bufferView=blob.add(values[moved])),
            )
        targets.append(gl.Attributes(POSITION=len(accessors)))
        accessors.append(accessor)
    attributes = gl.Attributes(POSITION=0)
    colour = [0.80, 0.62, 0.52, 1.0]
    if face.colours is not None:
        steps = np.column_stack([np.round(face.colours * 255), np.full(count, 255)]).astype("u1")
        view = blob.add(steps, _ARRAY_BUFFER)
        attributes.COLOR_0 = len(accessors)
        accessors.append(gl.Accessor(bufferView=view, componentType=5121, normalized=True, count=count, type="VEC4"))
        colour = [1.0, 1.0, 1.0, 1.0]
    mesh = gl.Mesh(
        name=face.name,
        primitives=[gl.Primitive(attributes=attributes, indices=1, material=0, targets=targets)],
        weights=[0.0] * face.n_bases,
        extras={"targetNames": list(face.names), "unit": "mm"},
    )
    surface = gl.PbrMetallicRoughness(baseColorFactor=colour, metallicFactor=0.0, roughnessFactor=0.7)
    gltf = gl.GLTF2(
        asset=gl.Asset(version="2.0", generator="signface", extras={"history": list(face.history)}),
        scene=0,
        scenes=[gl.Scene(nodes=[0])],
        nodes=[gl.Node(mesh=0, name=face.name, scale=[0.001, 0.001, 0.001])],
        meshes=[mesh],
        materials=[gl.Material(name="skin", pbrMetallicRoughness=surface)],
        accessors=accessors,
        bufferViews=blob.views,
        buffers=[gl.Buffer(byteLength=len(blob.data))],
    )
    gltf.set_binary_blob(bytes(blob.data))
    with whole_file(path) as temporary:
        temporary.write_bytes(b"".join(gltf.save_to_bytes()))


def read_gltf(path: str | PathLike[str]) -> RawFace:
    """Read the mesh with morph targets of a `.glb` or `.gltf` (the one with the most targets, then vertices).

    Where the mesh's `extras` name a `unit`, its numbers are taken as they are; elsewhere the node's transform is
    applied and the numbers are glTF's (metres by the specification, which many programs ignore).

    Raises
    ------
    SignfaceError
        The file is no glTF, is damaged, or has no mesh with morph targets.
    """
    from pygltflib import GLTF2

    file = Path(path)
    hint = "export the face as .glb with morph targets (shape keys)"
    try:
        if file.stat().st_size == 0:
            raise SignfaceError("is empty", file=file, hint=hint)
        content = file.read_bytes()
        gltf = GLTF2.load_from_bytes(content) if content[:4] == b"glTF" else GLTF2.load_json(str(file))
        if gltf is None:
            raise SignfaceError("is not a glTF file", file=file, hint=hint)
        gltf._path = file.parent
        return _face_of(gltf, file)
    except SignfaceError:
        raise
    except (OSError, ValueError, LookupError, TypeError, AttributeError, struct.error, RecursionError) as error:
        raise SignfaceError("cannot be read as glTF (foreign, damaged or cut short)", file=file, hint=hint) from error


def _face_of(gltf: Any, file: Path) -> RawFace:
    def size(mesh: Any) -> tuple[int, int]:
        targets = max((len(primitive.targets or ()) for primitive in mesh.primitives), default=0)
        return targets, sum(gltf.accessors[p.attributes.POSITION].count for p in mesh.primitives)

    meshes = [index for index, mesh in enumerate(gltf.meshes) if size(mesh)[0] > 0]
    if not meshes:
        raise SignfaceError(
            "has no mesh with morph targets", file=file, hint="a face needs one morph target for each base"
        )
    index = max(meshes, key=lambda i: size(gltf.meshes[i]))
    mesh = gltf.meshes[index]
    total, _ = size(mesh)
    vertices, triangles, bases, colours = [], [], [], []
    offset = 0
    for primitive in mesh.primitives:
        if primitive.mode not in (None, 4):
            raise SignfaceError("its mesh is not made of triangles", file=file, hint="triangulate it")
        positions = _accessor(gltf, primitive.attributes.POSITION, file)
        if positions.shape[1:] != (3,):
            raise SignfaceError("its vertex positions are not three-dimensional", file=file)
        if primitive.indices is None:
            corners = np.arange(len(positions))
        else:
            corners = _accessor(gltf, primitive.indices, file).ravel().astype(np.int64)
        if len(corners) % 3 or (len(corners) and corners.max() >= len(positions)):
            raise SignfaceError("its triangles name vertices it does not have", file=file, hint="export it again")
        moved = np.zeros((total, len(positions), 3))
        for number, target in enumerate(primitive.targets or ()):
            accessor = target.get("POSITION") if isinstance(target, dict) else target.POSITION
            if accessor is None:
                continue
            shape = _accessor(gltf, accessor, file)
            if shape.shape != positions.shape:
                raise SignfaceError(
                    f"morph target {number} has {len(shape)} vertices but the mesh has {len(positions)}",
                    file=file,
                    hint="all shapes of a face must share one topology",
                )
            moved[number] = shape
        vertices.append(positions)
        bases.append(moved)
        painted = getattr(primitive.attributes, "COLOR_0", None)
        if painted is not None:
            colours.append(_accessor(gltf, painted, file)[:, :3])
        triangles.append(corners.reshape(-1, 3) + offset)
        offset += len(positions)
    extras = mesh.extras if isinstance(mesh.extras, dict) else {}
    names = extras.get("targetNames") or [f"target{number}" for number in range(total)]
    if len(names) != total:
        raise SignfaceError(f"names {len(names)} morph targets in extras.targetNames but has {total}", file=file)
    unit = extras.get("unit") if extras.get("unit") in ("m", "cm", "mm") else None
    all_vertices, all_bases = np.concatenate(vertices), np.concatenate(bases, axis=1)
    if unit is None:
        transform = _world(gltf, index)
        all_vertices = all_vertices @ transform[:3, :3].T + transform[:3, 3]
        all_bases = all_bases @ transform[:3, :3].T
    return RawFace(
        all_vertices,
        np.concatenate(triangles),
        all_bases,
        tuple(map(str, names)),
        unit,
        colours=np.concatenate(colours) if len(colours) == len(vertices) else None,
    )


def _accessor(gltf: Any, index: int, file: Path) -> np.ndarray:
    """(count, width) float64 values of an accessor."""
    accessor = gltf.accessors[index]
    width = _WIDTHS[accessor.type]
    count = int(accessor.count)
    if count < 0 or count > 50_000_000:
        raise SignfaceError("an accessor claims an absurd size", file=file, hint="export it again")
    if accessor.bufferView is None:
        values = np.zeros((count, width))
    else:
        values = _values(gltf, accessor.bufferView, accessor.byteOffset or 0, accessor.componentType, count, width)
        if accessor.normalized:
            limit = np.iinfo(np.dtype(_COMPONENTS[accessor.componentType])).max
            values = np.maximum(values / limit, -1.0)
    if accessor.sparse is not None:
        sparse = accessor.sparse
        where = _values(
            gltf, sparse.indices.bufferView, sparse.indices.byteOffset or 0, sparse.indices.componentType,
            sparse.count, 1,
        )  # fmt: skip
        new = _values(
            gltf, sparse.values.bufferView, sparse.values.byteOffset or 0, accessor.componentType, sparse.count, width
        )
        values[where.ravel().astype(np.int64)] = new
    return values


def _values(gltf: Any, view_index: int, offset: int, component: int, count: int, width: int) -> np.ndarray:
    view = gltf.bufferViews[view_index]
    buffer = gltf.buffers[view.buffer]
    data = gltf.binary_blob() if buffer.uri is None else gltf.get_data_from_buffer_uri(buffer.uri)
    kind = np.dtype(_COMPONENTS[component])
    stride = view.byteStride or kind.itemsize * width
    start = (view.byteOffset or 0) + offset
    if data is None or start < 0 or count < 0 or start + (count - 1) * stride + kind.itemsize * width > len(data):
        raise ValueError("the buffer is shorter than its accessors say")
    values = np.ndarray((count, width), kind, buffer=data, offset=start, strides=(stride, kind.itemsize))
    return values.astype(np.float64)


def _world(gltf: Any, mesh: int) -> np.ndarray:
    """(4, 4) transform of the first node that shows a mesh, in the scene's frame."""
    parents = {child: number for number, node in enumerate(gltf.nodes) for child in node.children or ()}
    number = next((number for number, node in enumerate(gltf.nodes) if node.mesh == mesh), None)
    transform = np.eye(4)
    seen: set[int] = set()
    while number is not None and number not in seen:
        seen.add(number)
        transform = _local(gltf.nodes[number]) @ transform
        number = parents.get(number)
    return transform


def _local(node: Any) -> np.ndarray:
    if node.matrix:
        return np.array(node.matrix, dtype=np.float64).reshape(4, 4).T  # glTF stores matrices by columns
    from scipy.spatial.transform import Rotation

    local = np.eye(4)
    if node.rotation:
        local[:3, :3] = Rotation.from_quat(node.rotation).as_matrix()
    if node.scale:
        local[:3, :3] = local[:3, :3] * np.array(node.scale, dtype=np.float64)
    if node.translation:
        local[:3, 3] = node.translation
    return local
