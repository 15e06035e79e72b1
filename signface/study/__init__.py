"""Perceptual studies: stimuli, questionnaire, statistics (thesis chapter 6)."""
