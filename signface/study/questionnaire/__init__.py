"""The questionnaire of a perceptual study, in the browser."""
