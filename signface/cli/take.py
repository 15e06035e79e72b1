"""`signface take info`: what is in a recording, before anything is done with it."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import Any

EXAMPLE = "  signface take info take.c3d\n  signface take info recordings/*.c3d --json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `signface take`."""
    actions = parser.add_subparsers(dest="action", metavar="info", required=True)
    info = actions.add_parser(
        "info",
        help="frames, rate, duration, unit, markers, gaps, head markers, and markers that are wrong",
        description="Say what a recording holds: frames, rate, duration, unit, markers, gaps, head markers; and which"
        " markers are ghosts, swapped or frozen.",
        epilog=f"example:\n{EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    info.add_argument("takes", nargs="+", metavar="TAKE", help="a recording, in one of the formats of --formats")
    info.add_argument("--formats", action=_ListFormats, help="list the formats that signface reads, and leave")
    info.add_argument("--unit", help="unit of length of the files (mm, cm, m, in), where they say none or a wrong one")
    info.add_argument(
        "--rate",
        type=float,
        metavar="HZ",
        help="frames per second of the recording, where it says none or wrong ones; every row is then a frame",
    )
    info.add_argument(
        "--start", type=float, metavar="SECONDS", help="time of the recording's first frame, where it says another"
    )
    info.add_argument("--subject", metavar="NAME", help="whose markers, of several signers in one recording")
    info.add_argument("--face", default="default", help="face whose layouts are tried (default: the shipped one)")
    info.add_argument("--json", action="store_true", help="print JSON, for scripts")


class _ListFormats(argparse.Action):
    """Prints the formats and ends, as `--help` does; they are imported when they are asked for."""

    def __init__(self, option_strings: list[str], dest: str, help: str | None = None) -> None:
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from signface.takes.formats.registry import supported_formats

        for format in supported_formats():
            endings = f" ({', '.join(format.endings)})" if format.endings else ""
            print(f"{format.name:10} {format.title}{endings}: {format.holds}; written by {format.written_by}")
        parser.exit()


def _shortened(words: list[str], most: int = 12) -> str:
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")


def _report(file: str, content: dict[str, Any]) -> str:
    """The description as lines for a person."""
    lines = [
        f"{file}",
        f"  {content['frames']} frames at {content['rate_hz']:g} Hz: {content['duration_s']:.3f} s"
        f" from {content['start_s']:.3f} s",
    ]
    if content["kind"] == "weights":
        lines.append(f"  weights of {len(content['bases'])} bases: {_shortened(content['bases'])}")
    else:
        gaps = content["gaps"]
        lines.append(f"  unit found: {content['unit_found']}; millimetres from here on")
        lines.append(f"  {len(content['markers'])} markers: {_shortened(content['markers'])}")
        if not gaps:
            lines.append("  gaps: none")
        for label, gap in sorted(gaps.items(), key=lambda entry: -entry[1]["missing_s"])[:12]:
            span = f"{gap['missing_s']:.3f} s in all, the longest {gap['longest_s']:.3f} s"
            lines.append(f"  gaps of {label}: {gap['gaps']}, {span}")
        if len(gaps) > 12:
            lines.append(f"  and {len(gaps) - 12} more markers with gaps")
        wrong = content["wrong_markers"]
        lines += [f"  wrong: {one['text']}" for one in wrong[:12]] or ["  wrong markers: none found"]
        lines += [f"  and {len(wrong) - 12} more that are wrong"] if len(wrong) > 12 else []
        if content["layout"] is None:
            lines.append(f"  layout: none of the shipped ones ({content['note']})")
        else:
            signers = content["signers"]
            if len(signers) > 1:
                named = ", ".join(signer or "one without a name" for signer in signers)
                lines.append(
                    f"  {len(signers)} signers: {named}; what follows is of one of them, --subject chooses whom"
                )
            lines.append(f"  layout: {content['layout']}, {content['face_markers']} face markers")
            lines += [f"  but it {content['note']}"] if "note" in content else []
            lines.append(f"  head markers: {_shortened(content['head_markers']) or 'none'}")
            if content["missing"]:
                lines.append(f"  not in the take: {_shortened(content['missing'])}")
    lines += [f"  history: {entry}" for entry in content["history"]]
    return "\n".join(lines)


def run(arguments: argparse.Namespace) -> int:
    """Describe each take; 0 unless one cannot be read."""
    from signface.face.reading import read_face
    from signface.solver.recognition import recognise_layout, wrong_markers
    from signface.takes.description import describe_take, describe_weights
    from signface.takes.reading import read_recording
    from signface.takes.take import Take

    described = []
    for file in arguments.takes:
        recording = read_recording(
            file, unit=arguments.unit, rate=arguments.rate, start=arguments.start, subject=arguments.subject
        )
        if isinstance(recording, Take):
            content = describe_take(recording)
            history = content.pop("history")
            face = read_face(arguments.face)
            wrong = [{**asdict(one), "text": str(one)} for one in wrong_markers(recording, face)]
            content |= {"wrong_markers": wrong, **recognise_layout(recording, face), "history": history}
        else:
            content = describe_weights(recording)
        if arguments.json:
            described.append({"file": str(file), **content})
        else:
            print(_report(str(file), content))
    if arguments.json:
        print(json.dumps(described, indent=2, ensure_ascii=False))
    return 0
