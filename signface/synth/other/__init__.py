"""A second synthetic corpus, made by other rules than `signface.synth`: to test on, never to train on."""
