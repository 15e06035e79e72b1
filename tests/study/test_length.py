"""The consent counts the study's own films and minutes."""

from __future__ import annotations

import pytest

from signface.study.questionnaire.length import film_seconds, study_minutes, with_counts
from tests.fixtures.study_site import shipped_study, small_film


@pytest.mark.parametrize(("name", "films"), [("group-1", 18), ("group-2a", 18), ("group-2b", 12)])
def test_a_study_with_fewer_films_says_so(tmp_path, name, films):
    study = shipped_study(name, tmp_path, small_film(), intensities="[2]")
    text = with_counts(study.consent["en"], study)
    assert f"{films} short films" in text
    assert f"about {study_minutes(study)} minutes" in text
    assert "{" not in text


def test_more_films_take_longer(tmp_path):
    few = shipped_study("group-1", tmp_path / "few", small_film(), intensities="[2]")
    many = shipped_study("group-1", tmp_path / "many", small_film(), intensities="[1, 2, 3]")
    assert study_minutes(few) < study_minutes(many)


def test_the_length_of_a_film_is_read_from_its_header(tmp_path):
    import numpy as np

    from signface.render.film import write_film

    write_film(tmp_path / "a.mp4", np.zeros((50, 64, 64, 3), np.uint8), 25)
    assert film_seconds(tmp_path / "a.mp4") == pytest.approx(2.0, abs=0.05)
    (tmp_path / "b.webm").write_bytes(b"no movie header")
    assert film_seconds(tmp_path / "b.webm") is None
