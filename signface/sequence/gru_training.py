"""How the recurrent network of `signface.sequence.gru` is trained, by PyTorch.

- `Lesson`: what is learnt from one take.
- `train_networks`, `train_network`: the weights of trained networks.
- `make_network`, `weights_of`: the network in PyTorch, and its weights as `recurrent_outputs` takes them.

One thread does all the work, so that the same takes and the same seed give the same weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from joblib import Parallel, cpu_count, delayed

from signface.content import Content
from signface.errors import SignfaceError

if TYPE_CHECKING:
    from signface.sequence.frame_features import FrameFeatures

#: Recurrent layers.
LAYERS = 2

#: Share of units that are left out at random while training, and of features.
DROPPED = 0.4
DROPPED_FEATURES = 0.1

#: Decay of the weights (AdamW), and the longest gradient.
DECAY = 1e-3
LONGEST = 1.0

#: Share of the steps in which the step size grows.
GROWING = 0.15

#: Weight of the boundaries against the states: they are rare.
MARKS = 2.0

#: Frames of a corpus from which on networks are trained in processes of their own.
WORTH_PROCESSES = 20_000

#: Code of frames that are not annotated.
UNKNOWN = -1


class NetworkSettings(Protocol):
    """What training reads of a `signface.sequence.gru.RecurrentLabeller`; its parameters are described there."""

    networks: int
    units: int
    effort: float
    batch: int
    stretch: int
    rate: float
    gain: float
    noise: float
    seed: int
    mean_: np.ndarray
    scale_: np.ndarray
    n_features_in_: int
    _frames: FrameFeatures


@dataclass(frozen=True, eq=False)
class Lesson(Content):
    """What is learnt from one take.

    Parameters
    ----------
    features : (K, N) float32 array
        Standardised.
    codes : (K,) array of int
        State of each frame; -1 where nothing is annotated.
    marks : (K, 2) float32 array
        See `signface.sequence.gru.boundary_marks`.
    """

    features: np.ndarray
    codes: np.ndarray
    marks: np.ndarray


def make_network(inputs: int, units: int, outputs: int) -> Any:
    """A network with random weights, a `torch.nn.Module` from (B, K, inputs) to (B, K, outputs).

    Raises
    ------
    SignfaceError
        PyTorch is not installed.
    """
    torch = _torch()

    class Network(torch.nn.Module):  # type: ignore[name-defined]
        def __init__(self) -> None:
            super().__init__()
            self.drop_features = torch.nn.Dropout(DROPPED_FEATURES)
            self.drop = torch.nn.Dropout(DROPPED)
            self.smaller = torch.nn.Linear(inputs, units)
            self.recurrent = torch.nn.GRU(units, units, LAYERS, batch_first=True, bidirectional=True, dropout=DROPPED)
            self.out = torch.nn.Linear(2 * units, outputs)

        def forward(self, features: Any) -> Any:
            hidden = torch.tanh(self.smaller(self.drop_features(features)))
            return self.out(self.drop(self.recurrent(self.drop(hidden))[0]))

    return Network()


def weights_of(network: Any) -> dict[str, np.ndarray]:
    """The weights of a network as `signface.sequence.gru.recurrent_outputs` takes them, for this one network."""
    held = {name: values.detach().numpy().copy() for name, values in network.state_dict().items()}
    weights = {
        "in_weight": held["smaller.weight"].T,
        "in_bias": held["smaller.bias"],
        "out_weight": held["out.weight"].T,
        "out_bias": held["out.bias"],
    }
    for layer in range(LAYERS):
        for name, theirs in (("input", "ih"), ("state", "hh")):
            both = [f"_{theirs}_l{layer}", f"_{theirs}_l{layer}_reverse"]
            weights[f"{name}_{layer}"] = np.stack([held[f"recurrent.weight{end}"].T for end in both])
            weights[f"{name}_bias_{layer}"] = np.stack([held[f"recurrent.bias{end}"] for end in both])
    return {name: np.ascontiguousarray(values) for name, values in weights.items()}


def train_networks(
    lessons: Sequence[Lesson], settings: NetworkSettings, mirrored: np.ndarray
) -> list[dict[str, np.ndarray]]:
    """The weights of `settings.networks` trained networks; see `train_network`.

    They are trained side by side, in a process each, where there are cores and it is worth the while.
    """
    _torch()
    frames = sum(len(lesson.codes) for lesson in lessons)
    jobs = min(settings.networks, cpu_count()) if frames > WORTH_PROCESSES else 1
    return Parallel(n_jobs=jobs)(
        delayed(train_network)(lessons, settings, mirrored, settings.seed + number)
        for number in range(settings.networks)
    )


def train_network(
    lessons: Sequence[Lesson], settings: NetworkSettings, mirrored: np.ndarray, seed: int
) -> dict[str, np.ndarray]:
    """The weights of a trained network.

    Parameters
    ----------
    lessons : sequence of Lesson
    settings : NetworkSettings
        Its parameters, and the means and scales of the features.
    mirrored : (N,) array of int
        Where each feature stands in the mirror image of a face.
    seed : int

    Raises
    ------
    SignfaceError
        PyTorch is not installed.
    """
    torch = _torch()
    rng = np.random.default_rng(seed)
    batch = min(settings.batch, len(lessons))
    frames = sum(len(lesson.codes) for lesson in lessons)
    steps = max(2, round(settings.effort * (frames / (settings.batch * settings.stretch)) ** 0.5))
    states = int(max(lesson.codes.max() for lesson in lessons)) + 1
    with torch.random.fork_rng(devices=[]):
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            torch.manual_seed(seed)
            network = make_network(len(settings.mean_), settings.units, states + 2)
            network.train()
            optimiser = torch.optim.AdamW(network.parameters(), lr=settings.rate, weight_decay=DECAY)
            course = torch.optim.lr_scheduler.OneCycleLR(optimiser, settings.rate, total_steps=steps, pct_start=GROWING)
            for _ in range(steps):
                features, codes, marks = (
                    torch.from_numpy(part) for part in _drawn(lessons, batch, settings, mirrored, rng)
                )
                output = network(features)
                known = codes != UNKNOWN
                loss = torch.nn.functional.cross_entropy(output[known][:, :states], codes[known])
                loss = loss + MARKS * torch.nn.functional.binary_cross_entropy_with_logits(
                    output[known][:, states:], marks[known]
                )
                optimiser.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(network.parameters(), LONGEST)
                optimiser.step()
                course.step()
            return weights_of(network)
        finally:
            torch.set_num_threads(threads)


def _drawn(
    lessons: Sequence[Lesson], batch: int, settings: NetworkSettings, mirrored: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stretches of takes, drawn and changed at random: features, codes and marks, filled up to the longest."""
    share = np.array([len(lesson.codes) for lesson in lessons], float)
    drawn = [lessons[number] for number in rng.choice(len(lessons), batch, p=share / share.sum())]
    frames = min(settings.stretch, max(len(lesson.codes) for lesson in drawn))
    features = np.zeros((batch, frames, lessons[0].features.shape[1]), np.float32)
    codes = np.full((batch, frames), UNKNOWN)
    marks = np.zeros((batch, frames, 2), np.float32)
    zero = (settings.mean_ / settings.scale_).astype(np.float32)  # less this, a feature is its distance from nothing
    bases = settings.n_features_in_
    by_base = settings._frames.width(bases)
    for row, lesson in enumerate(drawn):
        count = len(lesson.codes)
        first = int(rng.integers(0, max(count - frames, 0) + 1))
        last = min(first + frames, count)
        part = lesson.features[first:last]
        if rng.random() < 0.5:
            part = part[:, mirrored]
        gains = np.exp(rng.normal(0, settings.gain, bases) + rng.normal(0, settings.gain / 2))
        every = np.ones(part.shape[1], np.float32)
        every[:by_base] = np.tile(gains, by_base // bases)
        shift = rng.normal(0, settings.noise, part.shape[1]).astype(np.float32)
        features[row, : last - first] = (part + zero) * every - zero + shift
        codes[row, : last - first], marks[row, : last - first] = lesson.codes[first:last], lesson.marks[first:last]
    return features, codes, marks


def _torch() -> Any:
    try:
        import torch
    except ImportError as error:
        raise SignfaceError(
            "training a recurrent network needs PyTorch", hint='install it with pip install "signface[deep]"'
        ) from error
    return torch
