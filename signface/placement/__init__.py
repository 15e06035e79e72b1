"""Which markers, how many, where (Reverdy 2019, chapter 3).

What is there to compare:

- `empirical`: layouts that laboratories use, placed on any face by anatomical landmarks.
- `sites`: where a marker may stand: symmetry, forbidden zones, least distance, fixed markers.
- `clusters`: k-means on the motion of the skin.
- `selection`: markers chosen one after the other by what they tell.
- `choosing`: a layout by any of these methods.

What it is compared on:

- `actors`: heads of people who do not exist, their range of motion and their takes.
- `evaluation`: the error of a layout, mapping by mapping.
- `comparison`: all of it, cell by cell, so that it can be resumed.
"""
