"""Training a classifier on annotated takes (thesis 4.4.3).

- `train`: a trained `TrainedModel`; `train_each`: one for each signer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from signface.errors import SignfaceError
from signface.label.calibration import fit_calibration
from signface.label.model import TrainedModel
from signface.learn.examples import Example, in_order
from signface.learn.fitting import fit_model
from signface.learn.folds import inner_folds
from signface.learn.intensity import train_intensity
from signface.learn.tuning import balanced_accuracy, cross_validate, search_parameters
from signface.settings.solve import SolveSettings
from signface.settings.training import TrainingSettings


def train(
    examples: Sequence[Example],
    settings: TrainingSettings = TrainingSettings(),
    *,
    solve: SolveSettings | None = None,
    corpus: str = "unknown",
    scores: Mapping[str, float] | None = None,
    name: str = "model",
) -> TrainedModel:
    """Train a classifier on annotated takes.

    Those of `NAMES` of `signface.label.labellers` learn from the frames of the stable segments; the sequence models of
    `SEQUENCE_NAMES` from whole takes, transitions included. Where the takes are annotated with intensities, those are
    learnt beside the labels (`signface.label.intensity`).

    A search looks for the best parameters among those of `signface.learn.tuning.GRIDS`, by takes (with several
    signers, by signers) left out of the training takes. Calibrated confidences mean the share of right labels, as
    found on takes left out in the same way; the calibration is kept where it helps on takes that it has not seen
    itself, and the card then also says how many labels of left-out takes were right.

    Parameters
    ----------
    examples : sequence of Example
        The training takes, and no others. Their order does not matter.
    settings : TrainingSettings
        What is trained and how. Two trainings with one seed on the same takes give the same model. Calibration trains
        `folds` times more.
    solve : SolveSettings, optional
        How the takes were solved; by default as they say themselves.
    corpus, scores : optional
        For the model's card.
    name : str
        Name of the model.

    Raises
    ------
    SignfaceError
        There is no training frame, only one label, a take has other bases, or the classifier has no such parameter.

    See Also
    --------
    signface.solve_corpus : the annotated takes of a corpus.
    signface.save_model : writes what was trained.
    signface.evaluate : trains and tests in folds.

    Examples
    --------
    >>> import signface as sf
    >>> examples = sf.datasets.mini_examples()
    >>> model = sf.train(examples, sf.TrainingSettings(classifier="knn3", calibrate=False))
    >>> model.card.labels
    ('A', 'D', 'J', 'N', 'Su')
    """
    if not examples:
        raise SignfaceError("there is no annotated take to train on", hint="name other kinds or another signer")
    takes = in_order(examples)
    chosen = settings
    if settings.search:
        best, _ = search_parameters(takes, settings)
        chosen = settings.changed(parameters={**settings.parameters, **best})
    model = fit_model(takes, chosen, name=name)
    solve = solve or next((t.descriptors.settings for t in takes if t.descriptors.settings is not None), None)
    card = replace(
        model.card,
        face="unknown" if solve is None else Path(solve.face).name,
        layout="chosen by markers" if solve is None or solve.layout is None else Path(solve.layout).name,
        solve={} if solve is None else solve.as_dict(),
        corpus=corpus,
        scores=dict(scores or {}),
        training=settings.as_dict(),
    )
    model = replace(model, card=card)
    if settings.calibrate:
        model = _calibrated(model, takes, chosen)
    return replace(model, intensity=train_intensity(takes))


def train_each(
    examples: Sequence[Example], settings: TrainingSettings = TrainingSettings(), *, name: str = "model", **about: Any
) -> dict[str, TrainedModel]:
    """A classifier for each signer, trained on the signer's own takes and named `NAME-SIGNER`.

    Parameters
    ----------
    examples, settings, name, **about :
        As in `train`.

    Returns
    -------
    dict of str to TrainedModel
        By signer, in alphabetical order.

    Raises
    ------
    SignfaceError
        As `train`.
    """
    signers = sorted({example.signer for example in examples})
    return {
        signer: train([e for e in examples if e.signer == signer], settings, name=f"{name}-{signer}", **about)
        for signer in signers
    }


def _calibrated(model: TrainedModel, examples: Sequence[Example], settings: TrainingSettings) -> TrainedModel:
    """The model with its calibration and its scores on left-out takes, where there are enough to leave any out."""
    try:
        pairs = inner_folds(examples, folds=settings.folds)
        table = cross_validate(pairs, settings) if pairs else None
    except SignfaceError:  # what is left shows one expression only: nothing can be said
        table = None
    if table is None:
        return model
    hits = (table["truth"] == table["found"]).to_numpy()
    what = "signers" if len(model.card.signers) > 1 else "takes"
    card = replace(
        model.card,
        calibration=fit_calibration(table["confidence"].to_numpy(float), hits, table["group"].tolist()),
        scores={
            **model.card.scores,
            f"accuracy on reference segments of left-out training {what}": float(hits.mean()),
            f"balanced accuracy on reference segments of left-out training {what}": balanced_accuracy(table),
        },
    )
    return replace(model, card=card)
