"""`signface study render`: films and sheets of stills, of takes and weights files or of a whole study."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from signface.errors import SignfaceError
from signface.settings.solve import SolveSettings

if TYPE_CHECKING:
    import numpy as np

    from signface.descriptors import Descriptors
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel
    from signface.render.film import Avatar

EXAMPLE = """  signface study render my-study
  signface study render take.c3d --methods LSTS30,LSTS50,LSTS70 -o films
  signface study render take.c3d --methods LSTS30 --video take.mp4 --markers
  signface study render weights.csv --still"""


def add_render_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `render`."""
    from signface.cli.options import add_settings_arguments, add_signer_arguments

    parser.add_argument(
        "sources", nargs="+", type=Path, metavar="STUDY_OR_TAKE", help="a study's folder; or takes and weights files"
    )
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="where to write (default: here)")
    parser.add_argument(
        "--methods",
        default="LSTS30",
        metavar="NAMES",
        help="how takes are solved, joined by commas: LSTS30 is the thin shell with alpha 0.3; or least-squares, ... "
        "(default: %(default)s)",
    )
    parser.add_argument("--together", action="store_true", help="the methods side by side in one film")
    parser.add_argument("--video", type=Path, metavar="FILE", help="the real video, shown beside the face")
    parser.add_argument("--still", action="store_true", help="a sheet of stills, a row for each method, not a film")
    parser.add_argument("--every", type=float, default=1.0, metavar="SECONDS", help="time between stills (default 1)")
    parser.add_argument("--rate", type=float, default=25.0, metavar="HZ", help="pictures a second (default 25)")
    parser.add_argument(
        "--size", type=_size, default=(640, 480), metavar="WxH", help="size of a face (default 640x480)"
    )
    parser.add_argument(
        "--start", type=float, metavar="SECONDS", help="from this time of the take (default: its start)"
    )
    parser.add_argument("--end", type=float, metavar="SECONDS", help="to this time (default: its end)")
    parser.add_argument(
        "--yaw", type=float, default=0.0, metavar="DEGREES", help="90 shows the left profile (default 0)"
    )
    parser.add_argument(
        "--head",
        action=argparse.BooleanOptionalAction,
        help="turn the head as the signer did (default: where that is known; a study says it under [render])",
    )
    parser.add_argument("--markers", action="store_true", help="draw the layout's markers on the skin")
    parser.add_argument("--wireframe", action="store_true", help="draw the edges of the triangles")
    add_settings_arguments(parser, SolveSettings, without=("method", "alpha"))
    add_signer_arguments(parser)


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is no size such as 640x480")
    return int(width), int(height)


def run_render(arguments: argparse.Namespace) -> None:
    """Render a study, or each of the files."""
    if len(arguments.sources) == 1 and (arguments.sources[0] / "study.toml").is_file():
        _render_study(arguments.sources[0], arguments)
        return
    folders = [source for source in arguments.sources if source.is_dir()]
    if folders:
        raise SignfaceError("holds no study.toml", file=folders[0], hint="name takes, weights files or one study")
    if arguments.every <= 0:
        raise SignfaceError("--every must be a positive number of seconds")
    if arguments.video and len(arguments.sources) > 1:
        raise SignfaceError("--video belongs to one take", hint="render one take at a time")
    for source in arguments.sources:
        _render_file(source, arguments)


def _render_study(folder: Path, arguments: argparse.Namespace) -> None:
    from signface.cli.options import settings_from, signer_from
    from signface.progress import progress
    from signface.study.design import read_study
    from signface.study.films.stimuli import make_synthetic_takes, plan_films, render_study

    if arguments.head is not None:
        raise SignfaceError("--head and --no-head are for takes and weights files", hint="a study's [render] says head")
    study = read_study(folder, films=False)

    def make_takes(place: Path, signer: int) -> None:
        make_synthetic_takes(place, signer, show=lambda jobs: progress(jobs, "making synthetic takes"))

    films = plan_films(study, takes_made=make_takes)
    settings, signer = settings_from(arguments, SolveSettings), signer_from(arguments)
    count = render_study(films, settings=settings, signer=signer, show=lambda plans: progress(plans, "rendering films"))
    print(f"{folder}: {count} films; now signface study serve {folder}")


def _render_file(source: Path, arguments: argparse.Namespace) -> None:
    from signface.cli.options import read_face_and_layout, settings_from, signer_from, words
    from signface.face.layout_files import choose_layout
    from signface.render.film import Avatar
    from signface.render.raster import Style
    from signface.study.films.stimuli import parse_method, solve_methods
    from signface.takes.reading import read_recording
    from signface.takes.take import Take

    settings = settings_from(arguments, SolveSettings)
    methods = {name: parse_method(name, settings) for name in words(arguments.methods)}
    face, layout = read_face_and_layout(settings)
    recording = read_recording(source)
    if isinstance(recording, Take):
        layout = layout or choose_layout(recording.labels, face)
        shown = solve_methods(recording, face, layout, methods, signer=signer_from(arguments))
    else:
        _check_bases(recording, face)
        layout = layout or (_default_layout(face) if arguments.markers else None)
        shown = {"": recording}
    avatar = Avatar(
        face,
        size=arguments.size,
        yaw=arguments.yaw,
        style=Style(wireframe=arguments.wireframe),
        layout=layout if arguments.markers else None,
    )
    if arguments.still:
        _write_sheet(source, shown, avatar, arguments)
    elif arguments.together or arguments.video:
        _write_film(source, "" if len(shown) > 1 else next(iter(shown)), shown, avatar, arguments)
    else:
        for name, descriptors in shown.items():
            _write_film(source, name, {name: descriptors}, avatar, arguments)


def _write_film(
    source: Path, suffix: str, shown: dict[str, Descriptors], avatar: Avatar, arguments: argparse.Namespace
) -> None:
    from signface.progress import progress
    from signface.render.film import beside, pictures_of, read_film, write_film

    moments = {name: _moments(descriptors, arguments.rate, arguments) for name, descriptors in shown.items()}
    streams = [pictures_of(avatar, *values) for values in moments.values()]
    captions = list(moments) if len(moments) > 1 or arguments.video else []
    if arguments.video:
        begin = 0.0 if arguments.start is None else arguments.start
        streams.append(read_film(arguments.video, rate=arguments.rate, size=arguments.size, start_s=begin))
        captions.append("video")
    output = _output(source, suffix, ".mp4", arguments)
    pictures = (beside(list(parts), captions) for parts in zip(*streams))
    total = len(next(iter(moments.values()))[0])
    count = write_film(output, progress(pictures, output.name, total=total), arguments.rate)
    print(f"{output}: {count} pictures, {count / arguments.rate:.1f} s")


def _moments(
    descriptors: Descriptors, rate: float, arguments: argparse.Namespace
) -> tuple[np.ndarray, np.ndarray | None]:
    """Weights and, unless the head shall stay still or its pose is unknown, rotations of the head, for each picture."""
    from signface.render.film import at_rate, head_at_rate

    times = {"start_s": arguments.start, "end_s": arguments.end}
    head = None if arguments.head is False else head_at_rate(descriptors, rate, **times)
    if arguments.head and head is None:
        raise SignfaceError(f"{descriptors.name}: how the head moves is unknown", hint="leave --head out")
    return at_rate(descriptors, rate, **times), head


def _write_sheet(source: Path, shown: dict[str, Descriptors], avatar: Avatar, arguments: argparse.Namespace) -> None:
    from signface.render.film import pictures_of, read_film
    from signface.render.sheet import make_sheet, write_picture

    rows: dict[str, list[np.ndarray]] = {}
    for name, descriptors in shown.items():
        rows[name] = list(pictures_of(avatar, *_moments(descriptors, 1 / arguments.every, arguments)))
    count = len(next(iter(rows.values())))
    start = next(iter(shown.values())).start if arguments.start is None else arguments.start
    if arguments.video:
        begin = 0.0 if arguments.start is None else arguments.start
        film = read_film(arguments.video, rate=1 / arguments.every, size=arguments.size, start_s=begin)
        rows["video"] = [picture for picture, _ in zip(film, range(count))]
    times = [round(start + place * arguments.every, 3) for place in range(count)]
    output = _output(source, "" if len(shown) > 1 else next(iter(shown)), ".png", arguments)
    write_picture(output, make_sheet(rows, times))
    print(f"{output}: {count} stills of each of {len(rows)}")


def _output(source: Path, suffix: str, ending: str, arguments: argparse.Namespace) -> Path:
    folder = Path() if arguments.output is None else arguments.output
    return folder / (f"{source.stem}_{suffix}{ending}" if suffix else f"{source.stem}{ending}")


def _check_bases(descriptors: Descriptors, face: FaceModel) -> None:
    if descriptors.names != face.names:
        raise SignfaceError(
            f"{descriptors.name}: its bases are not those of the face {face.name}", hint="name the face with --face"
        )


def _default_layout(face: FaceModel) -> MarkerLayout:
    from signface.face.layout_files import read_layout

    if face.name != "default":
        raise SignfaceError("--markers needs to know where they stand", hint="name a layout with --layout")
    return read_layout("default-40", face)
