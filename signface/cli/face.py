"""`signface face`: what a face holds, whether it is fit for the solve, and how to turn it into a `.glb`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

EXAMPLE = (
    "  signface face info\n"
    "  signface face check my_face.glb --layout my_layout.csv\n"
    "  signface face convert shapes/ --neutral-shape neutral -o my_face.glb"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `signface face`."""
    actions = parser.add_subparsers(dest="action", metavar="info|check|convert|list", required=True)
    info = actions.add_parser("info", help="vertices, size, unit, bases")
    check = actions.add_parser("check", help="is the skin clean, and which bases cannot be observed?")
    convert = actions.add_parser("convert", help="write the face as .glb, cleaned, in millimetres")
    actions.add_parser("list", help="the faces that ship")
    for own in (info, check):
        own.add_argument(
            "face", nargs="?", default="default", metavar="FACE", help="a shipped face or a file or folder"
        )
        own.add_argument("--json", action="store_true", help="print JSON, for scripts")
    convert.add_argument("face", metavar="FACE", help="a shipped face, a file or a folder")
    for own in (info, check, convert):
        own.add_argument("--neutral-shape", metavar="NAME", help="the neutral's file, in a folder of .obj files")
    check.add_argument("--layout", help="say as well which bases move none of its markers")
    convert.add_argument("-o", "--output", type=Path, required=True, help="the .glb to write")


def run(arguments: argparse.Namespace) -> int:
    """Do what was asked; `check` returns 2 for a face that is not clean."""
    return {"info": _info, "check": _check, "convert": _convert, "list": _list}[arguments.action](arguments)


def _list(arguments: argparse.Namespace) -> int:
    from signface.files import shipped

    for name, file in shipped("faces", ".glb").items():
        print(f"{name}  {file}")
    return 0


def _info(arguments: argparse.Namespace) -> int:
    from signface.face.reading import read_face

    face = read_face(arguments.face, neutral=arguments.neutral_shape)
    size = np.ptp(face.mesh.vertices, axis=0)
    largest = np.linalg.norm(face.bases, axis=2).max(axis=1)
    if arguments.json:
        content = {
            "name": face.name,
            "vertices": len(face.mesh.vertices),
            "triangles": len(face.mesh.triangles),
            "unit": face.unit,
            "size_mm": [round(float(side), 3) for side in size],
            "bases": {name: round(float(most), 4) for name, most in zip(face.names, largest)},
            "identities": list(face.identity_names),
        }
        print(json.dumps(content, indent=2, ensure_ascii=False))
        return 0
    print(f"{face.name}: {len(face.mesh.vertices)} vertices, {len(face.mesh.triangles)} triangles")
    print(f"  {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm (the file is in {face.unit})")
    print(f"  {face.n_bases} bases, and how far each moves the skin at most:")
    for name, most in zip(face.names, largest):
        print(f"    {name:<24}{most:7.2f} mm")
    if face.identity_names:
        print(f"  {len(face.identity_names)} identity shapes: {', '.join(face.identity_names[:6])} ...")
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from dataclasses import asdict

    from signface.face.checking import check_face
    from signface.face.layout_files import read_layout
    from signface.face.reading import read_face

    face = read_face(arguments.face, neutral=arguments.neutral_shape)
    layout = None if arguments.layout is None else read_layout(arguments.layout, face)
    report = check_face(face, layout)
    if arguments.json:
        print(json.dumps({"face": face.name, "clean": report.clean, **asdict(report)}, indent=2))
        return 0 if report.clean else 2
    print(f"{face.name}: {'clean' if report.clean else 'not clean'}")
    print(f"  duplicate vertices     {report.duplicate_vertices}")
    print(f"  unreferenced vertices  {report.unreferenced_vertices}")
    print(f"  degenerate triangles   {report.degenerate_triangles}")
    print(f"  non-manifold edges     {report.nonmanifold_edges}")
    print(f"  connected skins        {report.components}")
    print(f"  open rims              {report.boundaries}")
    print(f"  bases that move no skin (markers cannot observe them): {', '.join(report.still_on_skin) or 'none'}")
    if layout is not None:
        print(f"  bases that move no marker of {layout.name}: {', '.join(report.still_at_markers) or 'none'}")
    for first, second, cosine in report.alike:
        print(f"  nearly {'the same' if cosine > 0 else 'opposite'}: {first} and {second} (cosine {cosine:.3f})")
    print(f"  condition of the bases {report.condition:.3g}")
    if not report.clean:
        print(f"  mend what can be mended with: signface face convert {arguments.face} -o clean.glb")
    return 0 if report.clean else 2


def _convert(arguments: argparse.Namespace) -> int:
    from signface.face.checking import clean_face
    from signface.face.files.gltf import write_face
    from signface.face.reading import read_face

    face = read_face(arguments.face, neutral=arguments.neutral_shape)
    cleaned, number = clean_face(face)
    write_face(cleaned, arguments.output)
    print(f"{arguments.output}: {len(cleaned.mesh.vertices)} vertices, {cleaned.n_bases} bases, in millimetres")
    gone = len(face.mesh.vertices) - len(cleaned.mesh.vertices)
    if gone or not np.array_equal(number, np.arange(len(number))):
        print(f"{gone} duplicate or loose vertices went: vertex numbers changed, check layouts that name vertices")
    return 0
