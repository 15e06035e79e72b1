"""Annotate the faces of signers: recordings in, ELAN tiers out.

>>> import signface as sf

**Read**

=========================== ==============================================================================
`read_take`                 A recording of markers, whatever its format
`read_recording`            A recording of markers, or the weights that a phone captured
`open_recording`            The same, not yet in memory: for recordings of any length
`read_weights`              Weights that were written before
`read_face`                 A face: the one that ships, or a file
`read_layout`               Where the markers stand on a face
`choose_layout`             The shipped layout that fits a recording's markers
`read_reference`            What an annotator said of the affect, from an EAF
`read_tiers`                All tiers of an EAF, as tables
`read_vocabulary`           The labels of a tier, from an EAF, a template or a text file
`read_segments`             Segments that were written before
`read_settings`             What a laboratory decided once, from its TOML
`datasets`                  Synthetic recordings to try things on
=========================== ==============================================================================

**Annotate a recording**

=========================== ==============================================================================
`solve`                     The weights of a recording; `solve_pieces`, of one of any length
`calibrate_signer`          What a signer's own bases are, from a take in which they are shown
`segment`                   Weights cut into stable segments and transitions
`energies`                  The energies of the weights' velocity and acceleration, on which they are cut
`load_model`                A trained classifier: one that ships, or a file
`label_segments`            The labels of segments, each with a confidence
`annotate`                  A recording to labelled segments: all of the above at once
=========================== ==============================================================================

**Write**

=========================== ==============================================================================
`write_eaf`                 An annotation for ELAN, with its curves
`write_weights`             Weights to csv or Parquet
`write_segments`            Segments to csv
=========================== ==============================================================================

**Corpora: train and evaluate**

=========================== ==============================================================================
`read_corpus`               The takes of a corpus, from its `takes.csv`
`run_corpus`                Solve and annotate all of it
`solve_corpus`              Its annotated takes, solved: what training and evaluation learn from
`train`                     A classifier of one's own, for affect or any other tier
`save_model`                A trained classifier to a file
`evaluate`                  Classifiers measured on takes and signers that they were not trained on
`write_report`              A page of what was measured, with figures and tables
`frame_table`               Frames and their labels as X and y, for scikit-learn
`make_labeller`             An untrained classifier by its name, an estimator of scikit-learn
`agreement_table`           How far annotators agree
=========================== ==============================================================================

**Look**

=========================== ==============================================================================
`draw_timeline`             Energies and segments of a take
`draw_face`                 A face with some weights
=========================== ==============================================================================

**Decisions**: `SolveSettings` (how to solve), `TrainingSettings` (how to train), `EafOptions` (how to write an EAF),
`Signer` (who signs), `Vocabulary` (what a tier may say).

**Data**: `Take`, `FaceModel`, `MarkerLayout`, `Descriptors` (weights in time), `Segments`, `Annotation`,
`TrainedModel`, `Corpus`, `Example` (a take with its reference), `Measured` (an evaluation).

**Errors**: `SignfaceError` is raised for whatever the user can mend, `SignfaceWarning` warned of.

Each name is imported when it is first used, so that `import signface` takes some milliseconds.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
