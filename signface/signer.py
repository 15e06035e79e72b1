"""Who signs: a name, bases of their own, and where their face rests.

- `Signer`: all that is known of one, in one object that every door takes; `Signer.read` and `Signer.save`.
- `SignerBases`: bases as one signer shows them, at named markers, from `signface calibrate`.
"""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from signface.content import Content
from signface.errors import SignfaceError
from signface.files import whole_file
from signface.signer_level import SignerLevel, SignerRest, signer_level

if TYPE_CHECKING:
    from signface.descriptors import Descriptors
    from signface.face.layout import MarkerLayout
    from signface.face.model import FaceModel


@dataclass(frozen=True, eq=False)
class SignerBases(Content):
    """Bases as one signer shows them: displacements of markers, in the face's unit.

    Parameters
    ----------
    bases, markers : (K,) tuples of str
    displacements : (K, 3) float64 array
        Of that marker at weight 1 of that base.
    source : str
        The file they were read from, for messages and histories.
    """

    bases: tuple[str, ...]
    markers: tuple[str, ...]
    displacements: np.ndarray
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        displacements = np.array(self.displacements, dtype=np.float64)
        if displacements.shape != (len(self.bases), 3) or len(self.bases) != len(self.markers):
            raise SignfaceError(
                f"{len(self.bases)} bases of a signer do not match displacements of {displacements.shape}"
            )
        if not np.isfinite(displacements).all():
            raise SignfaceError("has cells that are not numbers", file=self.source or None)
        self._hold(displacements=displacements)

    @classmethod
    def read(cls, path: str | PathLike[str]) -> SignerBases:
        """The bases in a csv with the columns `base, marker, x, y, z`.

        Raises
        ------
        SignfaceError
            There is no such file, or it is none that `signface calibrate` writes.
        """
        import pandas as pd

        file = Path(path)
        try:
            table = pd.read_csv(file, dtype={"base": str, "marker": str})
            displacements = table[["x", "y", "z"]].to_numpy(dtype=np.float64)
            return cls(tuple(table["base"]), tuple(table["marker"]), displacements, source=str(file))
        except FileNotFoundError:
            raise SignfaceError("no such file", file=file) from None
        except (OSError, ValueError, KeyError) as error:
            raise SignfaceError(
                "is no signer's file: its columns are base, marker, x, y, z",
                file=file,
                hint="signface calibrate makes one",
            ) from error

    @classmethod
    def of(cls, bases: np.ndarray, learnt: Sequence[str], face: FaceModel, layout: MarkerLayout) -> SignerBases:
        """Those of the (N, P, 3) bases at a layout's markers that were learnt: the others are the avatar's."""
        rows = [
            (name, marker, displacement)
            for name in learnt
            for marker, displacement in zip(layout.face_labels, bases[face.names.index(name)], strict=True)
        ]
        names, markers, displacements = zip(*rows, strict=True) if rows else ((), (), np.zeros((0, 3)))
        return cls(names, markers, np.array(displacements))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the bases as a csv, which `read` reads."""
        with whole_file(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(["base", "marker", "x", "y", "z"])
            for base, marker, displacement in zip(self.bases, self.markers, self.displacements, strict=True):
                writer.writerow([base, marker, *(f"{value:.5f}" for value in displacement)])

    def at(self, face: FaceModel, layout: MarkerLayout) -> np.ndarray:
        """(N, P, 3) bases at the markers of a layout; what is not known of the signer is the avatar's.

        Raises
        ------
        SignfaceError
            None of the face's bases is known at the layout's markers.
        """
        base_at, marker_at = ({name: i for i, name in enumerate(names)} for names in (face.names, layout.face_labels))
        placed, known = layout.bases(face), 0
        for base, marker, displacement in zip(self.bases, self.markers, self.displacements, strict=True):
            if base in base_at and marker in marker_at:
                placed[base_at[base], marker_at[marker]] = displacement
                known += 1
        if not known:
            raise SignfaceError(
                f"says nothing of the bases of {face.name} at the markers of {layout.name}",
                file=self.source or None,
                hint="calibrate the signer with this face and layout",
            )
        return placed


@dataclass(frozen=True)
class Signer:
    """A signer: what tiers are called, bases of their own, and where their face rests.

    Parameters
    ----------
    name : str
        Names the tiers (`affect@NAME`); may be empty.
    bases : SignerBases or path, optional
        What `signface calibrate` learnt of them; the avatar's serve where there are none.
    level : SignerLevel, optional
        Where their weights lie over all their takes. A classifier that normalises signers needs it; without it, each
        take is normalised by itself alone.
    rest : SignerRest, optional
        Where the landmarks of their resting face are, over all their takes. Without it each take's own neutral frame
        serves, which may lie in the middle of an expression.

    Raises
    ------
    SignfaceError
        The file of the bases is missing or none.

    See Also
    --------
    signface.settings.solve.SolveSettings : how any signer is solved.

    Examples
    --------
    >>> import signface as sf
    >>> sf.Signer("Eva").name
    'Eva'
    """

    name: str = ""
    bases: SignerBases | None = None
    level: SignerLevel | None = None
    rest: SignerRest | None = None

    def __post_init__(self) -> None:
        if self.bases is not None and not isinstance(self.bases, SignerBases):
            object.__setattr__(self, "bases", SignerBases.read(self.bases))

    def with_level(self, takes: Sequence[Descriptors]) -> Signer:
        """The signer with the level of these takes of theirs (`signer_level`)."""
        return replace(self, level=signer_level(takes))

    @property
    def bases_digest(self) -> str:
        """SHA-256 of the bases, wherever they were read; empty where there are none."""
        return self._digest_of("bases")

    @property
    def solving_digest(self) -> str:
        """SHA-256 of what changes the weights of a take, bases and rest; empty where there is neither."""
        return self.bases_digest if self.rest is None else f"{self.bases_digest}+{self._digest_of('rest')}"

    @property
    def level_digest(self) -> str:
        """SHA-256 of the level; empty where there is none."""
        return self._digest_of("level")

    def _digest_of(self, field: str) -> str:
        content = self._plain().get(field)
        return "" if content is None else hashlib.sha256(json.dumps(content).encode()).hexdigest()

    def _plain(self) -> dict[str, Any]:
        plain: dict[str, Any] = {"name": self.name}
        if self.bases is not None:
            rows = zip(self.bases.bases, self.bases.markers, self.bases.displacements.tolist(), strict=True)
            plain["bases"] = [[base, marker, *displacement] for base, marker, displacement in rows]
        if self.level is not None:
            plain["level"] = self.level.plain()
        if self.rest is not None:
            plain["rest"] = self.rest.plain()
        return plain

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the signer as JSON, which `read` reads to the last bit; or, as .csv, the bases alone.

        Raises
        ------
        SignfaceError
            The ending is neither, a .csv is to hold a signer without bases, or the folder cannot be written.
        """
        file = Path(path)
        if file.suffix.lower() == ".csv" and self.bases is not None:
            self.bases.save(file)
            return file
        if file.suffix.lower() != ".json":
            raise SignfaceError("the ending of a signer's file is .json", file=file)
        with whole_file(file) as temporary:
            temporary.write_text(json.dumps({"signface signer": 1, **self._plain()}, indent=1) + "\n", encoding="utf-8")
        return file

    @classmethod
    def read(cls, path: str | PathLike[str], *, name: str | None = None) -> Signer:
        """A signer from a file of `save`, or from bases alone (.csv of `signface calibrate`).

        Parameters
        ----------
        path : path
        name : str, optional
            In place of the file's; a csv has none.

        Raises
        ------
        SignfaceError
            There is no such file, or it is neither.
        """
        file = Path(path)
        if file.suffix.lower() != ".json":
            return cls(name or "", bases=SignerBases.read(file))
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            name_there = str(content["name"])
            level, rest = content.get("level"), content.get("rest")
            signer = cls(
                name_there,
                _bases(content.get("bases"), file),
                None if level is None else SignerLevel.from_plain(level),
                None if rest is None else SignerRest.from_plain(rest),
            )
        except FileNotFoundError:
            raise SignfaceError("no such file", file=file) from None
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise SignfaceError("is no signer's file", file=file, hint="signface corpus signers makes them") from error
        return signer if name is None else replace(signer, name=name)


def _bases(rows: Any, file: Path) -> SignerBases | None:
    if rows is None:
        return None
    displacements = np.array([row[2:] for row in rows], dtype=np.float64).reshape(len(rows), 3)
    return SignerBases(tuple(str(r[0]) for r in rows), tuple(str(r[1]) for r in rows), displacements, source=str(file))
