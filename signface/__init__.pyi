from . import datasets
from .annotation import Annotation, annotate
from .corpus.examples import solve_corpus
from .corpus.manifest import Corpus, read_corpus
from .corpus.running import run_corpus
from .descriptors import Descriptors
from .descriptors_files import read_weights, write_weights
from .elan.annotators import read_tiers
from .elan.reference import read_reference
from .elan.vocabularies import read_vocabulary
from .elan.writing import write_eaf
from .errors import SignfaceError, SignfaceWarning
from .evaluation.measure import Measured, evaluate
from .face.layout import MarkerLayout
from .face.layout_files import choose_layout, read_layout
from .face.model import FaceModel
from .face.reading import read_face
from .label.labellers import make_labeller
from .label.labelling import label_segments
from .label.model import TrainedModel
from .label.persistence import load_model, save_model
from .label.vocabulary import Vocabulary
from .learn.examples import Example, frame_table
from .learn.training import train
from .metrics.agreement import agreement_table
from .render.still import draw_face
from .report.evaluation.report import write_report
from .report.timeline import draw_timeline
from .segmentation.cutting import segment
from .segmentation.energy import energies
from .segmentation.segments import Segments, read_segments, write_segments
from .settings.eaf import EafOptions
from .settings.laboratory import read_settings
from .settings.solve import SolveSettings
from .settings.training import TrainingSettings
from .signer import Signer
from .solver.range_of_motion import calibrate_signer
from .solver.solving import solve, solve_pieces
from .takes.reading import open_recording, read_recording, read_take
from .takes.take import Take

__all__ = [
    "Annotation",
    "Corpus",
    "Descriptors",
    "EafOptions",
    "Example",
    "FaceModel",
    "MarkerLayout",
    "Measured",
    "Segments",
    "Signer",
    "SignfaceError",
    "SignfaceWarning",
    "SolveSettings",
    "Take",
    "TrainedModel",
    "TrainingSettings",
    "Vocabulary",
    "agreement_table",
    "annotate",
    "calibrate_signer",
    "choose_layout",
    "datasets",
    "draw_face",
    "draw_timeline",
    "energies",
    "evaluate",
    "frame_table",
    "label_segments",
    "load_model",
    "make_labeller",
    "open_recording",
    "read_corpus",
    "read_face",
    "read_layout",
    "read_recording",
    "read_reference",
    "read_segments",
    "read_settings",
    "read_take",
    "read_tiers",
    "read_vocabulary",
    "read_weights",
    "run_corpus",
    "save_model",
    "segment",
    "solve",
    "solve_corpus",
    "solve_pieces",
    "train",
    "write_eaf",
    "write_report",
    "write_segments",
    "write_weights",
]
